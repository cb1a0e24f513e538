//! The train itself as an FMU: it drives as `explain` predicts, stands, starts, and explains its refusals.

use std::fs::{read_to_string, write};

use dynocar::dataset;
use dynocar_analysis::explain::evidence::{RunData, UpdatedForces, UpdatedModel, prepare};
use dynocar_fmu::ffi::Status;
use dynocar_fmu::{MISSING, PLANT};
use dynocar_model::simulate::{Prediction, Restart};
use dynocar_shared::{SampleField, TrainSample};
use dynocar_tests::process::DaemonSite;

use super::simulator::{Fmu, reference, reference_in};
use super::{demo, unpacked};
use crate::commands::{done, dynocar, said};

/// Corrections of a train, one of every sort.
const CORRECTIONS: &str = "\n[corrections]\ntraction_gain = 1.04\nambient_w0_per_k = -0.004\nbearing_delta_a_n_per_kn = 0.6\nbearing_tau_s = 400\n\
    actuator_delay_s = 0.7\nactuator_lag_s = 0.4\n";

/// The inputs of the FMU with their fields of a recorded sample.
const INPUTS: [(&str, SampleField); 5] = [
    ("traction_force_n", SampleField::TractionForce),
    ("brake_force_n", SampleField::BrakeForce),
    ("mass_kg", SampleField::Mass),
    ("ambient_temperature_degc", SampleField::AmbientTemperature),
    ("position_m", SampleField::Position),
];

fn real(fmu: &Fmu, name: &str) -> f64 {
    fmu.real(reference_in(&PLANT, name)).unwrap_or_else(|| panic!("{name}: {}", fmu.said()))
}

fn set(fmu: &Fmu, name: &str, value: f64) {
    assert_eq!(fmu.set_real(reference_in(&PLANT, name), value), Status::Ok, "{}", fmu.said());
}

/// The FMU of an updated model, unpacked; `grown` holds its files.
fn of_updated(site: &DaemonSite, grown: &str) -> Fmu {
    done(site, &["fmu", "--plant", "-o", "train.fmu", "--grown", grown]);
    let resources = unpacked(site, "train.fmu").join("resources");
    Fmu::from_model(&PLANT, resources.to_str().unwrap())
}

/// The demo with a train that has been corrected, in a wind in m/s against growing chainage, as a
/// dataset whose folder holds an updated model too.
fn corrected_demo(site: &DaemonSite, wind_plus_mps: f64) {
    std::fs::create_dir_all(site.path().join("grown/runs")).unwrap();
    for file in ["dataset.toml", "track.toml", "runs/01.csv", "runs/02.csv", "runs/03.csv"] {
        std::fs::copy(demo().join(file), site.path().join("grown").join(file)).unwrap();
    }
    std::fs::copy(demo().join("runs/06.csv"), site.path().join("grown/runs/06.csv")).unwrap();
    let train = read_to_string(demo().join("train.toml")).unwrap();
    let wind = format!("wind_plus_mps = {wind_plus_mps:?}\n");
    write(site.path().join("grown/train.toml"), train + CORRECTIONS + &wind).unwrap();
}

/// Speeds that `explain` predicts for a run by the declared model.
fn predicted(run: &RunData, davis: [f64; 3]) -> Vec<f64> {
    let (mut forces, mut prediction) = (UpdatedForces::default(), Prediction::new());
    UpdatedModel::default().forces(run, &davis, &mut forces);
    prediction.simulate(&run.recording, &forces, Restart::FullRun);
    prediction.speed_mps().to_vec()
}

/// Sets the inputs from a sample, and their slopes towards the next one.
fn act(fmu: &Fmu, sample: &TrainSample, next: &TrainSample) {
    let step_s = (next.time_ns - sample.time_ns) as f64 * 1e-9;
    for (name, field) in INPUTS {
        let (value, later) = (sample.get(field).unwrap(), next.get(field).unwrap());
        set(fmu, name, value);
        let went = fmu.set_slope(reference_in(&PLANT, name), 1, (later - value) / step_s);
        assert_eq!(went, Status::Ok, "{}", fmu.said());
    }
    let direction = reference_in(&PLANT, "direction");
    assert_eq!(fmu.set_integer(direction, sample.direction.into()), Status::Ok);
}

