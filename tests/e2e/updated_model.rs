//! The daemon applies the fit of `explain`, written as files, with the same bits.

use dynocar_analysis::dataset::{Dataset, parse_track, parse_train};
use dynocar_analysis::explain::effects::{Candidate, LIBRARY, On, Past, UNKNOWN};
use dynocar_analysis::explain::evidence::{
    Fit, FitProblem, Noise, RunData, SampleForces, UpdatedForces, UpdatedModel, prepare,
};
use dynocar_analysis::explain::scan::Scan;
use dynocar_model::terms::wheel;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::dataset_writer::{dataset_files, read_files};
use dynocar_tests::simulator::{
    EffectRequest, SimulatedDataset, SimulatorSettings, TrainType, TrueEffect, simulate,
};
use dynocar_workshop::updated::grow;

/// A dataset on which every kind can be tried, without wheel slip and outliers.
fn simulated() -> SimulatedDataset {
    let effects = vec![
        TrueEffect::TunnelDrag { c_factor: 2.2 },
        TrueEffect::LocalResistance {
            extra_n_per_kn: 3.0,
            intervals_m: vec![(2000.0, 3500.0)],
            runs: Vec::new(),
        },
    ];
    simulate(&SimulatorSettings {
        train_type: Some(TrainType::Regional),
        wheel_slips_per_run: 0.0,
        duration_s: 600.0,
        ..SimulatorSettings::new(9001, EffectRequest::Exactly(effects))
    })
}

/// The text of one of the dataset's files.
fn text<'f>(files: &'f [(String, String)], name: &str) -> &'f str {
    &files.iter().find(|(path, _)| path == name).expect("a file").1
}

/// The forces on a run under a fitted model, and its speed scale.
fn fitted_forces(fit: &Fit, run: &RunData) -> (Vec<SampleForces>, f64) {
    let mut forces: Vec<SampleForces> = run.declared.all().collect();
    let mut speed_scale = 1.0;
    for (effect, range) in fit.model.effects.iter().zip(fit.model.ranges()) {
        let on = On { run, first: 0, past: &mut Past::default() };
        effect.apply(&fit.theta[range.clone()], on, &mut forces);
        speed_scale *= effect.speed_scale(&fit.theta[range]);
    }
    (forces, speed_scale)
}

/// Asserts that the daemon resolves the same forces as the fit; its mass is that of the section.
fn assert_same_forces(kind: EffectKind, fit: &Fit, declared: &RunData, grown: &RunData) {
    let (fitted, speed_scale) = fitted_forces(fit, declared);
    assert_eq!(fitted.len(), grown.declared.all().len());
    let speeds = declared.samples().iter().zip(grown.samples());
    for (k, ((fitted, applied), (before, after))) in
        fitted.iter().zip(grown.declared.all()).zip(speeds).enumerate()
    {
        let fitted = SampleForces {
            mass_kg: fitted.mass_kg * fitted.mass_factor,
            mass_factor: 1.0,
            ..*fitted
        };
        assert_eq!(fitted, applied, "{kind}, {} sample {k}", declared.file);
        let speed_mps = wheel::true_speed_mps(before.speed_mps, speed_scale);
        assert_eq!(speed_mps, after.speed_mps, "{kind}, {} sample {k}", declared.file);
    }
}

#[test]
fn every_kind_written_as_an_updated_model_is_applied_to_the_bit() {
    let files = dataset_files(&simulated());
    let dataset = read_files(&files);
    let runs = prepare(&dataset).expect("usable runs");
    assert!(runs.iter().all(|run| run.replaced == 0), "no outliers");
    let problem = FitProblem::new(runs.clone(), dataset.train.resistance);
    let base = problem.fit(&UpdatedModel::default(), problem.start(&[]), Noise::START);
    let track = dataset.track.as_ref();
    let scan = Scan::new(&problem, &[], &dataset.train, track, &base).expect("a sound fit");
    let mut applied = Vec::new();
    for effect in LIBRARY.iter().chain([UNKNOWN]) {
        for Candidate { hypothesis, start } in effect.propose(&scan).unwrap_or_default() {
            let theta = base.theta.iter().chain(&start).copied().collect();
            let fit = problem.fit(&base.model.with(hypothesis), theta, base.noise);
            let mut train_table = text(&files, "train.toml").parse().expect("TOML");
            let mut track_table = text(&files, "track.toml").parse().expect("TOML");
            if !grow(&fit, &mut train_table, &mut track_table).is_empty() {
                continue;
            }
            let train = parse_train("train.toml", &train_table.to_string()).expect("a train");
            let track = parse_track("track.toml", &track_table.to_string()).expect("a line");
            assert_eq!(train.resistance.a, fit.theta[0]);
            assert_eq!([train.resistance.b, train.resistance.c], fit.theta[1..3]);
            let grown =
                Dataset { train: train.into(), track: Some(track.into()), ..dataset.clone() };
            let grown = prepare(&grown).expect("usable runs");
            for (declared, grown) in runs.iter().zip(&grown) {
                assert_same_forces(effect.kind, &fit, declared, grown);
            }
            applied.push(effect.kind);
        }
    }
    applied.sort_unstable();
    applied.dedup();
    // Events of certain runs are no property of a train or a line.
    let events = [EffectKind::None, EffectKind::DraggingBrake, EffectKind::LowAdhesion];
    let expected: Vec<EffectKind> =
        EffectKind::ALL.iter().copied().filter(|kind| !events.contains(kind)).collect();
    assert_eq!(applied, expected);
}

#[test]
fn what_a_fit_remembers_is_what_all_effects_do_at_the_samples() {
    let dataset = read_files(&dataset_files(&simulated()));
    let runs = prepare(&dataset).expect("usable runs");
    let problem = FitProblem::new(runs, dataset.train.resistance);
    let base = problem.fit(&UpdatedModel::default(), problem.start(&[]), Noise::START);
    let track = dataset.track.as_ref();
    let scan = Scan::new(&problem, &[], &dataset.train, track, &base).expect("a sound fit");
    let candidates = |kind: EffectKind| {
        let mut effects = LIBRARY.iter().chain([UNKNOWN]);
        let effect = effects.find(|effect| effect.kind == kind).expect("a kind");
        effect.propose(&scan).unwrap_or_default()
    };
    let beside = [EffectKind::WheelDiameter, EffectKind::RotatingMass, EffectKind::ActuatorDelay];
    let mut looked_at = 0;
    for first in beside.into_iter().flat_map(candidates) {
        let with = problem.grown(&base, [first.parts()]);
        let others = EffectKind::ALL.iter().filter(|kind| !beside.contains(kind));
        let others = others.filter(|kind| **kind != EffectKind::None);
        for second in others.flat_map(|kind| candidates(*kind)) {
            let fit = problem.grown(&with, [second.parts()]);
            let (mut forces, mut bins) = (UpdatedForces::default(), Vec::new());
            for (run, residuals) in problem.runs.iter().zip(&fit.residuals) {
                fit.model.predict_bins(run, &fit.theta, &mut forces, &mut bins);
                for ((bin, modelled), residual) in run.bins.iter().zip(&bins).zip(residuals) {
                    let expected = bin.speed_mps - modelled;
                    assert!(
                        (residual - expected).abs() < 1e-7,
                        "{:?} {residual}",
                        fit.model.effects
                    );
                }
            }
            looked_at += 1;
        }
    }
    assert!(looked_at > 30, "{looked_at}");
}
