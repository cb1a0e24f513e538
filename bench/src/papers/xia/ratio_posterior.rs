//! The fit of a whole run with an unknown disturbance: the likeliest ratio, and what the likelihood
//! leaves open about it costs.
//!
//! A run of an hour gives the density of a disturbance within a factor of two or three. The
//! covariance for the likeliest one is too small as often as that one is, and a fit that finds
//! no disturbance at all is far too sure. The covariance is therefore averaged over the ratios by
//! their restricted likelihood, every decade being as likely beforehand.

use dynocar_estimators::xia::trajectory::fit::{
    FitError, FitSettings, MotionSegment, TrajectoryFit, TrajectoryFitter,
};
use dynocar_model::train::Davis;
use nalgebra::{Matrix3, Vector3};

/// Decades searched: from a disturbance that no run shows to one that binds the trajectory to
/// the measured speeds.
const EXPONENTS: std::ops::RangeInclusive<i32> = -7..=2;
/// Nodes between two decades around the likeliest one, the later decade among them.
const PER_DECADE: i32 = 4;

/// Decrease of the cost worth an iteration when disturbance ratios are compared.
const ROUGH_DECREASE: f64 = 2e-4;

/// The fit at the disturbance ratio of greatest restricted likelihood, by decades and then by quarters
/// of a decade; its covariance is averaged over all ratios.
pub fn likeliest_fit(
    segments: &[MotionSegment<'_>],
    settings: &FitSettings,
) -> Result<TrajectoryFit, FitError> {
    let mut fitter = TrajectoryFitter::default();
    let mut fit = |start: Option<&Davis>, disturbance_ratio, decrease_tolerance| {
        let settings = FitSettings { disturbance_ratio, decrease_tolerance, ..*settings };
        fitter.fit(segments, start, &settings)
    };
    let mut posterior = RatioPosterior::default();
    let mut davis = None;
    // Downwards, since much disturbance binds the trajectory to the measured speeds.
    for exponent in EXPONENTS.rev().map(f64::from) {
        let found = fit(davis.as_ref(), 10f64.powf(exponent), ROUGH_DECREASE)?;
        davis = Some(found.davis);
        posterior.add(Tried::of(exponent, &found));
    }
    let mut davis = posterior.likeliest().davis();
    for exponent in posterior.between_neighbours() {
        let found = fit(Some(&davis), 10f64.powf(exponent), ROUGH_DECREASE)?;
        davis = found.davis;
        posterior.add(Tried::of(exponent, &found));
    }
    let davis = posterior.likeliest().davis();
    let without = fit(Some(&davis), 0.0, ROUGH_DECREASE)?;
    // Half a unit of likelihood is what the free ratio gains by chance (Akaike 1974: 1).
    let gain = posterior.likeliest().log_likelihood - without.restricted_log_likelihood;
    let ratio = if gain > 0.5 { 10f64.powf(posterior.peak_exponent()) } else { 0.0 };
    let found = fit(Some(&davis), ratio, settings.decrease_tolerance)?;
    let covariance = posterior.covariance_about(&Tried::of(0.0, &found).point);
    let covariance = covariance.map_or(found.covariance, |averaged| averaged * found.inflation);
    Ok(TrajectoryFit { covariance, ..found })
}

/// A ratio that has been tried.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Tried {
    /// Decimal logarithm of the ratio.
    exponent: f64,
    /// Its restricted log-likelihood.
    log_likelihood: f64,
    /// The coefficients that belong to it.
    point: Vector3<f64>,
    /// Their covariance, not widened.
    covariance: Matrix3<f64>,
}

impl Tried {
    fn of(exponent: f64, found: &TrajectoryFit) -> Self {
        let Davis { a, b, c } = found.davis;
        Tried {
            exponent,
            log_likelihood: found.restricted_log_likelihood,
            point: Vector3::new(a, b, c),
            covariance: found.covariance / found.inflation,
        }
    }

    fn davis(&self) -> Davis {
        Davis { a: self.point[0], b: self.point[1], c: self.point[2] }
    }
}

