//! Simulated trains whose recordings hold the drive's power and no force: the estimated efficiency, its interval, and
//! the explanation with it.

use dynocar_analysis::dataset::{Dataset, ForceSource};
use dynocar_analysis::explain::evidence::{Density, FitProblem};
use dynocar_analysis::explain::explain;
use dynocar_analysis::explain::found_forces::{self, EstimatedDrive};
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::dataset_writer::read_files;
use dynocar_tests::simulator::power::{TrueDrive, power_files};
use dynocar_tests::simulator::{EffectRequest, SimulatorSettings, TrainType, simulate};

/// Seeds of the measurement; none of them took part in a choice.
const SEEDS: std::ops::Range<u64> = 61_000..61_015;
/// Least number of intervals that hold the truth: right 95 % intervals do so in 11 or more of 15 cases, but for one
/// time in a thousand.
const HELD_MIN: usize = 11;
/// Largest error of an efficiency: the remaining uncertainty of the declared masses, gradients and a, b, c.
const ERROR_MAX: f64 = 0.02;

/// Largest half width of a 95 % interval.
const HALF_WIDTH_MAX: f64 = 0.025;
/// Explained seeds, one for each kind, and the number of them that must be named rightly.
const EXPLAINED: std::ops::Range<u64> = 61_100..61_103;
const RIGHT_MIN: usize = 3;
/// Largest error in m/s over 60 s on runs held out.
const WINDOW_MAX_MPS: f64 = 0.3;

fn dataset(seed: u64, drive: &TrueDrive, effects: EffectRequest) -> Dataset {
    let settings = SimulatorSettings {
        train_type: Some([TrainType::Metro, TrainType::Regional][seed as usize % 2]),
        ..SimulatorSettings::new(seed, effects)
    };
    let files = power_files(&simulate(&settings), drive);
    read_files(&files)
}

/// The drive as the fit runs of a dataset show it.
fn estimated(dataset: &Dataset) -> Option<EstimatedDrive> {
    let (problem, _) = FitProblem::of(dataset, Density::Recorded).expect("usable runs");
    found_forces::estimated_drive(&problem, dataset.train.drive)
}

/// The drive of a seed: from 0.76 to 0.95, with auxiliaries of 40 to 100 kW on every other line.
fn true_drive(seed: u64, has_auxiliaries: bool) -> TrueDrive {
    let share = (seed % 10) as f64 / 9.0;
    let auxiliary_power_w = has_auxiliaries.then_some(40e3 + 60e3 * share);
    TrueDrive { efficiency: 0.76 + 0.19 * share, auxiliary_power_w, noise: 0.01 }
}

fn held_and_errors(has_auxiliaries: bool) -> (usize, Vec<f64>) {
    let (mut held, mut errors) = (0, Vec::new());
    for seed in SEEDS {
        let truth = true_drive(seed, has_auxiliaries);
        let dataset = dataset(seed, &truth, EffectRequest::none());
        let estimated = estimated(&dataset).unwrap();
        let found = estimated.answer.efficiency;
        let error = found.value - truth.efficiency;
        eprintln!(
            "seed {seed}: {:.3} estimated as {:.4} ± {:.4}, auxiliaries {:?} estimated as {:?} kW",
            truth.efficiency,
            found.value,
            1.96 * found.std,
            truth.auxiliary_power_w,
            estimated.answer.auxiliary_power_kw
        );
        held += usize::from(error.abs() <= 1.96 * found.std);
        assert!(1.96 * found.std < HALF_WIDTH_MAX, "seed {seed}");
        errors.push(error);
    }
    let squares: f64 = errors.iter().map(|error| error * error).sum();
    let rms = (squares / errors.len() as f64).sqrt();
    eprintln!("{held} of {} held, root mean square error {rms:.4}", errors.len());
    (held, errors)
}

#[test]
fn the_efficiency_is_reported_within_its_interval_from_the_drives_power() {
    let (held, errors) = held_and_errors(false);
    assert!(held >= HELD_MIN, "{held} of {}", errors.len());
    assert!(errors.iter().all(|error| error.abs() < ERROR_MAX), "{errors:?}");
}

#[test]
fn the_efficiency_is_reported_within_its_interval_from_the_lines_power() {
    let (held, errors) = held_and_errors(true);
    assert!(held >= HELD_MIN, "{held} of {}", errors.len());
    assert!(errors.iter().all(|error| error.abs() < ERROR_MAX), "{errors:?}");
}

/// Returns the names of the effects that `explain` finds in the dataset of a seed.
fn found(seed: u64, effects: EffectRequest) -> Vec<&'static str> {
    let truth = true_drive(seed, true);
    let dataset = dataset(seed, &truth, effects);
    assert!(dataset.runs.iter().all(|run| run.traction_source == ForceSource::Power));
    let answer = explain(&dataset, &|_, _| ()).unwrap().answer;
    eprintln!("seed {seed}: {:?} m/s, {}", answer.window60, answer.statement);
    assert!(answer.statement.contains("The force comes from power, at an efficiency of 0."));
    assert!(answer.window60.is_some_and(|[_, after]| after < WINDOW_MAX_MPS), "seed {seed}");
    answer.effects.iter().map(|effect| effect.kind).collect()
}

#[test]
fn a_train_known_by_its_power_is_a_null_and_its_effects_are_found() {
    for seed in EXPLAINED {
        let kinds = found(seed, EffectRequest::none());
        assert_eq!(kinds, [""; 0], "seed {seed}");
    }
    let kinds = [EffectKind::Wind, EffectKind::GradientShift, EffectKind::BearingTemperature];
    let mut right = 0;
    for (seed, kind) in EXPLAINED.zip(kinds) {
        right += usize::from(found(seed, EffectRequest::Kinds(vec![kind])) == [kind.name()]);
    }
    eprintln!("{right} of {} right", EXPLAINED.count());
    assert!(right >= RIGHT_MIN, "{right}");
}

#[test]
fn power_at_the_wheels_is_an_efficiency_of_one_and_others_are_estimated_as_they_are() {
    for (seed, efficiency) in (61_200..).zip([1.0, 0.985, 0.93, 0.97, 1.0, 0.6, 1.0]) {
        let truth = TrueDrive { efficiency, auxiliary_power_w: None, noise: 0.0 };
        let dataset = dataset(seed, &truth, EffectRequest::none());
        let found = estimated(&dataset).unwrap().answer.efficiency;
        eprintln!(
            "seed {seed}: {efficiency} estimated as {:.4} ± {:.4}",
            found.value,
            1.96 * found.std
        );
        assert!((found.value - efficiency).abs() < ERROR_MAX, "seed {seed}: {found:?}");
        let answer = explain(&dataset, &|_, _| ()).unwrap().answer;
        let kinds: Vec<&str> = answer.effects.iter().map(|it| it.kind).collect();
        assert_eq!(kinds, [""; 0], "seed {seed}: {}", answer.statement);
    }
}
