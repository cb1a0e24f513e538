//! Figure 9: a change of mass at a stop.

use dynocar_core::pipeline::{Estimator, Outcome};
use dynocar_estimators::wang::MassRegression;
use dynocar_model::force::ResolvedSample;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::leg::{kalman, known_resistance, staged, there_and_back};
use super::sensor::measure;
use super::shuttle::{EMPTY_MASS_KG, Shuttle, calm};
use crate::papers::row::{Row, WANG};
use crate::papers::seeds::Seeds;
use crate::statistics::mean;

/// A change of mass at a stop: seconds under force until the error stays below 1 %.
pub fn row(shuttle: &Shuttle, seeds: Seeds) -> Row {
    let loaded_kg = 1.12 * EMPTY_MASS_KG;
    let ride = there_and_back(shuttle, loaded_kg, &mut calm);
    let stop = ride.iter().position(|instant| instant.mass_kg == loaded_kg).expect("a second leg");
    let resistance = known_resistance(shuttle);
    let (mut paper, mut reverse, mut ours) = (Vec::new(), Vec::new(), Vec::new());
    for seed in seeds.range() {
        let samples = measure(shuttle, &ride, &mut ChaCha8Rng::seed_from_u64(seed));
        let (before, after) = samples.split_at(stop);
        for (regression, times) in [
            (MassRegression::ForceOnAcceleration, &mut paper),
            (MassRegression::AccelerationOnForce, &mut reverse),
        ] {
            let mut staged = staged(shuttle, regression, &resistance);
            before.iter().for_each(|sample| _ = staged.update(sample));
            times.extend(settling_s(after, loaded_kg, &mut |sample| {
                (staged.update(sample) == Outcome::Updated).then(|| staged.mass_kg())
            }));
        }
        let mut kalman = kalman(shuttle, &resistance);
        before.iter().for_each(|sample| _ = kalman.update(sample));
        ours.extend(settling_s(after, loaded_kg, &mut |sample| {
            (kalman.update(sample) == Outcome::Updated).then(|| kalman.mass_kg().0)
        }));
    }
    // A way that does not settle in every run has no settling time.
    let time_s = |times: &[f64]| (times.len() == seeds.count).then(|| mean(times));
    let quantity = "12 % more mass after a stop: time under force until the error stays below 1 % \
                    (paper's method: force on differentiated speed, nothing where it never does; \
                    baseline: the reverse)";
    Row {
        paper_method: time_s(&paper),
        baseline: time_s(&reverse),
        ours: time_s(&ours),
        ..Row::new(WANG, "Figure 9", quantity, "s", seeds)
    }
}

/// Seconds of updates until the error stays below 1 %; `None` when it never does.
fn settling_s(
    samples: &[ResolvedSample],
    truth_kg: f64,
    estimate: &mut dyn FnMut(&ResolvedSample) -> Option<f64>,
) -> Option<f64> {
    let (mut under_force_s, mut settled_s) = (0.0, None);
    for sample in samples {
        let Some(mass_kg) = estimate(sample) else { continue };
        under_force_s += sample.step_s;
        if (mass_kg / truth_kg - 1.0).abs() >= 0.01 {
            settled_s = None;
        } else if settled_s.is_none() {
            settled_s = Some(under_force_s);
        }
    }
    settled_s
}
