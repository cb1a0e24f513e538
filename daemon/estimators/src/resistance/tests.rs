//! The pipelines over simulated runs.

use dynocar_model::train::Davis;
use dynocar_shared::{
    Manoeuvre, ParameterSnapshot, Reason, RejectionReason, SampleField, Status, TrainSample,
};

use super::test_runs::RunScenario;
use crate::EstimatorSettings;

const KINDS: [&str; 6] = ["ls", "rls", "regularised_rls", "mils", "v_mils", "resistance_kalman"];

fn kind(name: &str) -> String {
    format!("kind = \"{name}\"")
}

fn assert_close(scenario: &RunScenario, snapshot: &ParameterSnapshot, tolerance: f64, what: &str) {
    for speed_mps in [10.0, 15.0, 20.0, 25.0] {
        let error = scenario.relative_error(snapshot, speed_mps);
        let normalised = scenario.normalised_error(snapshot, speed_mps);
        assert!(error.abs() < tolerance, "{what}, {speed_mps} m/s: off by {error}");
        assert!(
            normalised.abs() < 3.5,
            "{what}, {speed_mps} m/s: {normalised} standard deviations off"
        );
    }
}

#[test]
fn every_kind_finds_the_resistance_of_a_driven_train() {
    let scenario = RunScenario::default();
    for name in KINDS {
        let snapshot = scenario.identify(&kind(name));
        assert_eq!(snapshot.status(), Status::Estimated, "{name}");
        assert_eq!(snapshot.excited, 0b111, "{name}");
        assert_close(&scenario, &snapshot, 0.03, name);
    }
}

#[test]
fn every_kind_finds_it_from_one_sample_a_second() {
    let scenario = RunScenario { step_s: 1.0, quantum_mps: 0.1 / 3.6, ..RunScenario::default() };
    for name in KINDS {
        assert_close(&scenario, &scenario.identify(&kind(name)), 0.04, name);
    }
}

#[test]
fn coasting_segments_find_it_too() {
    let scenario = RunScenario { duration_s: 3600.0, ..RunScenario::default() };
    for name in KINDS {
        let settings = format!("{}\ndata.source = \"coasting\"", kind(name));
        assert_close(&scenario, &scenario.identify(&settings), 0.06, name);
    }
}

#[test]
fn intervals_hold_the_truth_about_as_often_as_they_say() {
    let mut held = [0_u32; KINDS.len()];
    let mut total = 0;
    for seed in 0..40 {
        let disturbance_std = if seed % 2 == 0 { 0.0 } else { 0.08 };
        let scenario =
            RunScenario { seed, disturbance_std, duration_s: 900.0, ..RunScenario::default() };
        let samples = scenario.samples();
        for (index, name) in KINDS.iter().enumerate() {
            let snapshot = scenario.identify_samples(&kind(name), &samples);
            for speed_mps in [10.0, 20.0] {
                let error = scenario.normalised_error(&snapshot, speed_mps);
                held[index] += u32::from(error.abs() < 1.96);
            }
        }
        total += 2;
    }
    for (name, held) in KINDS.iter().zip(held) {
        // 80 correlated trials of 95 %: below 86 % by chance in fewer than 1 of 1000.
        assert!(held * 100 >= total * 86, "{name}: {held} of {total}");
    }
}

#[test]
fn a_shift_of_the_forces_by_half_a_step_is_found_and_taken_off() {
    let scenario = RunScenario { step_s: 1.0, duration_s: 3600.0, ..RunScenario::default() };
    let mut samples = scenario.samples();
    // A logger that writes each force one sample late.
    for i in (1..samples.len()).rev() {
        samples[i].traction_force_n = samples[i - 1].traction_force_n;
        samples[i].brake_force_n = samples[i - 1].brake_force_n;
    }
    for name in ["ls", "resistance_kalman"] {
        assert_close(&scenario, &scenario.identify_samples(&kind(name), &samples), 0.03, name);
    }
}

#[test]
fn a_wrong_scale_of_the_forces_is_found_and_taken_off() {
    let scenario = RunScenario { force_scale: 1.03, duration_s: 3600.0, ..RunScenario::default() };
    for name in ["ls", "resistance_kalman"] {
        assert_close(&scenario, &scenario.identify(&kind(name)), 0.03, name);
    }
}

#[test]
fn spikes_of_the_speed_are_refused_and_do_no_harm() {
    let scenario = RunScenario { spike_share: 0.03, ..RunScenario::default() };
    for name in KINDS {
        let snapshot = scenario.identify(&kind(name));
        assert!(snapshot.rejected(RejectionReason::Outlier) > 100, "{name}");
        assert_close(&scenario, &snapshot, 0.04, name);
    }
}

