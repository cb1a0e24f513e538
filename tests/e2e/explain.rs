//! `explain` on simulated datasets whose truth is known.

use std::path::Path;

use dynocar::dataset;
use dynocar_analysis::dataset::parse_train;
use dynocar_analysis::explain::answer::{ParameterValue, Verdict};
use dynocar_analysis::explain::effects::LIBRARY;
use dynocar_analysis::explain::scan::Scan;
use dynocar_analysis::explain::selection::deviations;
use dynocar_analysis::explain::{Explanation, explain};
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::dataset_writer::write_dataset;
use dynocar_tests::simulator::oracle::score;
use dynocar_tests::simulator::{
    EffectRequest, Law, SimulatedDataset, SimulatorSettings, TrainType, TrueEffect, Unlisted,
    simulate,
};
use dynocar_workshop::updated::write_updated;

use crate::explained::{Explained, SEED, explained as explained_once};

fn explained(simulated: &SimulatedDataset, folder: &Path) -> Explanation {
    write_dataset(simulated, folder).expect("a folder to write to");
    let dataset = dataset::load(folder).expect("a simulated dataset");
    explain(&dataset, &|_, _| {}).expect("usable runs")
}

/// A dataset with an effect of a kind, also in a folder.
fn with_kind(kind: EffectKind, folder: &Path) -> &'static Explained {
    let explained = explained_once(kind);
    write_dataset(&explained.simulated, folder).expect("a folder to write to");
    explained
}

#[test]
fn nothing_undeclared_is_called_nothing() {
    let explanation = &explained_once(EffectKind::None).explanation;
    assert_eq!(explanation.answer.verdict, Verdict::None, "{}", explanation.answer.statement);
    assert!(explanation.answer.effects.is_empty());
}

#[test]
fn what_one_run_alone_shows_is_found_where_the_others_gain_nothing_from_it() {
    // Only one fit run goes on over one of the two sections: left out, the others say nothing of it.
    let request = EffectRequest::Kinds(vec![EffectKind::MassChange]);
    let simulated = simulate(&SimulatorSettings::new(9005, request));
    let folder = tempfile::tempdir().unwrap();
    let answer = explained(&simulated, folder.path()).answer;
    let kinds: Vec<&str> = answer.effects.iter().map(|effect| effect.kind).collect();
    assert_eq!((answer.verdict, &kinds[..]), (Verdict::Effect, &["mass_change"][..]));
    assert!(answer.rmse_after.unwrap() < 0.2 * answer.rmse_before.unwrap(), "{}", answer.statement);
}

#[test]
fn a_number_is_no_surer_than_the_map_that_all_runs_share() {
    let explanation = &explained_once(EffectKind::RotatingMass).explanation;
    let effect = &explanation.answer.effects[0];
    assert_eq!(effect.kind, "rotating_mass", "{}", explanation.answer.statement);
    let ParameterValue::Number(stated) = effect.std["rotating_mass_factor"] else {
        panic!("a standard deviation is a number");
    };
    let by_runs_alone = deviations(&explanation.outcome.fit).covariance[(3, 3)].sqrt();
    assert!(stated > 1.1 * by_runs_alone, "{stated}, and {by_runs_alone} by the runs alone");
}

#[test]
fn a_curve_resistance_is_found_and_the_updated_files_leave_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let Explained { simulated, explanation } =
        with_kind(EffectKind::CurveResistance, folder.path());
    let answer = &explanation.answer;
    assert_eq!(answer.verdict, Verdict::Effect, "{}", answer.statement);
    assert_eq!(answer.effects[0].kind, "curve_resistance");
    let [TrueEffect::CurveResistance { k_n_per_kn_m: truth }] = simulated.effects[..] else {
        panic!("the simulator was asked for a curve resistance");
    };
    let ParameterValue::Number(found) = answer.effects[0].parameters["k_n_per_kn_m"] else {
        panic!("k is a number");
    };
    assert!((found - truth).abs() < 0.1 * (truth - 600.0), "{found} against {truth}");
    assert!(answer.rmse_after.unwrap() < 0.7 * answer.rmse_before.unwrap());

    let grown = write_updated(folder.path(), explanation, folder.path()).unwrap();
    assert_eq!(grown.not_expressed, [] as [String; 0]);
    let again = dataset::load(folder.path()).expect("the grown files are read");
    assert!((again.train.curve_constant_n_per_kn_m - found).abs() < 1e-9);
    let again = explain(&again, &|_, _| {}).unwrap();
    assert_eq!(again.answer.verdict, Verdict::None, "{}", again.answer.statement);
}

