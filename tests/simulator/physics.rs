//! The simulator obeys physics, its drivers obey the line, and its sensors have the stated errors.

use std::sync::LazyLock;

use dynocar_shared::SampleField;
use dynocar_tests::simulator::true_run::{TRUE_STEP_S, TrueState};
use dynocar_tests::simulator::{
    EffectRequest, SimulatedDataset, SimulatorSettings, TrainType, TrueDeviations, oracle, simulate,
};

/// One dataset per type of train with ideal sensors.
static IDEAL: LazyLock<Vec<SimulatedDataset>> = LazyLock::new(|| one_per_type(true));
/// One dataset per type of train with ordinary sensors.
static ORDINARY: LazyLock<Vec<SimulatedDataset>> = LazyLock::new(|| one_per_type(false));

fn one_per_type(is_ideal: bool) -> Vec<SimulatedDataset> {
    let make = if is_ideal { SimulatorSettings::ideal } else { SimulatorSettings::new };
    TrainType::ALL
        .into_iter()
        .zip(40..)
        .map(|(train_type, seed)| {
            let settings = make(seed, EffectRequest::none());
            simulate(&SimulatorSettings { train_type: Some(train_type), ..settings })
        })
        .collect()
}

fn name(dataset: &SimulatedDataset) -> String {
    format!("{} train, seed {}", dataset.train.train_type.name(), dataset.settings.seed)
}

#[test]
fn kinetic_energy_changes_by_the_work_of_all_forces() {
    for dataset in ORDINARY.iter() {
        for run in &dataset.runs {
            let (mut work_j, mut turnover_j) = (0.0, 0.0);
            let mut kinetic_j: f64 = 0.0;
            for pair in run.states.windows(2) {
                let (here, next) = (&pair[0], &pair[1]);
                // Forces of the actuators hold over a step, resistance changes along it.
                let resisted_n = 0.5 * (here.resistance.total_n() + next.resistance.total_n());
                let acting_n = here.acting.traction_force_n - here.acting.brake_force_n;
                let travelled_m = next.distance_m - here.distance_m;
                work_j += (acting_n - resisted_n) * travelled_m;
                turnover_j += (acting_n - resisted_n).abs() * travelled_m;
                kinetic_j = 0.5 * next.inertial_mass_kg * next.speed_mps.powi(2);
            }
            let missing_j = (kinetic_j - work_j).abs();
            assert!(missing_j < 1e-3 * turnover_j, "{}: {missing_j} J", name(dataset));
        }
    }
}

#[test]
fn trains_never_roll_back_and_stand_still_while_they_stand() {
    for dataset in ORDINARY.iter() {
        for run in &dataset.runs {
            for pair in run.states.windows(2) {
                let moved_m = pair[1].distance_m - pair[0].distance_m;
                assert!(pair[0].speed_mps >= 0.0 && moved_m >= 0.0, "{}", name(dataset));
                if pair[0].speed_mps == 0.0 && pair[1].speed_mps == 0.0 {
                    assert!(moved_m < 1e-3, "{}: {moved_m} m at rest", name(dataset));
                }
            }
        }
    }
}

/// Places in m where a run came to rest.
fn rests_m(states: &[TrueState]) -> Vec<f64> {
    let comes_to_rest = |pair: &&[TrueState]| pair[0].speed_mps > 0.0 && pair[1].speed_mps == 0.0;
    states.windows(2).filter(comes_to_rest).map(|pair| pair[1].position_m).collect()
}

#[test]
fn trains_stop_where_they_should_and_nowhere_else() {
    for dataset in ORDINARY.iter() {
        for run in &dataset.runs {
            let rests_m = rests_m(&run.states);
            assert_eq!(rests_m.len(), run.plan.stops_m.len(), "{}", name(dataset));
            for (rest_m, stop_m) in rests_m.iter().zip(&run.plan.stops_m) {
                assert!((rest_m - stop_m).abs() < 8.0, "{}: {rest_m} m, {stop_m} m", name(dataset));
            }
            if dataset.train.train_type != TrainType::Freight {
                let is_station = |stop_m: &f64| dataset.line.stations_m.contains(stop_m);
                assert!(run.plan.stops_m.iter().all(is_station), "{}", name(dataset));
            }
            let end = run.states[run.states.len() - 1];
            assert!(end.time_s < 2.0 * dataset.settings.duration_s, "{}", name(dataset));
        }
    }
}

#[test]
fn drivers_keep_to_the_limits_and_use_traction_brakes_and_coasting() {
    for dataset in ORDINARY.iter() {
        let length_m = dataset.train.declared.length_m;
        let states = || dataset.runs.iter().flat_map(|run| &run.states);
        for state in states() {
            let limit_mps = dataset.line.limit_under_mps(state.position_m, length_m);
            assert!(state.speed_mps < 1.03 * limit_mps + 0.5, "{}: {state:?}", name(dataset));
        }
        let moving = states().filter(|state| state.speed_mps > 0.5).count() as f64;
        let share = |wanted: fn(&TrueState) -> bool| {
            let count = states().filter(|state| state.speed_mps > 0.5 && wanted(state)).count();
            count as f64 / moving
        };
        let pulling = share(|state| state.acting.traction_force_n > 0.0);
        let braking = share(|state| state.acting.brake_force_n > 0.0);
        let coasting = share(|state| {
            state.acting.traction_force_n == 0.0 && state.acting.brake_force_n == 0.0
        });
        assert!(pulling > 0.2 && braking > 0.05 && coasting > 0.08, "{}", name(dataset));
    }
}

