//! Freight trains on couplings with slack, the tacho on the locomotive.

use dynocar_analysis::explain::explain;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::dataset_writer::{dataset_files, read_files};
use dynocar_tests::simulator::{
    Deviations, Effect, EffectRequest, SimulatorSettings, TrainType, simulate,
};

/// Largest error of a gain as share of the force, as a root mean square.
const ERROR_MAX: f64 = 0.005;

#[test]
fn a_locomotive_that_leaps_ahead_of_its_wagons_does_not_pull_harder() {
    let seeds = 99_001..99_007;
    let count = seeds.clone().count() as f64;
    let squares: f64 = seeds
        .map(|seed| {
            let simulated = simulate(&SimulatorSettings {
                train_type: Some(TrainType::Freight),
                deviations: Deviations { has_couplings: true, ..Deviations::PLAIN },
                ..SimulatorSettings::new(seed, EffectRequest::Kinds(vec![EffectKind::TractionGain]))
            });
            let [Effect::TractionGain { gain: truth }] = simulated.effects[..] else {
                panic!("another effect")
            };
            let dataset = read_files(&dataset_files(&simulated));
            let answer = explain(&dataset, &|_, _| ()).unwrap().answer;
            let written = serde_json::to_value(&answer).unwrap();
            let gain = written["effects"][0]["parameters"]["gain"].as_f64().expect("a gain");
            let std =
                written["effects"][0]["std"]["gain"].as_f64().expect("its standard deviation");
            eprintln!("seed {seed}: {gain:.4} for {truth:.4}, {:+.1} sd", (gain - truth) / std);
            (gain - truth).powi(2)
        })
        .sum();
    let error = (squares / count).sqrt();
    assert!(error < ERROR_MAX, "gains are off by {error:.4}");
}