#[test]
fn the_train_drives_recorded_runs_as_explain_predicts_them() {
    // A tail wind that is faster than the train turns the sign of its air resistance, at the
    // measured speed there and at the simulated one here: each direction has its head wind.
    for (index, wind_plus_mps) in [(0, 2.5), (1, -2.5)] {
        let site = DaemonSite::new();
        corrected_demo(&site, wind_plus_mps);
        let dataset = dataset::load(&site.path().join("grown")).unwrap();
        let davis = dataset.train.resistance;
        let (run, data) = (&dataset.runs[index], &prepare(&dataset).unwrap()[index]);
        assert_eq!((data.rejected, data.replaced), (0, 0), "so that the samples are the recorded");
        let expected = predicted(data, [davis.a, davis.b, davis.c]);
        let fmu = of_updated(&site, "grown");
        set(&fmu, "initial_speed_mps", expected[0]);
        act(&fmu, &run.samples[0], &run.samples[1]);
        fmu.initialize();
        let mut greatest_mps = 0.0_f64;
        for (k, pair) in run.samples.windows(2).enumerate() {
            act(&fmu, &pair[0], &pair[1]);
            let (from_s, to_s) = (pair[0].time_ns as f64 * 1e-9, pair[1].time_ns as f64 * 1e-9);
            assert_eq!(fmu.step_for(from_s, to_s - from_s), Status::Ok, "{}", fmu.said());
            let speed_mps = real(&fmu, "motion.speed_mps");
            greatest_mps = greatest_mps.max((speed_mps - expected[k + 1]).abs());
        }
        // The remaining difference is the rounding of a slope.
        assert!(greatest_mps < 1e-9, "{}: {greatest_mps} m/s", data.file);
        assert!(expected.iter().any(|&speed_mps| speed_mps > 15.0));
    }
}

#[test]
fn what_was_found_is_seen_in_the_forces_and_they_are_the_whole() {
    let site = DaemonSite::new();
    corrected_demo(&site, 2.5);
    let fmu = of_updated(&site, "grown");
    set(&fmu, "initial_speed_mps", 12.0);
    set(&fmu, "initial_position_m", 3000.0);
    set(&fmu, "traction_force_n", 104e3);
    set(&fmu, "ambient_temperature_degc", -5.0);
    fmu.initialize();
    assert_eq!(real(&fmu, "motion.position_m"), 3000.0);
    assert!((real(&fmu, "force.traction_n") - 100e3).abs() < 1e-6, "reported over true is 1.04");
    for time_s in 0..100 {
        assert_eq!(fmu.step_for(f64::from(time_s), 1.0), Status::Ok, "{}", fmu.said());
    }
    for name in ["force.wind_n", "force.ambient_n", "force.bearing_n", "force.basic_n"] {
        assert!(real(&fmu, name) > 100.0, "{name} = {}", real(&fmu, name));
    }
    let is_force = |name: &&str| name.starts_with("force.");
    let names = PLANT.variables.iter().map(|variable| variable.name).filter(is_force);
    let retarding = names.filter(|name| !["force.traction_n", "force.resistance_n"].contains(name));
    let retarding_n: f64 = retarding.map(|name| real(&fmu, name)).sum();
    let inertia_kg = 1.04 * real(&fmu, "motion.mass_kg");
    let by_parts = (real(&fmu, "force.traction_n") - retarding_n) / inertia_kg;
    assert!((by_parts - real(&fmu, "motion.acceleration_mps2")).abs() < 1e-9);
    assert!(real(&fmu, "motion.position_m") > 4000.0, "it has come along");
}

