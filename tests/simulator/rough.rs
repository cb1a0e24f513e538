//! Findings where everything declared is a little off: weights, map, winds, forces, wheels, curve constant.

use dynocar_analysis::explain::answer::{ExplainAnswer, Verdict};
use dynocar_analysis::explain::explain;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::dataset_writer::{dataset_files, read_files};
use dynocar_tests::simulator::{
    EffectRequest, Law, SimulatedDataset, SimulatorSettings, TrueDeviations, TrueEffect, Unlisted,
    simulate,
};

/// Kinds that do not resemble an ordinary error of a declared figure.
const STRUCTURAL: [EffectKind; 8] = [
    EffectKind::AmbientTemperature,
    EffectKind::TunnelDrag,
    EffectKind::DraggingBrake,
    EffectKind::LocalResistance,
    EffectKind::LowAdhesion,
    EffectKind::RotatingMass,
    EffectKind::BrakeDelay,
    EffectKind::Unknown,
];

fn explained(kind: Option<EffectKind>, seed: u64) -> (SimulatedDataset, ExplainAnswer) {
    explained_with(EffectRequest::Kinds(kind.into_iter().collect()), seed)
}

fn explained_with(effects: EffectRequest, seed: u64) -> (SimulatedDataset, ExplainAnswer) {
    explained_of(&SimulatorSettings::new(seed, effects))
}

fn explained_of(settings: &SimulatorSettings) -> (SimulatedDataset, ExplainAnswer) {
    let simulated =
        simulate(&SimulatorSettings { deviations: TrueDeviations::ROUGH, ..settings.clone() });
    let dataset = read_files(&dataset_files(&simulated));
    let answer = explain(&dataset, &|_, _| ()).unwrap().answer;
    (simulated, answer)
}

/// The kinds that were found.
fn kinds(answer: &ExplainAnswer) -> Vec<&'static str> {
    answer.effects.iter().map(|effect| effect.kind).collect()
}

/// Returns the found value of a kind and its standard deviation.
fn found(answer: &ExplainAnswer, kind: EffectKind, parameter: &str) -> Option<[f64; 2]> {
    let written = serde_json::to_value(answer).unwrap();
    let effects = written["effects"].as_array()?;
    let own = effects.iter().find(|effect| effect["kind"] == kind.name())?;
    Some([own["parameters"][parameter].as_f64()?, own["std"][parameter].as_f64()?])
}

#[test]
fn a_dragging_brake_is_found_although_loads_winds_and_the_map_are_off() {
    for seed in 1_500_002..1_500_004 {
        let (simulated, answer) = explained(Some(EffectKind::DraggingBrake), seed);
        let TrueEffect::DraggingBrake { force_n: truth, .. } = simulated.effects[0] else {
            panic!("another effect")
        };
        let [force_n, std] = found(&answer, EffectKind::DraggingBrake, "force_n")
            .unwrap_or_else(|| panic!("seed {seed}: {}", answer.statement));
        assert!((force_n - truth).abs() < 4.0 * std, "seed {seed}: {force_n} ± {std} for {truth}");
    }
}

#[test]
fn cold_days_are_found_although_each_day_has_its_wind() {
    for seed in [1_500_002, 2_100_003, 4_800_008] {
        let (_, answer) = explained(Some(EffectKind::AmbientTemperature), seed);
        let is_found = kinds(&answer).contains(&EffectKind::AmbientTemperature.name());
        assert!(is_found, "seed {seed}: {}", answer.statement);
    }
}

#[test]
fn a_law_without_a_name_is_found_although_loads_and_winds_make_most_of_the_error() {
    for seed in [2_500_001, 3_600_008] {
        let (_, answer) = explained_with(EffectRequest::AnyLaw, seed);
        let is_found = kinds(&answer).contains(&EffectKind::Unknown.name());
        assert!(is_found, "seed {seed}: {}", answer.statement);
    }
}

#[test]
fn a_law_at_low_speed_stays_found_when_small_errors_leave_it_little_to_take() {
    let law = Law::Slow { below_mps: 15.0, least_mps: 3.0 };
    let slow = TrueEffect::Unlisted(Unlisted { law, n_per_kn: 1.1 });
    let (_, answer) = explained_with(EffectRequest::Exactly(vec![slow]), 5_000_001);
    assert!(kinds(&answer).contains(&EffectKind::Unknown.name()), "{}", answer.statement);
}

#[test]
fn a_wrong_wheel_stays_found_though_late_forces_take_its_place_and_leave() {
    let both = [EffectKind::WheelDiameter, EffectKind::TunnelDrag];
    let (_, answer) = explained_with(EffectRequest::Kinds(both.to_vec()), 4_600_003);
    let are_found = both.iter().all(|kind| kinds(&answer).contains(&kind.name()));
    assert!(are_found, "{}", answer.statement);
}

#[test]
fn an_outside_temperature_falls_beside_the_brake_that_it_stood_for() {
    let (_, answer) = explained(Some(EffectKind::DraggingBrake), 4_600_006);
    let found = kinds(&answer);
    assert!(found.contains(&EffectKind::DraggingBrake.name()), "{}", answer.statement);
    assert!(!found.contains(&EffectKind::AmbientTemperature.name()), "{}", answer.statement);
}

#[test]
fn a_tunnel_that_the_map_lacks_is_named_though_a_form_between_two_places_looks_like_it() {
    let tunnel = EffectRequest::Kinds(vec![EffectKind::TunnelDrag]);
    let settings = SimulatorSettings::new(5_000_008, tunnel);
    let (_, answer) = explained_of(&SimulatorSettings { maps_tunnels: false, ..settings });
    let found = kinds(&answer);
    assert!(found.contains(&EffectKind::TunnelDrag.name()), "{}", answer.statement);
    assert!(!found.contains(&EffectKind::Unknown.name()), "{}", answer.statement);
}

#[test]
fn what_does_not_stand_beside_the_usual_errors_is_not_called_nothing() {
    // A force that grows in the cold, which an outside temperature explains up to the bound of the quantity looked for.
    let (_, answer) = explained_with(EffectRequest::AnyLaw, 2_500_004);
    assert_eq!(answer.verdict, Verdict::Unknown, "{}", answer.statement);
}

#[test]
fn what_is_a_little_off_is_no_structural_effect() {
    // In the last four one run seemed to have a law of its own, tunnels to resist a little more, six runs followed the
    // outside temperature by chance, and the brake alone to be as late as both forces are.
    for seed in [861_011, 861_017, 3_300_017, 4_800_011, 4_800_042, 5_300_007] {
        let (_, answer) = explained(None, seed);
        let structural: Vec<&str> = STRUCTURAL.iter().map(|kind| kind.name()).collect();
        let named = answer.effects.iter().map(|effect| effect.kind);
        let invented: Vec<&str> = named
            .chain(answer.ambiguous_with.iter().copied())
            .filter(|kind| structural.contains(kind))
            .collect();
        assert!(invented.is_empty(), "seed {seed}: {invented:?}: {}", answer.statement);
    }
}
