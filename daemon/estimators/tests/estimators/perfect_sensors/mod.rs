//! Trust of the estimators in the samples of a simulator as a first user writes one: without noise, with noise, or
//! rounded, from any start and at any step.

mod drive;
mod judge;

use std::sync::Mutex;

use drive::{Drive, Forces, Phase, Sensor};
use dynocar_estimators::EstimatorSettings;
use dynocar_shared::PipelineKind;
use judge::{Found, run};

const STEPS_MS: [u32; 4] = [100, 200, 500, 1000];
const SENSORS: [Sensor; 5] = [
    Sensor::Exact,
    Sensor::Noisy(0.03),
    Sensor::Noisy(0.003),
    Sensor::Quantised(0.05),
    Sensor::Quantised(0.28),
];

/// Every start, step and sensor, with forces that change in each of some ways; the seeds differ.
fn drives(forces: &[Forces]) -> Vec<Drive> {
    let mut all = Vec::new();
    for start in Phase::ALL {
        for step_ms in STEPS_MS {
            for sensor in SENSORS {
                for &forces in forces {
                    let seed = all.len() as u64;
                    all.push(Drive { start, step_ms, sensor, forces, seed });
                }
            }
        }
    }
    all
}

/// Runs kinds of estimators over those of the drives that are theirs, on every core; prints who is misled. A drive
/// takes far longer to simulate than an estimator to follow it.
fn watch(
    kinds: &[PipelineKind],
    drives: &[Drive],
    is_own: impl Fn(usize, usize) -> bool + Sync,
) -> Vec<Found> {
    let settings = |&kind| EstimatorSettings::default_of(kind).expect("a kind that learns");
    let settings: Vec<EstimatorSettings> = kinds.iter().map(settings).collect();
    let next = Mutex::new(drives.iter().enumerate());
    let all = Mutex::new(vec![Found::default(); kinds.len()]);
    let follow = |number: usize, drive: &Drive| {
        let samples = drive.samples();
        for (index, settings) in settings.iter().enumerate().filter(|it| is_own(it.0, number)) {
            let found = run(settings, &samples);
            let all = &mut all.lock().expect("no panic while holding it")[index];
            all.trusted += found.trusted;
            all.looks += found.looks;
            all.wrong += found.wrong;
            if let Some(first) = found.first_wrong {
                println!("{}: {drive:?}: {first}", kinds[index]);
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                loop {
                    let drive = next.lock().expect("no panic while holding it").next();
                    let Some((number, drive)) = drive else { break };
                    follow(number, drive);
                }
            });
        }
    });
    let all = all.into_inner().expect("no panic while holding it");
    for (kind, it) in kinds.iter().zip(&all) {
        println!("{kind}: {} samples, trusted at {}, wrong at {}", it.looks, it.trusted, it.wrong);
    }
    all
}

#[test]
fn a_trusted_mass_is_right_from_any_start_at_any_step_by_any_sensor() {
    // The one is trusted once the resistance is known too, and learns little from brakings (decision 0027).
    let least = [(PipelineKind::TrainKalman, 0.5), (PipelineKind::MassKalman, 0.85)];
    let found = watch(&least.map(|it| it.0), &drives(&Forces::ALL), |_, _| true);
    for ((kind, least), found) in least.iter().zip(found) {
        assert_eq!(found.wrong, 0, "{kind} is trusted and wrong");
        // Refusing to estimate would keep the promise as well.
        let share = found.trusted as f64 / found.looks as f64;
        assert!(share > *least, "{kind} is trusted at {share:.2} of the samples");
    }
}

#[test]
fn other_estimators_are_hardly_ever_trusted_and_wrong_while_forces_are_those_of_the_sample() {
    // One in seven of the drives for each kind, others for each.
    let drives = drives(&[Forces::Jumping, Forces::Ramped]);
    let (numbers, kinds): (Vec<usize>, Vec<PipelineKind>) = PipelineKind::ALL
        .iter()
        .copied()
        .enumerate()
        .filter(|it| EstimatorSettings::default_of(it.1).is_some())
        .unzip();
    let found = watch(&kinds, &drives, |index, drive| drive % 7 == numbers[index] % 7);
    let mut all = Found::default();
    for (kind, found) in kinds.iter().zip(found) {
        assert!(200 * found.wrong <= found.trusted, "{kind} is trusted and wrong");
        all.trusted += found.trusted;
        all.wrong += found.wrong;
    }
    println!("all: trusted at {}, wrong at {}", all.trusted, all.wrong);
    assert!(1000 * all.wrong <= all.trusted, "trusted and wrong");
}
