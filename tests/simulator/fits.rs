//! Fits that continue from another fit, compared with fits from the start; and effects evaluated block by block,
//! compared with the evaluation at once.

use dynocar_analysis::explain::effects::{Candidate, LIBRARY};
use dynocar_analysis::explain::evidence::SampleForces;
use dynocar_analysis::explain::hypothesis::{On, Past};
use dynocar_analysis::explain::scan::Scan;
use dynocar_analysis::explain::selection::Search;
use dynocar_analysis::explain::{Explanation, explain};
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::dataset_writer::{dataset_files, read_files};
use dynocar_tests::simulator::{EffectRequest, SimulatorSettings, TrueDeviations, simulate};

/// Calls `look` with the library's proposals for a train with late forces, when only a, b and c are fitted.
fn proposed(look: impl Fn(&Explanation, &Scan, Vec<Candidate>)) {
    let simulated = simulate(&SimulatorSettings {
        deviations: TrueDeviations::ROUGH,
        ..SimulatorSettings::new(77_001, EffectRequest::Kinds(vec![EffectKind::ActuatorDelay]))
    });
    let dataset = read_files(&dataset_files(&simulated));
    let explanation = explain(&dataset, &|_, _| ()).unwrap();
    let search = Search {
        problem: &explanation.problem,
        holdout: &explanation.holdout,
        train: &dataset.train,
        track: dataset.track.as_ref(),
        progress: &|_, _| (),
    };
    let scan = search.scan(&explanation.outcome.base).unwrap();
    let candidates = LIBRARY.iter().flat_map(|kind| kind.propose(&scan).unwrap_or_default());
    look(&explanation, &scan, candidates.collect());
}

#[test]
fn a_fit_that_goes_on_from_another_ends_where_one_from_the_start_does() {
    proposed(|Explanation { problem, outcome, .. }, _, candidates| {
        let base = &outcome.base;
        let mut compared = 0;
        for candidate in candidates {
            let kind = candidate.hypothesis.kind().name();
            let (effect, start) = candidate.from_none();
            if start.iter().any(|value| *value != effect.none()) {
                continue;
            }
            let on = problem.grown(base, [(effect.clone(), start.clone())]);
            let model = base.model.with(effect);
            let anew = problem.fit(&model, [&base.theta[..], &start].concat(), base.noise);
            let away = (on.cost - anew.cost).abs();
            assert!(away < 0.02, "{kind}: {} and {}", on.cost, anew.cost);
            let std = on.factor().unwrap().inverse().diagonal().map(f64::sqrt);
            for (i, (on, anew)) in on.theta.iter().zip(&anew.theta).enumerate() {
                assert!((on - anew).abs() < 0.05 * std[i], "{kind} {i}: {on} and {anew}");
            }
            compared += 1;
        }
        assert!(compared > 6, "only {compared} kinds start from none");
    });
}

#[test]
fn a_time_constant_of_an_effect_of_no_size_leaves_the_others_known() {
    proposed(|Explanation { problem, outcome, .. }, _, candidates| {
        let base = &outcome.base;
        let is_warming = |it: &Candidate| it.hypothesis.kind() == EffectKind::BearingTemperature;
        let warming = candidates.into_iter().find(is_warming).expect("bearings warm up");
        let model = base.model.with(warming.hypothesis.clone());
        let (size, tau_s) = (warming.hypothesis.none(), 250.0);
        let fit = problem.at(&model, [&base.theta[..], &[size, tau_s]].concat(), base.noise);
        let covariance = fit.factor().expect("all is known to be somewhere").inverse();
        let within = &warming.hypothesis.parameters()[1];
        let anywhere_s = (within.upper - within.lower) / 12_f64.sqrt();
        let std_s = covariance[(4, 4)].sqrt();
        assert!((std_s - anywhere_s).abs() < 1e-6 * anywhere_s, "{std_s} s");
    });
}

#[test]
fn what_looks_back_does_the_same_block_by_block() {
    proposed(|Explanation { problem, .. }, _, candidates| {
        let looking_back: Vec<Candidate> =
            candidates.into_iter().filter(|it| it.hypothesis.nature().looks_back).collect();
        assert_eq!(looking_back.len(), 3, "late forces, a late brake and a late speed");
        for (Candidate { hypothesis, .. }, run) in
            looking_back.iter().zip(problem.runs[..2].iter().cycle())
        {
            let parameters = [0.37, 0.6];
            let mut at_once: Vec<SampleForces> = run.declared.all().collect();
            let on = On { run, first: 0, past: &mut Past::default() };
            hypothesis.apply(&parameters, on, &mut at_once);
            // Findings in an earlier run are forgotten.
            let mut past = Past::default();
            for run in [&problem.runs[2], run] {
                let declared: Vec<SampleForces> = run.declared.all().collect();
                let mut by_blocks = declared.clone();
                for (number, block) in by_blocks.chunks_mut(100).enumerate() {
                    let on = On { run, first: 100 * number, past: &mut past };
                    hypothesis.apply(&parameters, on, block);
                }
                assert!(run.file != problem.runs[2].file || by_blocks != declared);
                assert!(run.file == problem.runs[2].file || by_blocks == at_once, "{}", run.file);
            }
        }
    });
}

#[test]
fn a_local_force_is_weighed_as_all_that_the_filter_makes_of_it() {
    proposed(|Explanation { problem, .. }, scan, _| {
        let (run, fit) = (&problem.runs[0], scan.fit);
        let shape: Vec<f64> = (0..10).map(|bin| 0.02 + 0.01 * f64::from(bin).cos()).collect();
        let mut mps2 = vec![0.0; run.bins.len()];
        mps2[50..60].copy_from_slice(&shape);
        let mut gained_mps = vec![0.0; mps2.len()];
        for (k, bins) in run.bins.windows(2).enumerate() {
            if bins[0].segment == bins[1].segment {
                let step_s = bins[1].time_s - bins[0].time_s;
                gained_mps[k + 1] = gained_mps[k] + 0.5 * step_s * (mps2[k] + mps2[k + 1]);
            }
        }
        let mut innovations = Vec::new();
        fit.whitener(0).whiten(&gained_mps, &mut innovations);
        let filter = &fit.filters[0];
        let with = |other: &[f64]| -> f64 {
            let rows = innovations.iter().zip(other).zip(filter.weights());
            rows.map(|((own, other), weight)| weight * own * other).sum()
        };
        let is_near = |one: f64, other: f64| (one - other).abs() < 1e-9 * (1.0 + other.abs());
        let tuple = scan.local_tuple(0, 50, &shape);
        let explained = filter.explained(filter.columns().each_ref().map(|column| with(column)));
        assert!(with(&innovations) > 1.0 && is_near(tuple.square, with(&innovations) - explained));
        assert!(is_near(tuple.score, with(&fit.innovations[0])));
        for (cross, column) in tuple.cross.iter().zip(&fit.columns[0]) {
            assert!(is_near(*cross, with(column)));
        }
    });
}
