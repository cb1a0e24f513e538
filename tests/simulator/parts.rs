//! Tests of single parts of the simulator.

use dynocar_model::simulate::motion::SimulatedMotion;
use dynocar_model::track::{Track, TrackCurve, Tunnel};
use dynocar_model::train::{Davis, TrainModel};
use dynocar_tests::simulator::TrueDeviations;
use dynocar_tests::simulator::actuators::LateForces;
use dynocar_tests::simulator::common_deviations::CommonDeviations;
use dynocar_tests::simulator::driving::{Controls, TrainOnLine, drive};
use dynocar_tests::simulator::random::{SimulatorRandom, Stream};

#[test]
fn late_forces_arrive_after_the_delay_and_approach_by_the_lag() {
    let full = Controls { traction_force_n: 100.0, brake_force_n: 0.0 };
    let mut late = LateForces::new(0.5, 0.4, 0.05, Controls::default());
    let forces: Vec<f64> = (0..40).map(|_| late.advance(full).traction_force_n).collect();
    assert!(forces[..10].iter().all(|&force| force == 0.0));
    // Half a second after the arrival: 1 - exp(-0.5 / 0.4).
    assert!((forces[19] - 100.0 * (1.0 - (-0.5_f64 / 0.4).exp())).abs() < 1e-9);
    let mut prompt = LateForces::new(0.0, 0.0, 0.05, Controls::default());
    assert_eq!(prompt.advance(full), full);
}

#[test]
fn a_map_is_off_by_as_much_as_was_asked() {
    let squares = |seed: u64| {
        let error = CommonDeviations::draw(&TrueDeviations::ROUGH, seed).map_error(30e3);
        error.iter().map(|(_, permille)| permille * permille).sum::<f64>() / error.len() as f64
    };
    let rms = ((0..20).map(squares).sum::<f64>() / 20.0).sqrt();
    assert!((0.11..0.13).contains(&rms), "{rms}");
}

#[test]
fn nothing_is_off_where_nothing_is_asked() {
    let none = CommonDeviations::draw(&TrueDeviations::NONE, 7);
    assert_eq!((none.curve_constant, none.force_gains, none.speed_scale), (1.0, [1.0; 2], 1.0));
    assert_eq!((none.force_late_s, none.warming.0), (0.0, 0.0));
    assert!(none.map_error(20e3).is_empty());
}

fn train() -> TrainModel {
    let resistance = Davis { a: 1.6, b: 0.02, c: 0.003 };
    TrainModel {
        length_m: 150.0,
        rotating_mass_factor: 0.08,
        curve_constant_n_per_kn_m: 600.0,
        tunnel_constant_n_per_kn_m: 0.00013,
        ..TrainModel::bare("test", 200e3, resistance)
    }
}

fn track() -> Track {
    Track::new(
        "test".into(),
        None,
        Some(&[(0.0, 0.0), (1000.0, 8.0), (2500.0, -12.0)]),
        Some(vec![TrackCurve { start_m: 1500.0, end_m: 1900.0, radius_m: 300.0 }]),
        Some(vec![Tunnel { start_m: 2600.0, end_m: 3000.0 }]),
    )
    .unwrap()
}

#[test]
fn the_line_acts_with_the_sign_of_the_direction() {
    let (train, track) = (train(), track());
    let at = |start_m, direction| TrainOnLine {
        train: &train,
        track: Some(&track),
        mass_kg: 180e3,
        start_m,
        direction,
    };
    let still = SimulatedMotion { distance_m: 0.0, speed_mps: 10.0 };
    let n_per_kn = |line: TrainOnLine<'_>| {
        -line.acceleration_mps2(still, Controls::default()) * 1000.0 * 1.08 / 9.81
    };
    let w0 = 1.6 + 0.2 + 0.3;
    assert!((n_per_kn(at(1200.0, 1.0)) - (w0 + 8.0)).abs() < 1e-9);
    assert!((n_per_kn(at(1200.0, -1.0)) - (w0 - 8.0)).abs() < 1e-9);
    assert!((n_per_kn(at(1700.0, -1.0)) - (w0 - 8.0 + 2.0)).abs() < 1e-9);
    assert!((n_per_kn(at(2800.0, 1.0)) - (w0 - 12.0 + 0.00013 * 400.0)).abs() < 1e-9);
}

#[test]
fn a_train_on_a_slope_starts_only_with_enough_force_and_gains_its_work_as_energy() {
    let (train, track) = (train(), track());
    let line = TrainOnLine {
        train: &train,
        track: Some(&track),
        mass_kg: 200e3,
        start_m: 1100.0,
        direction: 1.0,
    };
    let with_traction = |traction_force_n: f64| {
        let mut driver = move |_, _| Some(Controls { traction_force_n, brake_force_n: 0.0 });
        drive(&line, &mut driver, 0.1, 40.0)
    };
    // Gradient and Davis a need 9.6 N/kN, that is 18.8 kN.
    assert!(with_traction(18e3).iter().all(|point| point.motion.distance_m == 0.0));
    let points = with_traction(60e3);
    let end = points[points.len() - 1].motion;
    assert_eq!(points.len(), 401);
    assert!(end.distance_m < 300.0, "still before the curve");
    let resisted_j: f64 = points
        .windows(2)
        .map(|pair| {
            let speed_mps = 0.5 * (pair[0].motion.speed_mps + pair[1].motion.speed_mps);
            let travelled_m = pair[1].motion.distance_m - pair[0].motion.distance_m;
            TrainModel::weight_kn(200e3)
                * (train.resistance.w0_n_per_kn(speed_mps) + 8.0)
                * travelled_m
        })
        .sum();
    let kinetic_j = 0.5 * 216e3 * end.speed_mps * end.speed_mps;
    let work_j = 60e3 * end.distance_m;
    assert!((work_j - resisted_j - kinetic_j).abs() < 1e-4 * work_j);
}

#[test]
fn streams_differ_and_repeat() {
    let draw = |seed, stream| {
        let mut random = SimulatorRandom::new(seed, stream);
        (0..4).map(|_| random.uniform(0.0, 1.0)).collect::<Vec<_>>()
    };
    assert_eq!(draw(7, Stream::Driver(2)), draw(7, Stream::Driver(2)));
    assert_ne!(draw(7, Stream::Driver(2)), draw(7, Stream::Driver(3)));
    assert_ne!(draw(7, Stream::Driver(2)), draw(8, Stream::Driver(2)));
}

#[test]
fn gaussians_have_unit_variance() {
    let mut random = SimulatorRandom::new(1, Stream::Train);
    let draws: Vec<f64> = (0..20_000).map(|_| random.gaussian()).collect();
    let mean = draws.iter().sum::<f64>() / draws.len() as f64;
    let variance = draws.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / draws.len() as f64;
    // Five standard errors.
    assert!(mean.abs() < 0.035 && (variance - 1.0).abs() < 0.05, "{mean} {variance}");
}
