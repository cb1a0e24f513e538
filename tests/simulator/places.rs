//! Two places of resistance that follow each other closely, and false places caused by a wrong wheel diameter.

use dynocar_analysis::explain::explain;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::dataset_writer::{dataset_files, read_files};
use dynocar_tests::simulator::{EffectRequest, SimulatorSettings, TrueEffect, simulate};

/// Seed of a fast train on 60 km with two places of 2.7 km, 1.1 km apart, so that the end of one and the start of the
/// other act on the train together.
const SEED: u64 = 97_004;
/// Largest distance in m of an end from the truth; samples are 16 m apart there.
const END_ERROR_MAX_M: f64 = 30.0;

#[test]
fn two_places_felt_together_are_reported_with_their_ends_and_are_no_tunnels() {
    let effects = EffectRequest::Kinds(vec![EffectKind::LocalResistance]);
    let simulated = simulate(&SimulatorSettings::new(SEED, effects));
    let [TrueEffect::LocalResistance { intervals_m: truth, .. }] = &simulated.effects[..] else {
        panic!("another effect")
    };
    assert_eq!(truth.len(), 2);
    assert!(truth[1].0 - truth[0].1 < 1500.0, "{truth:?}");
    let answer = explain(&read_files(&dataset_files(&simulated)), &|_, _| ()).unwrap().answer;
    let written = serde_json::to_value(&answer).unwrap();
    assert_eq!(written["effects"][0]["kind"], "local_resistance", "{}", written["statement"]);
    assert_eq!(written["effects"].as_array().map(Vec::len), Some(1), "{}", written["statement"]);
    for (index, &(from_m, to_m)) in truth.iter().enumerate() {
        for (end, true_m) in [from_m, to_m].into_iter().enumerate() {
            let found_m = &written["effects"][0]["where"]["intervals_m"][index][end];
            let error_m = (found_m.as_f64().expect("an end") - true_m).abs();
            assert!(error_m < END_ERROR_MAX_M, "{found_m} for {true_m} m");
        }
    }
}

#[test]
fn a_wrong_wheel_leaves_no_force_where_gradients_change() {
    // 14 and 22 ‰ at two places; by the wheel, positions there are 9 m off.
    let effects = EffectRequest::Kinds(vec![EffectKind::WheelDiameter]);
    let simulated = simulate(&SimulatorSettings::new(9003, effects));
    let answer = explain(&read_files(&dataset_files(&simulated)), &|_, _| ()).unwrap().answer;
    let kinds: Vec<&str> = answer.effects.iter().map(|effect| effect.kind).collect();
    assert_eq!(kinds, [EffectKind::WheelDiameter.name()], "{}", answer.statement);
}