#[test]
fn a_standing_train_starts_by_traction_and_what_is_not_connected_is_none() {
    let fmu = Fmu::from_model(&PLANT, demo().to_str().unwrap());
    set(&fmu, "position_m", MISSING);
    set(&fmu, "brake_force_n", f64::NAN);
    // Past a summit the line falls by 3.1 permille.
    set(&fmu, "initial_position_m", 2500.0);
    fmu.initialize();
    let stepped = |time_s: i32| {
        assert_eq!(fmu.step_for(time_s.into(), 1.0), Status::Ok, "{}", fmu.said());
        real(&fmu, "motion.speed_mps")
    };
    assert!((0..10).all(|time_s| stepped(time_s) == 0.0), "a brake that nobody reports holds it");
    assert_eq!(real(&fmu, "motion.acceleration_mps2"), 0.0);
    set(&fmu, "traction_force_n", 200e3);
    let (first_mps, second_mps) = (stepped(10), stepped(11));
    assert!(first_mps > 0.0 && second_mps > first_mps, "{first_mps}, {second_mps}");
    set(&fmu, "traction_force_n", MISSING);
    set(&fmu, "brake_force_n", 900e3);
    assert!((12..40).map(stepped).all(|speed_mps| speed_mps >= 0.0));
    assert_eq!(real(&fmu, "motion.speed_mps"), 0.0, "a brake stops it and does not push it back");
    let rolling = Fmu::from_model(&PLANT, demo().to_str().unwrap());
    let held = reference_in(&PLANT, "held_at_rest");
    assert_eq!(rolling.set_boolean(held, 0), Status::Ok, "{}", rolling.said());
    set(&rolling, "initial_position_m", 2500.0);
    rolling.initialize();
    assert_eq!(rolling.step_for(0.0, 10.0), Status::Ok);
    assert!(real(&rolling, "motion.speed_mps") > 0.0, "released, it rolls");
}

#[test]
fn what_no_train_does_is_refused_in_words() {
    let site = DaemonSite::new();
    corrected_demo(&site, 2.5);
    let fmu = of_updated(&site, "grown");
    let named = |name: &str| reference_in(&PLANT, name);
    let refused = |went: Status, words: &str| {
        assert_eq!(went, Status::Error, "expected: {words}");
        let said = fmu.said();
        assert!(said.contains(words), "{said:?} lacks {words:?}");
    };
    let speed = named("initial_speed_mps");
    for value in [-1.0, f64::NAN, MISSING] {
        refused(fmu.set_real(speed, value), "expected a number, and no negative speed");
    }
    refused(fmu.set_real(named("motion.speed_mps"), 1.0), "motion.speed_mps is an output");
    refused(fmu.set_slope(named("brake_force_n"), 2, 0.0), "order of a derivative = 2: expected 1");
    assert_eq!(fmu.set_integer(named("direction"), 0), Status::Ok);
    fmu.initialize_refused("direction = 0: expected 1 or -1");
    assert_eq!(fmu.set_integer(named("direction"), 1), Status::Ok);
    assert_eq!(fmu.exit_initialization(), Status::Ok);
    refused(fmu.set_real(speed, 1.0), "to set a parameter is not allowed between steps");
    refused(fmu.step_for(0.0, 1e-5), "communicationStepSize = 0.00001: expected 0.0007 to 3600 s");
    refused(fmu.step_for(0.0, 4000.0), "communicationStepSize = 4000");
    for (name, value, words) in [
        ("brake_force_n", f64::INFINITY, "brake_force_n = inf: expected a finite number"),
        ("mass_kg", 0.0, "mass_kg = 0: expected a mass in kg above 0"),
    ] {
        set(&fmu, name, value);
        refused(fmu.step_for(0.0, 0.1), words);
        set(&fmu, name, MISSING);
    }
    assert_eq!(fmu.step_for(0.0, 0.1), Status::Ok, "it goes on");
    let learning = Fmu::new("");
    assert_eq!(learning.set_slope(reference("brake_force_n"), 1, 0.0), Status::Error);
    assert_eq!(learning.said(), "fmi2SetRealInputDerivatives is not supported");
    let output = dynocar(&site, &["fmu", "--plant", "-o", "b.fmu", "--grown", "nowhere"]);
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(said(&output).contains("nowhere/train.toml"), "{}", said(&output));
}

#[test]
fn a_point_again_a_step_back_and_a_leap_move_no_train() {
    let fmu = Fmu::from_model(&PLANT, demo().to_str().unwrap());
    set(&fmu, "initial_speed_mps", 10.0);
    fmu.initialize();
    for time_s in [0.0, 10.0, 20.0] {
        assert_eq!(fmu.step_for(time_s, 10.0), Status::Ok, "{}", fmu.said());
        let at_m = real(&fmu, "motion.position_m");
        for elsewhere_s in [time_s, time_s - 5.0, -50.0, time_s + 10.1, 1000.0] {
            assert_eq!(fmu.step_for(elsewhere_s, 10.0), Status::Error, "{elsewhere_s}");
            let expected = format!("expected {} s, the end of the step before", time_s + 10.0);
            assert!(fmu.said().contains(&expected), "{}", fmu.said());
            assert_eq!(real(&fmu, "motion.position_m"), at_m);
        }
    }
}
