//! Findings in more runs than eight: errors that all runs share, and runs that see only a part of a place.

use dynocar_analysis::explain::answer::ExplainAnswer;
use dynocar_analysis::explain::explain;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::dataset_writer::{dataset_files, read_files};
use dynocar_tests::simulator::{
    Deviations, Effect, EffectRequest, SimulatorSettings, TrainType, simulate,
};

/// Returns the answer to a dataset of 16 runs, a quarter of them held out.
fn explained(settings: SimulatorSettings) -> ExplainAnswer {
    let simulated = simulate(&SimulatorSettings { runs: 16, holdout_runs: 4, ..settings });
    let dataset = read_files(&dataset_files(&simulated));
    explain(&dataset, &|_, _| ()).unwrap().answer
}

#[test]
fn a_rotating_mass_stays_right_where_the_line_rounds_its_steps_over_an_unusual_length() {
    let deviations = Deviations { vertical_curve_m: 120.0, ..Deviations::PLAIN };
    let truth = 0.12;
    for seed in [9_820_001, 9_820_007] {
        let effect = Effect::RotatingMass { rotating_mass_factor: truth };
        let settings = SimulatorSettings::new(seed, EffectRequest::Exactly(vec![effect]));
        let answer = explained(SimulatorSettings { deviations, ..settings });
        let written = serde_json::to_value(&answer).unwrap();
        let found = written["effects"][0]["parameters"]["rotating_mass_factor"].as_f64();
        let found = found.unwrap_or_else(|| panic!("seed {seed}: {}", answer.statement));
        // A length that is always the same leaves 0.011 and 0.005.
        assert!((found - truth).abs() < 0.003, "seed {seed}: {found} for {truth}");
    }
}

#[test]
fn a_resistance_at_two_places_is_found_in_runs_that_reach_only_the_second() {
    let settings = SimulatorSettings::new(9_700_001, EffectRequest::none());
    let settings = SimulatorSettings { train_type: Some(TrainType::Freight), ..settings };
    let places = [(13_720.0, 15_598.0), (18_300.0, 20_178.0)];
    let place = Effect::LocalResistance {
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