#[test]
fn the_updated_files_of_other_kinds_leave_nothing_either() {
    let kinds = [
        EffectKind::TunnelDrag,
        EffectKind::WheelDiameter,
        EffectKind::ActuatorDelay,
        EffectKind::SpeedDelay,
        EffectKind::BearingTemperature,
        EffectKind::GradientError,
    ];
    for kind in kinds {
        let folder = tempfile::tempdir().unwrap();
        let explanation = &with_kind(kind, folder.path()).explanation;
        assert_eq!(explanation.answer.verdict, Verdict::Effect, "{kind:?}");
        let grown = write_updated(folder.path(), explanation, folder.path()).unwrap();
        assert_eq!(grown.not_expressed, [] as [String; 0], "{kind:?}");
        let again = dataset::load(folder.path()).expect("the grown files are read");
        let again = explain(&again, &|_, _| {}).unwrap();
        assert_eq!(again.answer.verdict, Verdict::None, "{kind:?}: {}", again.answer.statement);
    }
}

#[test]
fn a_dragging_brake_is_found_in_its_runs_from_its_onset() {
    let Explained { simulated, explanation } = explained_once(EffectKind::DraggingBrake);
    let effect = &explanation.answer.effects[0];
    assert_eq!(effect.kind, "dragging_brake", "{}", explanation.answer.statement);
    let [TrueEffect::DraggingBrake { ref windows, .. }] = simulated.effects[..] else {
        panic!("the simulator was asked for a dragging brake");
    };
    let found = effect.place.windows.as_ref().expect("windows");
    for window in windows.iter().filter(|window| !simulated.runs[window.run].plan.is_holdout) {
        let file = simulated.runs[window.run].plan.file();
        let own = found.iter().find(|found| found.run == file).expect("its run");
        assert!((own.t_start_s - window.start_s).abs() < 60.0, "{own:?} against {window:?}");
    }
}

#[test]
fn the_intervals_of_the_ends_of_places_hold_the_true_ends() {
    let (mut ends, mut held) = (0, 0);
    for seed in SEED..SEED + 6 {
        let kinds = EffectRequest::Kinds(vec![EffectKind::LocalResistance]);
        let simulated = simulate(&SimulatorSettings::new(seed, kinds));
        let TrueEffect::LocalResistance { intervals_m: truth, .. } = &simulated.effects[0] else {
            panic!("the simulator was asked for a local resistance");
        };
        let folder = tempfile::tempdir().unwrap();
        let answer = match seed {
            SEED => explained_once(EffectKind::LocalResistance).explanation.answer.clone(),
            _ => explained(&simulated, folder.path()).answer,
        };
        let Some(effect) = answer.effects.first() else { continue };
        assert_eq!(effect.kind, "local_resistance", "seed {seed}");
        let known = effect.place.uncertainty_95.as_ref().and_then(|it| it.intervals_m.as_ref());
        let known = known.expect("the ends were estimated");
        let found = effect.place.intervals_m.as_ref().expect("a local resistance has a place");
        assert_eq!((known.len(), found.len()), (truth.len(), truth.len()), "seed {seed}");
        for ((of_ends, found_m), &(from_m, to_m)) in known.iter().zip(found).zip(truth) {
            for ([low_m, high_m], (at_m, true_m)) in
                of_ends.iter().zip(found_m.iter().zip([from_m, to_m]))
            {
                assert!(low_m <= at_m && at_m <= high_m, "seed {seed}: {at_m} not within its own");
                assert!(high_m - low_m < 400.0, "seed {seed}: {low_m} to {high_m} says little");
                ends += 1;
                held += usize::from((*low_m..=*high_m).contains(&true_m));
            }
        }
    }
    assert!(ends >= 10 && 10 * held >= 8 * ends, "{held} of {ends}");
}