#[test]
fn a_slow_force_that_the_model_does_not_know_is_flagged() {
    let scenario =
        RunScenario { disturbance_std: 1.5, disturbance_time_s: 30.0, ..RunScenario::default() };
    for name in KINDS {
        let snapshot = scenario.identify(&kind(name));
        assert_eq!(snapshot.status(), Status::Degraded, "{name}");
        assert_eq!(snapshot.reason(), Some(Reason::InnovationsNotWhite), "{name}");
        assert!(snapshot.unexplained_force_std_n > 0.0, "{name}");
    }
}

#[test]
fn the_unexplained_force_follows_a_dragging_brake() {
    let scenario = RunScenario { duration_s: 1500.0, ..RunScenario::default() };
    let mut samples = scenario.samples();
    let free = scenario.identify_samples(&kind("resistance_kalman"), &samples);
    let weight_kn = 200.0 * 9.81;
    // Over the last three minutes 1.5 N/kN are on although nothing is reported: as if the
    // measured traction were that much greater than it was.
    let from = samples.len() - 900;
    for sample in &mut samples[from..] {
        sample.traction_force_n += 1.5 * weight_kn;
    }
    let dragging = scenario.identify_samples(&kind("resistance_kalman"), &samples);
    let gained = dragging.unexplained_force_n - free.unexplained_force_n;
    assert!((gained / (1.5 * weight_kn) - 1.0).abs() < 0.4, "{gained} N");
}

#[test]
fn cruising_shows_the_resistance_there_and_says_what_is_missing() {
    let scenario = RunScenario { is_coasting_only: true, ..RunScenario::default() };
    let davis = scenario.davis;
    let mut samples = scenario.samples();
    // Level line, steady speed: traction equals the resistance.
    for sample in &mut samples {
        sample.speed_mps = 20.0 + 0.01 * ((sample.sequence % 7) as f64 - 3.0);
        sample.traction_force_n = davis.w0_n_per_kn(20.0) * 200.0 * 9.81;
        sample.position_m = 20.0 * 1e-9 * sample.time_ns as f64;
        sample.set(SampleField::Gradient, 0.0);
    }
    let settings: EstimatorSettings = toml::from_str(&kind("ls")).unwrap();
    let train = scenario.train();
    let estimator = settings.build(&train).unwrap();
    let mut pipeline =
        dynocar_core::pipeline::Pipeline::new(super::test_runs::TRAIN, 0, train, None, estimator);
    for sample in &samples {
        pipeline.process(sample);
    }
    let snapshot = pipeline.snapshot();
    assert_eq!(snapshot.reason(), Some(Reason::WeakExcitation));
    assert_ne!(snapshot.excited, 0b111);
    assert_ne!(snapshot.missing_manoeuvres & Manoeuvre::VarySpeed.bit(), 0);
    let there = snapshot.resistance_at(20.0).unwrap();
    assert!((there.w0_n_per_kn / davis.w0_n_per_kn(20.0) - 1.0).abs() < 0.03);
    let elsewhere = snapshot.resistance_at(5.0).unwrap();
    assert!(elsewhere.w0_std_n_per_kn > 5.0 * there.w0_std_n_per_kn);
}

#[test]
fn a_train_that_has_changed_is_believed_by_the_forgetting_recursion() {
    let before = RunScenario { duration_s: 3000.0, ..RunScenario::default() };
    let after = RunScenario {
        davis: Davis { a: 2.6, ..before.davis },
        duration_s: 3000.0,
        seed: 2,
        ..before
    };
    let mut samples = before.samples();
    let last = *samples.last().unwrap();
    samples.extend(after.samples().into_iter().map(|mut sample| {
        sample.run = 1;
        sample.sequence += last.sequence;
        sample
    }));
    // Two lines, one track file: the gradient travels with the samples instead.
    let fast = "kind = \"rls\"\nforgetting = 0.99";
    let with_gradient = |scenario: &RunScenario, samples: &mut [TrainSample]| {
        let track = scenario.track();
        for sample in samples {
            let gradient = track.gradient_permille(sample.position_m, 100.0).unwrap();
            sample.set(SampleField::Gradient, gradient);
            sample.valid &= !SampleField::Position.bit();
        }
    };
    let split = before.samples().len();
    with_gradient(&before, &mut samples[..split]);
    with_gradient(&after, &mut samples[split..]);
    let snapshot = after.identify_samples(fast, &samples);
    for speed_mps in [15.0, 20.0] {
        assert!(after.relative_error(&snapshot, speed_mps).abs() < 0.06);
    }
}