/// The ratios tried, in ascending order.
#[derive(Clone, Debug, Default)]
struct RatioPosterior(Vec<Tried>);

impl RatioPosterior {
    /// Adds a trial.
    fn add(&mut self, tried: Tried) {
        let index = self.0.partition_point(|node| node.exponent < tried.exponent);
        self.0.insert(index, tried);
    }

    fn likeliest_index(&self) -> usize {
        let likelihood = |i: &usize| self.0[*i].log_likelihood;
        (0..self.0.len()).max_by(|i, j| likelihood(i).total_cmp(&likelihood(j))).unwrap_or(0)
    }

    /// The likeliest of the ratios tried.
    fn likeliest(&self) -> &Tried {
        &self.0[self.likeliest_index()]
    }

    /// Exponents between the likeliest decade and its neighbours, downwards.
    fn between_neighbours(&self) -> impl Iterator<Item = f64> + use<> {
        let centre = self.likeliest().exponent;
        let (low, high) = (f64::from(*EXPONENTS.start()), f64::from(*EXPONENTS.end()));
        (1 - PER_DECADE..PER_DECADE)
            .rev()
            .filter(|step| *step != 0)
            .map(move |step| centre + f64::from(step) / f64::from(PER_DECADE))
            .filter(move |exponent| (low..=high).contains(exponent))
    }

    /// Exponent of the greatest likelihood, by a parabola through the likeliest ratio and its
    /// neighbours where they are as far apart.
    fn peak_exponent(&self) -> f64 {
        let (nodes, at) = (&self.0, self.likeliest_index());
        let centre = &nodes[at];
        let (Some(left), Some(right)) = (at.checked_sub(1).map(|i| &nodes[i]), nodes.get(at + 1))
        else {
            return centre.exponent;
        };
        let (below, above) = (centre.exponent - left.exponent, right.exponent - centre.exponent);
        let bend = left.log_likelihood - 2.0 * centre.log_likelihood + right.log_likelihood;
        if (below - above).abs() > 1e-9 || bend >= 0.0 {
            return centre.exponent;
        }
        centre.exponent + 0.5 * below * (left.log_likelihood - right.log_likelihood) / bend
    }

    /// Mean square error of given coefficients over all ratios, by the trapezoidal rule; `None`
    /// without a trial.
    fn covariance_about(&self, point: &Vector3<f64>) -> Option<Matrix3<f64>> {
        let nodes = &self.0;
        let best = self.likeliest().log_likelihood;
        let (mut sum, mut total) = (Matrix3::zeros(), 0.0);
        for (i, node) in nodes.iter().enumerate() {
            let before = i.checked_sub(1).map_or(node.exponent, |i| nodes[i].exponent);
            let after = nodes.get(i + 1).map_or(node.exponent, |next| next.exponent);
            let weight = 0.5 * (after - before) * (node.log_likelihood - best).exp();
            let apart = node.point - point;
            sum += (node.covariance + apart * apart.transpose()) * weight;
            total += weight;
        }
        (total > 0.0).then(|| sum / total)
    }
}

#[cfg(test)]
mod tests {
    use dynocar_core::filter::levenberg_marquardt::ParameterBox;
    use dynocar_estimators::xia::trajectory::step::{Step, StepRule};
    use dynocar_model::force::balance::mps2_per_n_per_kn;

    use super::*;
    use crate::chance::Chance;

    const FAST: Davis = Davis { a: 0.79, b: 0.0229, c: 0.001493 };

    /// Traction, coasting and braking between 10 and 80 m/s over rolling ground.
    fn steps(count: usize) -> Vec<Step> {
        let at = |i: usize| Step {
            size: 2.5,
            drive_mps2: [0.38, 0.2, 0.12, 0.0, -0.25, 0.25, 0.15, 0.0][(8 * i / count) % 8]
                + 0.05 * (0.7 * i as f64).sin(),
            resistance_gain: mps2_per_n_per_kn(0.06),
        };
        (0..count).map(at).collect()
    }