#[test]
fn an_effect_outside_the_library_is_called_unknown_and_placed() {
    let Explained { simulated, explanation } = explained_once(EffectKind::Unknown);
    let answer = &explanation.answer;
    assert_eq!(answer.verdict, Verdict::Unknown, "{}", answer.statement);
    let [TrueEffect::Unlisted(Unlisted { law: Law::Band { centre_mps, .. }, .. })] =
        simulated.effects[..]
    else {
        panic!("the simulator was asked for something unknown");
    };
    let unknown = answer.effects.iter().find(|effect| effect.kind == "unknown").unwrap();
    let [low, high] = unknown.place.speed_range_mps.expect("a range of speeds");
    assert!(low < centre_mps && centre_mps < high, "{low} to {high} against {centre_mps}");
}

#[test]
fn a_slow_trains_force_is_unknown_and_swallowed_by_no_impossible_resistance() {
    let folder = tempfile::tempdir().unwrap();
    let law = Law::Slow { below_mps: 15.0, least_mps: 3.0 };
    let slow = TrueEffect::Unlisted(Unlisted { law, n_per_kn: 1.0 });
    let simulated = simulate(&SimulatorSettings::new(SEED, EffectRequest::Exactly(vec![slow])));
    let answer = explained(&simulated, folder.path()).answer;
    assert_eq!(answer.verdict, Verdict::Unknown, "{}", answer.statement);
    let declared = simulated.declared_train().resistance;
    // A quarter of its tolerance below none is an error of estimation.
    assert!(answer.base.b >= -0.2 * declared.b, "b = {}", answer.base.b);
    assert!(answer.base.a <= 1.8 * declared.a, "a = {}, {}", answer.base.a, declared.a);
}

#[test]
fn a_force_outside_the_library_gets_its_form_and_goes_into_the_updated_model() {
    let folder = tempfile::tempdir().unwrap();
    let law = Law::Slow { below_mps: 15.0, least_mps: 3.0 };
    let slow = TrueEffect::Unlisted(Unlisted { law, n_per_kn: 1.2 });
    let settings = SimulatorSettings {
        train_type: Some(TrainType::Regional),
        ..SimulatorSettings::new(SEED, EffectRequest::Exactly(vec![slow]))
    };
    let simulated = simulate(&settings);
    let explanation = explained(&simulated, folder.path());
    let answer = &explanation.answer;
    assert_eq!(answer.verdict, Verdict::Unknown, "{}", answer.statement);
    let [effect] = &answer.effects[..] else { panic!("{}", answer.statement) };
    let number =
        |values: &std::collections::BTreeMap<String, ParameterValue>, name: &str| match values
            .get(name)
        {
            Some(ParameterValue::Number(value)) => *value,
            other => panic!("{name} is {other:?}"),
        };
    for (name, truth) in [("extra_n_per_kn", 1.2), ("below", 15.0), ("least", 3.0)] {
        let (value, deviation) = (number(&effect.parameters, name), number(&effect.std, name));
        assert!((value - truth).abs() < 3.0 * deviation, "{name} = {value} ± {deviation}");
        assert!(deviation < 0.2 * truth, "{name} = {value} ± {deviation}");
    }
    assert!(!effect.runners_up.is_empty(), "other forms were tried");
    let oracle_mps = score(&simulated).full_run.true_mps;
    let after_mps = answer.rmse_after.expect("runs are held out");
    assert!(after_mps < 1.2 * oracle_mps, "{after_mps} m/s of {oracle_mps}");
    let grown = tempfile::tempdir().unwrap();
    let written = write_updated(folder.path(), &explanation, grown.path()).unwrap();
    assert_eq!(written.not_expressed, Vec::<String>::new());
    let text = std::fs::read_to_string(grown.path().join("train.toml")).unwrap();
    let train = parse_train("train.toml", &text).unwrap();
    assert_eq!(train.extra.len(), 1, "{text}");
    assert_eq!(train.extra[0].n_per_kn, number(&effect.parameters, "extra_n_per_kn"));
}