#[test]
fn commands_are_limited_in_jerk() {
    for dataset in IDEAL.iter() {
        for run in &dataset.runs {
            for pair in run.states.windows(2) {
                let forces = [
                    (pair[0].reported.traction_force_n, pair[1].reported.traction_force_n),
                    (pair[0].reported.brake_force_n, pair[1].reported.brake_force_n),
                ];
                let step_n = dataset.train.handling.jerk_mps3 * pair[0].mass_kg * TRUE_STEP_S;
                let effort_n = 0.01 * dataset.train.traction_max_n(0.0);
                for (before_n, after_n) in forces {
                    // Traction also follows the effort curve down; small forces end at once.
                    let limit_n = 1.1 * step_n + effort_n;
                    assert!((after_n - before_n).abs() < limit_n, "{}", name(dataset));
                }
            }
        }
    }
}

#[test]
fn cars_feel_the_line_one_after_the_other() {
    for dataset in IDEAL.iter() {
        let run = &dataset.runs[0];
        let physics = dynocar_tests::simulator::dynamics::TruePhysics {
            train: &dataset.train,
            line: &dataset.line,
            plan: &run.plan,
            disturbances: &run.disturbances,
        };
        let shares: f64 = dataset.train.cars.iter().map(|car| car.mass_share).sum();
        assert!((shares - 1.0).abs() < 1e-12);
        let length_m = dataset.train.declared.length_m;
        let mut differs = false;
        for k in 0..200 {
            let centre_m = dataset.line.length_m * (0.05 + 0.0045 * f64::from(k));
            let by_car = run.plan.direction * physics.line_under(centre_m).gradient_permille;
            let averaged = dataset.track().gradient_permille(centre_m, length_m).unwrap();
            // The masses of cars differ by some percent, so the two agree closely, not exactly.
            assert!((by_car - averaged).abs() < 2.5, "{}: {by_car} {averaged}", name(dataset));
            differs |= by_car != averaged;
        }
        assert!(differs, "{}: unequal cars", name(dataset));
    }
}

#[test]
fn couplings_move_the_leading_car_and_not_the_train() {
    for (rigid, train_type) in IDEAL.iter().zip(TrainType::ALL) {
        let deviations = TrueDeviations { has_couplings: true, ..rigid.settings.deviations };
        let coupled = SimulatorSettings { deviations, ..rigid.settings.clone() };
        let coupled = simulate(&coupled);
        for (one, other) in rigid.runs.iter().zip(&coupled.runs) {
            let moved = |(one, other): (&TrueState, &TrueState)| {
                assert_eq!((one.position_m, one.speed_mps), (other.position_m, other.speed_mps));
                other.wheel_speed_mps - one.wheel_speed_mps
            };
            let away_mps: Vec<f64> = one.states.iter().zip(&other.states).map(moved).collect();
            let most_mps = away_mps.iter().fold(0.0_f64, |most, away| most.max(away.abs()));
            let travelled_m = away_mps.iter().sum::<f64>() * TRUE_STEP_S;
            assert!((1e-3..1.0).contains(&most_mps), "{train_type:?}: {most_mps} m/s");
            assert!(
                travelled_m.abs() < 2.0,
                "{train_type:?}: the leading car is {travelled_m} m ahead"
            );
        }
    }
}

#[test]
fn the_declared_model_predicts_an_ideal_null_recording() {
    for dataset in IDEAL.iter() {
        let score = oracle::score(dataset);
        // The remaining difference: commands that change between samples, and unequal cars.
        assert!(score.full_run.declared_mps < 0.03, "{}: {score:?}", name(dataset));
        assert!(score.window60.declared_mps < 0.03, "{}: {score:?}", name(dataset));
        assert_eq!(score.full_run.declared_mps, score.full_run.true_mps, "{}", name(dataset));
    }
}

#[test]
fn ordinary_sensors_err_by_their_noise_and_the_odometer_stays_near_the_truth() {
    for dataset in ORDINARY.iter() {
        let mut squares = (0.0, 0);
        for run in &dataset.runs {
            for sample in &run.samples {
                let state = &run.states[(sample.time_ns / 50_000_000) as usize];
                assert!((state.time_s - sample.time_ns as f64 * 1e-9).abs() < 1e-9);
                let off_m = sample.get(SampleField::Position).unwrap() - state.position_m;
                assert!(off_m.abs() < 25.0, "{}: {off_m} m", name(dataset));
                if state.speed_mps > 1.0 && state.wheel_speed_mps == state.speed_mps {
                    squares.0 += (sample.speed_mps - state.speed_mps).powi(2);
                    squares.1 += 1;
                }
                if state.reported.traction_force_n == 0.0 {
                    assert_eq!(sample.traction_force_n, 0.0, "{}", name(dataset));
                }
            }
        }
        let sensor = dataset.sensors.speed;
        let expected_mps = (sensor.noise.powi(2) + sensor.quantum.powi(2) / 12.0).sqrt();
        let measured_mps = (squares.0 / f64::from(squares.1)).sqrt();
        // Standard error below 1 % with more than 20,000 samples; 4 % is beyond four of them.
        assert!((measured_mps / expected_mps - 1.0).abs() < 0.04, "{}", name(dataset));
    }
}

#[test]
fn a_holding_brake_is_reported_and_shows_in_the_cylinders() {
    for dataset in IDEAL.iter() {
        for run in &dataset.runs {
            let first = &run.samples[0];
            assert_eq!((first.speed_mps, first.traction_force_n), (0.0, 0.0));
            let holding_n = dataset.train.handling.holding_share * dataset.train.brake_max_n(0.0);
            assert!((first.brake_force_n - holding_n).abs() < 1.0, "{}", name(dataset));
            assert!(first.brake_cylinder_pressure_pa > 80e3, "{}", name(dataset));
        }
    }
}
