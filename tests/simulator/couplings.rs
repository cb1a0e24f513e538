//! Cars on couplings, with slack in a freight train, and with the tacho on the first car.

use dynocar_analysis::explain::explain;
use dynocar_model::track::StepProfile;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::couplings::move_leading_car;
use dynocar_tests::simulator::dataset_writer::{dataset_files, read_files};
use dynocar_tests::simulator::driving::Controls;
use dynocar_tests::simulator::dynamics::TruePhysics;
use dynocar_tests::simulator::train_maker::Car;
use dynocar_tests::simulator::true_run::{TRUE_STEP_S, TrueState};
use dynocar_tests::simulator::{
    EffectRequest, SimulatedDataset, SimulatorSettings, TrainType, TrueDeviations, TrueEffect,
    simulate,
};

/// Largest error of a gain as share of the force, as a root mean square. The brake, itself some per cent off, hardly helps.
const ERROR_MAX: f64 = 0.007;

#[test]
fn a_locomotive_that_leaps_ahead_of_its_wagons_does_not_pull_harder() {
    let seeds = 99_001..99_005;
    let count = seeds.clone().count() as f64;
    let squares: f64 = seeds
        .map(|seed| {
            let simulated = simulate(&SimulatorSettings {
                train_type: Some(TrainType::Freight),
                deviations: TrueDeviations { has_couplings: true, ..TrueDeviations::PLAIN },
                ..SimulatorSettings::new(seed, EffectRequest::Kinds(vec![EffectKind::TractionGain]))
            });
            let [TrueEffect::TractionGain { gain: truth }] = simulated.effects[..] else {
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

/// Two equal cars on a level line, of which the first pulls: so heavy that they swing slowly compared with a true step.
#[test]
fn a_pulled_pair_settles_where_the_coupling_carries_the_wagon() {
    const MASS_KG: f64 = 10e6;
    const PULL_N: f64 = 50e3;
    /// Stiffness in N/m of a multiple unit's coupling.
    const STIFFNESS_N_PER_M: f64 = 1e7;
    const SPEED_MPS: f64 = 10.0;
    let settings = SimulatorSettings {
        train_type: Some(TrainType::Regional),
        ..SimulatorSettings::new(1, EffectRequest::none())
    };
    let SimulatedDataset { mut train, line, mut runs, .. } = simulate(&settings);
    let car = |ahead_m| Car { mass_share: 0.5, length_share: 0.5, length_m: 20.0, ahead_m };
    train.cars = vec![car(10.0), car(-10.0)];
    let mut run = runs.swap_remove(0);
    run.plan.mass_kg = MASS_KG;
    run.disturbances.gradient = StepProfile::new(&[(0.0, 0.0)]).unwrap();
    let pulled = TrueState {
        speed_mps: SPEED_MPS,
        wheel_speed_mps: SPEED_MPS,
        acting: Controls { traction_force_n: PULL_N, brake_force_n: 0.0 },
        ..run.states[0]
    };
    let mut states = vec![pulled; 800];
    let (plan, disturbances) = (&run.plan, &run.disturbances);
    move_leading_car(&TruePhysics { train: &train, line: &line, plan, disturbances }, &mut states);
    let slip_mps = |state: &TrueState| state.wheel_speed_mps - SPEED_MPS;
    let ahead_m = states.iter().map(slip_mps).sum::<f64>() * TRUE_STEP_S;
    // Half of the coupling's extension, since the centre of mass has not moved.
    let expected_m = 0.25 * PULL_N / STIFFNESS_N_PER_M;
    assert!((ahead_m - expected_m).abs() < 2e-3 * expected_m, "{ahead_m} m");
    assert!(states.last().is_some_and(|state| slip_mps(state).abs() < 1e-6));
}