#[test]
fn without_forces_or_gradient_it_says_what_is_missing() {
    let scenario = RunScenario { duration_s: 60.0, ..RunScenario::default() };
    let mut samples = scenario.samples();
    for sample in &mut samples {
        sample.valid &= !SampleField::TractionForce.bit();
    }
    for name in KINDS {
        let snapshot = scenario.identify_samples(&kind(name), &samples);
        assert_eq!(snapshot.status(), Status::Unestimated);
        assert_eq!(snapshot.reason(), Some(Reason::MissingQuantity), "{name}");
        assert_eq!(snapshot.rejected(RejectionReason::Missing), samples.len() as u32);
    }
    let mut samples = scenario.samples();
    for sample in &mut samples {
        sample.valid &= !SampleField::Position.bit();
    }
    let snapshot = scenario.identify_samples(&kind("ls"), &samples);
    assert_eq!(snapshot.reason(), Some(Reason::GradientUnknown));
}

#[test]
fn a_train_that_stands_teaches_nothing() {
    let scenario = RunScenario { duration_s: 300.0, ..RunScenario::default() };
    let mut samples = scenario.samples();
    for sample in &mut samples {
        sample.speed_mps = 0.0;
        sample.brake_force_n = 50_000.0;
        sample.traction_force_n = 0.0;
        sample.position_m = 500.0;
    }
    for name in KINDS {
        let snapshot = scenario.identify_samples(&kind(name), &samples);
        assert_eq!(snapshot.status(), Status::Unestimated, "{name}");
        let declared = scenario.train().resistance;
        assert!((snapshot.values[0] - declared.a).abs() < 1e-12, "{name}");
    }
}

#[test]
fn hostile_samples_leave_no_number_that_is_not_finite() {
    let scenario = RunScenario { duration_s: 600.0, ..RunScenario::default() };
    let mut samples = scenario.samples();
    for (i, sample) in samples.iter_mut().enumerate() {
        match i % 97 {
            3 => sample.speed_mps = f64::NAN,
            11 => sample.traction_force_n = 1e5,
            23 => sample.speed_mps = 0.0,
            31..=34 => sample.valid &= !SampleField::BrakeForce.bit(),
            41 => sample.time_ns += 300_000_000,
            53 => sample.position_m += 40.0,
            61 => sample.mass_kg = 900_000.0,
            _ => {}
        }
    }
    for name in KINDS {
        let snapshot = scenario.identify_samples(&kind(name), &samples);
        let numbers = snapshot.values.iter().chain(&snapshot.covariance).chain([
            &snapshot.innovation_normalised,
            &snapshot.innovation_mean_square,
            &snapshot.innovation_correlation,
            &snapshot.unexplained_force_n,
            &snapshot.unexplained_force_std_n,
        ]);
        assert!(numbers.into_iter().all(|number| number.is_finite()), "{name}");
    }
}

#[test]
fn samples_without_any_noise_break_no_factorisation() {
    let scenario = RunScenario { speed_std_mps: 0.0, quantum_mps: 0.0, ..RunScenario::default() };
    for name in KINDS {
        let snapshot = scenario.identify(&kind(name));
        assert_eq!(snapshot.generation, 0, "{name}");
        assert_close(&scenario, &snapshot, 0.01, name);
    }
}

#[test]
fn a_setting_that_is_misspelt_or_out_of_range_is_refused_by_name() {
    let misspelt = "kind = \"rls\"\nforgeting = 0.9";
    let error = toml::from_str::<EstimatorSettings>(misspelt).unwrap_err();
    assert!(error.message().contains("forgeting"), "{error}");
    let train = RunScenario::default().train();
    for (settings, key) in [
        ("kind = \"rls\"\nforgetting = 1.5", "forgetting"),
        ("kind = \"ls\"\nlambda = -1.0", "lambda"),
        ("kind = \"mils\"\ninnovation_length = 9", "innovation_length"),
        ("kind = \"v_mils\"\nbad_beyond = 0.1", "bad_beyond"),
        ("kind = \"ls\"\ndata.block_s = 0.0", "data.block_s"),
        ("kind = \"ls\"\ndata.position_std_m = nan", "data.position_std_m"),
        ("kind = \"resistance_kalman\"\nstudent_freedom = 0.0", "student_freedom"),
    ] {
        let settings: EstimatorSettings = toml::from_str(settings).unwrap();
        let error = settings.build(&train).err().unwrap();
        assert_eq!(error.key, key);
    }
}
