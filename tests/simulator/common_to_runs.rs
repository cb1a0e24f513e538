//! Findings in more runs than eight: errors that all runs share, and runs that see only a part of a place.

use dynocar_analysis::explain::answer::ExplainAnswer;
use dynocar_analysis::explain::explain;
use dynocar_model::track::LinearProfile;
use dynocar_shared::HALF_95;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::dataset_writer::{dataset_files, read_files};
use dynocar_tests::simulator::effects::TrueMassSection;
use dynocar_tests::simulator::{
    EffectRequest, SimulatorSettings, TrainType, TrueDeviations, TrueEffect, simulate,
};

/// Returns the answer to a dataset of a number of runs, a quarter of them held out.
fn explained_of(runs: usize, settings: SimulatorSettings) -> ExplainAnswer {
    let simulated = simulate(&SimulatorSettings { runs, holdout_runs: runs / 4, ..settings });
    let dataset = read_files(&dataset_files(&simulated));
    explain(&dataset, &|_, _| ()).unwrap().answer
}

/// Returns the answer to a dataset of 16 runs, all of which are searched.
fn explained(settings: SimulatorSettings) -> ExplainAnswer {
    explained_of(16, settings)
}

/// Returns a parameter of an effect of an answer.
fn parameter(answer: &ExplainAnswer, kind: EffectKind, name: &str) -> f64 {
    let effect = answer.effects.iter().position(|effect| effect.kind == kind.name());
    let written = serde_json::to_value(answer).unwrap();
    let value = effect.and_then(|at| written["effects"][at]["parameters"][name].as_f64());
    value.unwrap_or_else(|| panic!("no {} in: {}", kind.name(), answer.statement))
}

#[test]
fn a_rotating_mass_stays_right_where_the_line_rounds_its_steps_over_an_unusual_length() {
    let deviations = TrueDeviations { vertical_curve_m: 120.0, ..TrueDeviations::PLAIN };
    let truth = 0.12;
    for seed in [9_820_001, 9_820_007] {
        let effect = TrueEffect::RotatingMass { rotating_mass_factor: truth };
        let settings = SimulatorSettings::new(seed, EffectRequest::Exactly(vec![effect]));
        let answer = explained(SimulatorSettings { deviations, ..settings });
        let found = parameter(&answer, EffectKind::RotatingMass, "rotating_mass_factor");
        // A length that is always the same leaves 0.011 and 0.005.
        assert!((found - truth).abs() < 0.003, "seed {seed}: {found} for {truth}");
    }
}

#[test]
fn a_resistance_at_two_places_is_found_in_runs_that_reach_only_the_second() {
    let settings = SimulatorSettings::new(9_700_001, EffectRequest::none());
    let settings = SimulatorSettings { train_type: Some(TrainType::Freight), ..settings };
    let places = [(13_720.0, 15_598.0), (18_300.0, 20_178.0)];
    let place = TrueEffect::LocalResistance {
        extra_n_per_kn: 1.8,
        intervals_m: places.to_vec(),
        runs: (1..=16).filter(|number| number % 4 < 2).collect(),
    };
    let effects = EffectRequest::Exactly(vec![place]);
    let answer = explained(SimulatorSettings { effects, ..settings });
    let kinds: Vec<&str> = answer.effects.iter().map(|effect| effect.kind).collect();
    assert_eq!(kinds, [EffectKind::LocalResistance.name()], "{}", answer.statement);
    let found = answer.effects[0].place.intervals_m.as_deref().unwrap_or_default();
    assert_eq!(found.len(), places.len(), "{}", answer.statement);
    for (found, (from_m, to_m)) in found.iter().zip(places) {
        let away_m = [found[0] - from_m, found[1] - to_m];
        assert!(away_m.iter().all(|it| it.abs() < 30.0), "{}", answer.statement);
    }
}

#[test]
fn the_drag_of_mapped_tunnels_is_found_in_them_whatever_else_the_map_lacks() {
    let tunnels = EffectRequest::Kinds(vec![EffectKind::TunnelDrag]);
    let settings = SimulatorSettings::new(9_900_001, tunnels);
    let settings = SimulatorSettings { deviations: TrueDeviations::ROUGHER, ..settings };
    let simulated = simulate(&SimulatorSettings { runs: 24, holdout_runs: 6, ..settings.clone() });
    let truth = simulated.effects[0].parameters(0.0)["c_factor"].as_f64().unwrap();
    let answer = explained_of(24, settings);
    let found = parameter(&answer, EffectKind::TunnelDrag, "c_factor");
    // At five places of its own, which errors of the map make, it was half of the truth.
    assert!((found - truth).abs() < 0.2 * (truth - 1.0), "{found} for {truth}");
    let effect = answer.effects.iter().find(|it| it.kind == EffectKind::TunnelDrag.name());
    let mapped = simulated.track().tunnels().len();
    assert_eq!(effect.unwrap().place.intervals_m.as_ref().unwrap().len(), mapped);
}