#[test]
fn nothing_at_a_bound_of_what_is_looked_for_is_found() {
    let folder = tempfile::tempdir().unwrap();
    // No train has such a factor: a residual that demands it has another cause.
    let beyond = TrueEffect::RotatingMass { rotating_mass_factor: 0.6 };
    let settings = SimulatorSettings {
        runs: 4,
        holdout_runs: 1,
        train_type: Some(TrainType::Regional),
        ..SimulatorSettings::new(SEED, EffectRequest::Exactly(vec![beyond]))
    };
    let explanation = explained(&simulate(&settings), folder.path());
    let answer = &explanation.answer;
    for (index, effect) in explanation.outcome.fit.model.effects.iter().enumerate() {
        let parameters = explanation.outcome.fit.effect_parameters(index);
        assert_eq!(effect.at_bound(parameters), None, "{}", answer.statement);
    }
    let is_found = answer.effects.iter().any(|effect| effect.kind == "rotating_mass");
    assert!(!is_found, "{}: {:?}", answer.statement, answer.considered);
}

#[test]
fn a_tunnel_that_the_map_lacks_is_named_alone_or_next_to_a_resistance_there() {
    let folder = tempfile::tempdir().unwrap();
    let kinds = EffectRequest::Kinds(vec![EffectKind::TunnelDrag]);
    let ordinary = SimulatorSettings::new(SEED, kinds);
    let answer =
        explained(&simulate(&SimulatorSettings { maps_tunnels: false, ..ordinary }), folder.path())
            .answer;
    let mut named = answer.ambiguous_with.clone();
    named.extend(answer.effects.iter().map(|effect| effect.kind));
    assert!(named.contains(&"tunnel_drag"), "{}", answer.statement);
}

#[test]
fn a_place_in_one_run_is_found_with_its_time_and_may_be_a_brake() {
    let folder = tempfile::tempdir().unwrap();
    let two_runs = |effects: Vec<TrueEffect>| SimulatorSettings {
        runs: 2,
        holdout_runs: 1,
        train_type: Some(TrainType::Freight),
        ..SimulatorSettings::ideal(SEED, EffectRequest::Exactly(effects))
    };
    let declared = simulate(&two_runs(Vec::new()));
    let fitted = declared.runs.iter().find(|run| !run.plan.is_holdout).expect("a run to fit");
    let middle_m = fitted.states[fitted.states.len() / 2].position_m.round();
    let place = TrueEffect::LocalResistance {
        extra_n_per_kn: 3.0,
        intervals_m: vec![(middle_m - 1000.0, middle_m + 1000.0)],
        runs: Vec::new(),
    };
    let answer = explained(&simulate(&two_runs(vec![place])), folder.path()).answer;
    assert_eq!(answer.verdict, Verdict::Ambiguous, "{}: {:?}", answer.statement, answer.considered);
    assert_eq!(answer.effects[0].kind, "local_resistance");
    assert!(answer.ambiguous_with.contains(&"dragging_brake"), "{}", answer.statement);
    assert_eq!(answer.effects[0].place.windows.as_ref().map(Vec::len), Some(1));
    assert!(answer.rmse_after.unwrap() < 0.5 * answer.rmse_before.unwrap());
}

#[test]
fn an_effect_that_predicts_the_runs_held_out_worse_is_reported_as_that() {
    let folder = tempfile::tempdir().unwrap();
    let declared = simulate(&SimulatorSettings::new(SEED, EffectRequest::none()));
    let fitted = declared.runs.iter().filter(|run| !run.plan.is_holdout);
    // A brush that hangs into the line on the days of the fit runs, and on no other.
    let place = TrueEffect::LocalResistance {
        extra_n_per_kn: 2.0,
        intervals_m: vec![(4000.0, 8000.0)],
        runs: fitted.map(|run| run.plan.number).collect(),
    };
    let effects = EffectRequest::Exactly(vec![place]);
    let simulated = simulate(&SimulatorSettings::new(SEED, effects));
    let explanation = explained(&simulated, folder.path());
    let answer = &explanation.answer;
    assert_eq!(answer.effects[0].kind, "local_resistance", "{}", answer.statement);
    assert!(answer.rmse_after > answer.rmse_before, "{}", answer.statement);
    assert!(answer.statement.contains("held out are predicted worse"), "{}", answer.statement);

    // The meaning on the fit runs: 2 N/kN over the distance driven there.
    let (mut work_kj, mut distance_m) = (0.0, 0.0);
    for run in &explanation.problem.runs {
        for pair in run.samples().windows(2) {
            let step_m = pair[1].speed_mps * 1e-9 * (pair[1].time_ns - pair[0].time_ns) as f64;
            let is_inside = pair[1].position_m.is_some_and(|at| (4000.0..8000.0).contains(&at));
            work_kj += if is_inside { 2e-3 * pair[1].weight_kn * step_m } else { 0.0 };
            distance_m += step_m;
        }
    }
    let meaning = &answer.effects[0].meaning;
    let expected_kwh = work_kj / 3600.0 * 1e5 / distance_m;
    assert!((meaning.energy_kwh_per_100_km / expected_kwh - 1.0).abs() < 0.1, "{meaning:?}");
    let [without, with] = meaning.distance_error_60_s_m.expect("runs of more than a minute");
    assert!(with < 0.5 * without, "{meaning:?}");
}