    fn speeds(steps: &[Step], initial_mps: f64) -> Vec<f64> {
        let mut speeds = vec![initial_mps];
        for step in steps {
            let last_mps = speeds[speeds.len() - 1];
            let after = StepRule::Time.advance(step, &FAST, last_mps).expect("a moving train");
            speeds.push(after.speed_mps);
        }
        speeds
    }

    /// Trials of a likelihood that is normal over the exponent, with variances that follow it.
    fn posterior(centre: f64, width: f64) -> RatioPosterior {
        let tried = |exponent: f64| Tried {
            exponent,
            log_likelihood: -0.5 * ((exponent - centre) / width).powi(2),
            point: Vector3::new(exponent - centre, 0.0, 0.0),
            covariance: Matrix3::identity() * 10f64.powf(exponent - centre),
        };
        let mut posterior = RatioPosterior::default();
        EXPONENTS.for_each(|exponent| posterior.add(tried(f64::from(exponent))));
        for exponent in posterior.between_neighbours() {
            posterior.add(tried(exponent));
        }
        posterior
    }

    #[test]
    fn intervals_hold_with_and_without_disturbance() {
        // 180 squares of standard normal numbers: 1 ± 0.105. The disturbance, estimated from 400
        // speeds, is known within a factor of 2, which lengthens the tail. Where there is none,
        // 400 speeds cannot exclude one that doubles the variance, and the intervals allow for it.
        for (disturbance, noise_mps, band) in [(0.0, 0.2, 0.4..1.2), (0.01, 0.05, 0.7..1.3)] {
            let steps = steps(400);
            let mut square = 0.0;
            let seeds = 60;
            for seed in 0..seeds {
                let mut random = Chance::new(seed);
                let mut disturbed = steps.clone();
                for step in &mut disturbed {
                    step.drive_mps2 += disturbance * random.normal() / step.size.sqrt();
                }
                let mut speeds = speeds(&disturbed, 12.0);
                speeds.iter_mut().for_each(|speed| *speed += noise_mps * random.normal());
                let bounds =
                    ParameterBox { low: Vector3::repeat(-1e3), high: Vector3::repeat(1e3) };
                let settings = FitSettings { bounds, ..FitSettings::new(StepRule::Time) };
                let segments = [MotionSegment { steps: &steps, speeds_mps: &speeds }];
                let fit = likeliest_fit(&segments, &settings).unwrap();
                let error =
                    Vector3::new(fit.davis.a - FAST.a, fit.davis.b - FAST.b, fit.davis.c - FAST.c);
                let weighed = fit.covariance.cholesky().unwrap().solve(&error);
                square += error.dot(&weighed) / 3.0;
                assert!((fit.speed_noise_mps / noise_mps - 1.0).abs() < 0.25);
            }
            let mean = square / seeds as f64;
            assert!(band.contains(&mean), "disturbance {disturbance}: {mean}");
        }
    }

    #[test]
    fn the_average_is_the_integral_over_a_normal_likelihood() {
        let (centre, width) = (-2.8, 0.3);
        let posterior = posterior(centre, width);
        assert!((posterior.peak_exponent() - centre).abs() < 1e-9);
        let covariance = posterior.covariance_about(&Vector3::zeros()).unwrap();
        // Mean of a log-normal variable.
        let expected = (0.5 * (width * 10f64.ln()).powi(2)).exp();
        // The coarse nodes of the tail overstate it somewhat.
        assert!((0.98..1.07).contains(&(covariance[(1, 1)] / expected)), "{covariance}");
        let spread = covariance[(0, 0)] - covariance[(1, 1)];
        assert!((0.95..1.15).contains(&(spread / (width * width))), "{spread}");
    }

    #[test]
    fn at_the_end_of_the_range_only_its_inner_side_is_tried() {
        let posterior = posterior(-9.0, 3.0);
        assert_eq!(posterior.peak_exponent(), -7.0);
        assert!(posterior.0.iter().all(|node| (-7.0..=2.0).contains(&node.exponent)));
        assert!(posterior.covariance_about(&Vector3::zeros()).unwrap()[(1, 1)] > 10.0);
    }
}