#[test]
fn an_error_of_the_map_stays_right_where_the_line_rounds_its_steps() {
    let effect = EffectKind::GradientError;
    let settings = SimulatorSettings::new(9_900_002, EffectRequest::Kinds(vec![effect]));
    let settings = SimulatorSettings { deviations: TrueDeviations::ROUGHER, ..settings };
    let simulated = simulate(&SimulatorSettings { runs: 24, holdout_runs: 6, ..settings.clone() });
    let truth = simulated.effects[0].parameters(0.0)["profile"].clone();
    let rows = |profile: &serde_json::Value| -> Vec<(f64, f64)> {
        serde_json::from_value(profile.clone()).unwrap()
    };
    let truth = LinearProfile::new(rows(&truth)).unwrap();
    let written = serde_json::to_value(explained_of(24, settings)).unwrap();
    let effects = written["effects"].as_array().unwrap();
    let found = effects.iter().find(|it| it["kind"] == effect.name()).expect("it is found");
    let [found, std] = ["parameters", "std"].map(|list| rows(&found[list]["profile"]));
    let held = found
        .iter()
        .zip(&std)
        .filter(|((at_m, permille), (_, std))| (permille - truth.at(*at_m)).abs() < HALF_95 * std);
    // Without the rounding in the same fit, half of the values hold.
    assert!(held.count() * 10 >= 9 * found.len(), "{found:?} ± {std:?}");
}

#[test]
fn runs_that_are_not_searched_have_winds_of_their_own() {
    let truth_mps = -7.5;
    let effect = TrueEffect::Wind { wind_plus_mps: truth_mps, run_sd_mps: 1.3, gust_sd_mps: 0.7 };
    let settings = SimulatorSettings::new(9_600_002, EffectRequest::Exactly(vec![effect]));
    let settings = SimulatorSettings { train_type: Some(TrainType::HighSpeed), ..settings };
    let answer =
        explained_of(64, SimulatorSettings { deviations: TrueDeviations::ROUGH, ..settings });
    let found_mps = parameter(&answer, EffectKind::Wind, "wind_plus_mps");
    // The days' winds scatter by 1.3 m/s; with one wind in all the others half of it is taken for the map's error.
    assert!((found_mps - truth_mps).abs() < 1.5, "{found_mps}: {}", answer.statement);
}

#[test]
fn a_gain_stays_right_where_a_run_that_is_not_searched_goes_further_than_the_others() {
    let truth = 1.045;
    let effect = TrueEffect::TractionGain { gain: truth };
    let settings = SimulatorSettings::new(9_820_006, EffectRequest::Exactly(vec![effect]));
    let answer =
        explained_of(128, SimulatorSettings { deviations: TrueDeviations::ROUGHER, ..settings });
    let found = parameter(&answer, EffectKind::TractionGain, "gain");
    // There the map's error is not known: counted, one run of 96 moves the gain by 0.013.
    assert!((found - truth).abs() < 0.008, "{found}: {}", answer.statement);
}

#[test]
fn a_wheel_is_found_beside_four_small_errors_that_many_runs_make_certain() {
    let wheel = vec![EffectKind::WheelDiameter];
    let settings = SimulatorSettings::new(9_900_006, EffectRequest::Kinds(wheel));
    let deviations = TrueDeviations::ROUGHER;
    let settings = SimulatorSettings { runs: 32, holdout_runs: 8, deviations, ..settings };
    let truth = simulate(&settings).effects[0].parameters(0.0)["speed_scale"].as_f64().unwrap();
    let found = parameter(&explained_of(32, settings), EffectKind::WheelDiameter, "speed_scale");
    assert!((found - truth).abs() < 0.003, "{found} for {truth}");
}

#[test]
fn a_wind_beside_the_usual_errors_of_the_map_is_no_error_of_the_map() {
    let settings = SimulatorSettings::new(9_600_003, EffectRequest::Kinds(vec![EffectKind::Wind]));
    let answer =
        explained_of(32, SimulatorSettings { deviations: TrueDeviations::ROUGHER, ..settings });
    let kinds: Vec<&str> = answer.effects.iter().map(|effect| effect.kind).collect();
    assert!(kinds.contains(&EffectKind::Wind.name()), "{}", answer.statement);
    assert!(!kinds.contains(&EffectKind::GradientError.name()), "{}", answer.statement);
}

#[test]
fn loads_by_stop_stay_right_where_runs_that_are_not_searched_go_on_to_further_stops() {
    let settings = SimulatorSettings {
        runs: 128,
        holdout_runs: 32,
        deviations: TrueDeviations::ROUGHER,
        ..SimulatorSettings::new(9_830_003, EffectRequest::LoadsByStop)
    };
    let simulated = simulate(&settings);
    let [TrueEffect::MassChangeSections(truth)] = &simulated.effects[..] else {
        panic!("no loads")
    };
    let answer = explain(&read_files(&dataset_files(&simulated)), &|_, _| ()).unwrap().answer;
    let at = answer.effects.iter().position(|it| it.kind == EffectKind::MassChange.name());
    let written = serde_json::to_value(&answer).unwrap();
    let found = &written["effects"][at.expect("loads")]["parameters"]["sections"];
    let error = |found: &serde_json::Value| {
        let of = |key: &str| found[key].as_f64().unwrap();
        let middle_m = 0.5 * (of("from_m") + of("to_m"));
        let is_at = |it: &&TrueMassSection| {
            it.direction == of("direction") && it.from_m < middle_m && middle_m < it.to_m
        };
        Some(of("mass_factor") - truth.iter().find(is_at)?.mass_factor)
    };
    let errors: Vec<f64> = found.as_array().unwrap().iter().filter_map(error).collect();
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    // Six runs go one stop further, to another load; taken for the declaration, it raises all by 0.04.
    assert!(errors.len() > 8 && mean.abs() < 0.015, "{mean}: {errors:?}");
}
