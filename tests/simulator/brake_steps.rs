//! The estimated steps of a brake, compared with the true deceleration of simulated trains whose stops differ.

use dynocar_analysis::brakes::{SpeedSteps, lower_bound};
use dynocar_analysis::parallel::of_each_number;
use dynocar_analysis::stops::{DecelerationCurve, DecelerationLaw};
use rand::SeedableRng;
use rand::rngs::StdRng;

use crate::simulator::stops::{normal, stop, true_mps2};

#[test]
fn steps_lie_below_the_true_curve_and_are_hardly_more_cautious_than_the_best() {
    const SEEDS: usize = 200;
    let found = of_each_number(SEEDS, |seed| {
        let mut random = StdRng::seed_from_u64(7000 + seed as u64);
        let curves: Vec<DecelerationCurve> = (0..15)
            .map(|_| {
                let factor = 1.0 + 0.03 * normal(&mut random);
                DecelerationCurve::from_samples(&stop(factor, 30.0, &mut random).0).unwrap()
            })
            .collect();
        let law = DecelerationLaw::new(&curves, 0.03).unwrap();
        let steps = SpeedSteps::below(&lower_bound(&law, 0.95)).unwrap();
        let fastest = law.fastest_mps();
        let speeds = (4..).map(|k| 0.25 * f64::from(k)).take_while(|it| *it <= fastest);
        let is_below = speeds.clone().all(|speed| steps.at(speed) <= true_mps2(speed));
        let truth: Vec<[f64; 2]> = (1..)
            .map(f64::from)
            .take_while(|it| *it <= fastest)
            .map(|speed| [speed, true_mps2(speed)])
            .collect();
        let best_m = SpeedSteps::below(&truth).unwrap().distance_m(fastest);
        (is_below, steps.distance_m(fastest) / best_m - 1.0)
    });
    let below = found.iter().filter(|it| it.0).count();
    let cautious = found.iter().map(|it| it.1).sum::<f64>() / SEEDS as f64;
    println!(
        "below the true curve in {below} of {SEEDS}; {cautious:.4} more cautious than the best"
    );
    assert!(below * 100 >= 95 * SEEDS, "{below}");
    assert!((0.0..=0.03).contains(&cautious), "{cautious}");
}