#[test]
fn on_a_level_straight_line_two_kinds_of_mass_cannot_be_distinguished() {
    let folder = tempfile::tempdir().unwrap();
    let effects = EffectRequest::Kinds(vec![EffectKind::RotatingMass]);
    let ordinary = SimulatorSettings::new(SEED, effects);
    let settings = SimulatorSettings { is_level_and_straight: true, ..ordinary };
    let answer = explained(&simulate(&settings), folder.path()).answer;
    assert_eq!(answer.verdict, Verdict::Ambiguous, "{}", answer.statement);
    let mut kinds = answer.ambiguous_with.clone();
    kinds.push(answer.effects[0].kind);
    kinds.sort_unstable();
    assert_eq!(kinds, ["mass_change", "rotating_mass"]);
    let experiment = answer.experiment.expect("what would separate them");
    assert!(experiment.contains("gradient"), "{experiment}");
}

#[test]
fn a_force_that_acts_somewhat_later_than_stamped_bends_no_resistance() {
    let folder = tempfile::tempdir().unwrap();
    // The simulator holds each force for 0.05 s: on average it acts 0.025 s after its stamp.
    let ideal = SimulatorSettings::ideal(SEED, EffectRequest::none());
    let settings = SimulatorSettings {
        train_type: Some(TrainType::Regional),
        runs: 4,
        holdout_runs: 1,
        ..ideal
    };
    let simulated = simulate(&settings);
    let answer = explained(&simulated, folder.path()).answer;
    assert_eq!(answer.verdict, Verdict::None, "{}", answer.statement);
    let truth = simulated.train.resistance.c;
    let error = answer.base.c / truth - 1.0;
    assert!(error.abs() < 0.01, "c is off by {:.1} %", 100.0 * error);
}

#[test]
fn a_scan_predicts_what_a_fit_then_gains() {
    let folder = tempfile::tempdir().unwrap();
    let Explained { explanation, .. } = with_kind(EffectKind::TunnelDrag, folder.path());
    let dataset = dataset::load(folder.path()).unwrap();
    let (problem, base) = (&explanation.problem, &explanation.outcome.base);
    let scan = Scan::new(problem, &explanation.holdout, &dataset.train, None, base).unwrap();
    let tuple = scan.tuple(|run, i| {
        let sample = &run.samples()[i];
        let speed = run.smooth_mps[i];
        let share = sample.tunnel_share.unwrap_or(0.0);
        -scan.per_unit_resistance_mps2(sample) * share * speed * speed
    });
    let (_, expected_by_advice) = scan.gain(&tuple);
    let grown = explanation.outcome.fit.effect_parameters(0)[0];
    // The scan is linear and keeps the noise of the smaller model.
    assert!(
        (expected_by_advice - grown).abs() < 0.25 * grown,
        "{expected_by_advice} against {grown}"
    );
}

#[test]
fn every_kind_is_in_the_library_once() {
    for &kind in EffectKind::ALL.iter().filter(|kind| **kind != EffectKind::None) {
        assert_eq!(LIBRARY.iter().filter(|effect| effect.kind == kind).count(), 1, "{kind:?}");
    }
}
