//! Every pipeline under every failure of its sensors, at rates from one in a thousand to one half.

use std::sync::Mutex;

use dynocar_tests::sensor_failures::SensorFailure;
use dynocar_tests::simulator::TrainType;
use dynocar_tests::soak::bad_samples::{Misled, Scene};

/// Failures that nothing in a sample gives away, and the kinds that they are known to mislead:
/// single forces that are wrong by a plausible amount, or a scale error of them.
fn is_known(misled: &Misled) -> bool {
    use SensorFailure::{Frozen, Quantised, Saturated, SignFlip, Spikes, Thousandfold};
    let by_force = matches!(
        misled.failure,
        Some(Frozen | Quantised | Saturated | SignFlip | Spikes | Thousandfold)
    );
    let takes_single_forces = ["trajectory_kalman", "trajectory_newton", "mass_kalman"];
    by_force && takes_single_forces.contains(&misled.kind.as_str())
}

#[test]
fn bad_samples_are_refused_or_survived_counted_and_never_trusted() {
    let scenes = [Scene::new(1, TrainType::Freight), Scene::new(2, TrainType::Regional)];
    let cases: Vec<(usize, SensorFailure, f64)> = (0..scenes.len())
        .flat_map(|scene| {
            // Half of all samples in the first scene, one of three smaller rates in the second.
            SensorFailure::ALL.into_iter().enumerate().map(move |(place, failure)| {
                let rate = if scene == 0 { 0.5 } else { [0.001, 0.02, 0.1][place % 3] };
                (scene, failure, rate)
            })
        })
        .collect();
    let next = Mutex::new(cases.iter());
    let misled = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                loop {
                    let case = next.lock().expect("no panic while holding it").next();
                    let Some(&(scene, failure, rate)) = case else { break };
                    let found = scenes[scene].run(Some(failure), rate, 7);
                    misled.lock().expect("no panic while holding it").extend(found);
                }
            });
        }
    });
    let misled = misled.into_inner().expect("no panic while holding it");
    misled.iter().for_each(|it| println!("{it:?}"));
    let unknown: Vec<_> = misled.iter().filter(|it| !is_known(it)).collect();
    assert!(unknown.is_empty(), "trusted and wrong: {unknown:#?}");
}

#[test]
fn good_samples_mislead_nobody() {
    let misled = Scene::new(2, TrainType::Regional).run(None, 0.0, 0);
    assert!(misled.is_empty(), "{misled:#?}");
}
