//! The Cramér-Rao bound of the coasting scenario, computed.
//!
//! The speeds are noisy, sometimes wild, and rounded: a sample is the number of the step that it
//! falls on. Its Fisher information about the true speed is the sum over steps of
//! (dp/dspeed)² / p, averaged over where in a step the true speed lies.

use dynocar_model::train::Davis;
use nalgebra::{DMatrix, Matrix3};
use statrs::distribution::{Continuous, ContinuousCDF, Normal};

use super::scenario::{
    Condition, NOISE_KMH, OUTLIER_KMH, QUANTUM_KMH, RUNS_KMH, true_speeds_kmh, truth,
};
use crate::papers::differences;

/// Fisher information of one rounded speed about the true speed, in 1/(km/h)².
pub fn sample_information(outlier_share: f64) -> f64 {
    let phases = 40;
    let steps = ((OUTLIER_KMH.1 + 8.0 * NOISE_KMH) / QUANTUM_KMH).ceil() as i64 + 1;
    let mut sum = 0.0;
    for phase in 0..phases {
        let speed_kmh = QUANTUM_KMH * ((f64::from(phase) + 0.5) / f64::from(phases) - 0.5);
        for step in -steps..=steps {
            let low = QUANTUM_KMH * (step as f64 - 0.5) - speed_kmh;
            let high = low + QUANTUM_KMH;
            let probability = distribution(high, outlier_share) - distribution(low, outlier_share);
            // The error's distribution shifts against the speed.
            let slope = density(low, outlier_share) - density(high, outlier_share);
            if probability > 1e-300 {
                sum += slope * slope / probability;
            }
        }
    }
    sum / f64::from(phases)
}

/// Probability that the error before rounding lies below `error_kmh`.
fn distribution(error_kmh: f64, outlier_share: f64) -> f64 {
    let sound = normal_distribution(error_kmh / NOISE_KMH);
    // An outlier is the noise moved by a size between two bounds, up or down.
    let (low, high) = OUTLIER_KMH;
    let moved = |shift: f64| normal_integral((error_kmh - shift) / NOISE_KMH);
    let up = (moved(low) - moved(high)) * NOISE_KMH / (high - low);
    let down = (moved(-high) - moved(-low)) * NOISE_KMH / (high - low);
    (1.0 - outlier_share) * sound + outlier_share * 0.5 * (up + down)
}

fn density(error_kmh: f64, outlier_share: f64) -> f64 {
    let sound = normal_density(error_kmh / NOISE_KMH) / NOISE_KMH;
    let (low, high) = OUTLIER_KMH;
    let below = |shift: f64| normal_distribution((error_kmh - shift) / NOISE_KMH);
    let up = (below(low) - below(high)) / (high - low);
    let down = (below(-high) - below(-low)) / (high - low);
    (1.0 - outlier_share) * sound + outlier_share * 0.5 * (up + down)
}

fn normal_density(x: f64) -> f64 {
    Normal::standard().pdf(x)
}

fn normal_distribution(x: f64) -> f64 {
    Normal::standard().cdf(x)
}

/// The integral of the standard normal distribution up to x.
fn normal_integral(x: f64) -> f64 {
    x * normal_distribution(x) + normal_density(x)
}

/// Bound of the covariance of a, b, c (for speeds in m/s), with each run's start speed unknown;
/// `is_kept` says which samples of a run there are.
pub fn covariance(condition: Condition, is_kept: impl Fn(usize, usize) -> bool) -> Matrix3<f64> {
    // Per (m/s)².
    let weight = sample_information(condition.outlier_share()) * 3.6 * 3.6;
    let unknowns = 3 + RUNS_KMH.len();
    let mut information = DMatrix::<f64>::zeros(unknowns, unknowns);
    for (run, speeds_kmh) in RUNS_KMH.iter().enumerate() {
        let count = true_speeds_kmh(*speeds_kmh, &truth()).len();
        let start_mps = speeds_kmh.0 / 3.6;
        let rows = derivatives(start_mps, count);
        for (index, row) in rows.iter().enumerate() {
            if !is_kept(run, index) {
                continue;
            }
            let mut full = vec![0.0; unknowns];
            full[..3].copy_from_slice(&row[..3]);
            full[3 + run] = row[3];
            for i in 0..unknowns {
                for j in 0..unknowns {
                    information[(i, j)] += weight * full[i] * full[j];
                }
            }
        }
    }
    let inverse = information.cholesky().expect("two long runs determine five unknowns").inverse();
    inverse.fixed_view::<3, 3>(0, 0).into_owned()
}

/// Central differences of the speed in m/s by a, b, c and the start speed, at every sample.
fn derivatives(start_mps: f64, count: usize) -> Vec<[f64; 4]> {
    differences::jacobian([1e-4, 1e-5, 1e-6, 1e-4], |[da, db, dc, dv]| {
        let Davis { a, b, c } = truth();
        let davis = Davis { a: a + da, b: b + db, c: c + dc };
        let speeds_kmh = true_speeds_kmh(((start_mps + dv) * 3.6, 20.0), &davis);
        speeds_kmh.iter().take(count).map(|speed_kmh| speed_kmh / 3.6).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::papers::score::w0_std;

    #[test]
    fn the_integral_of_the_normal_distribution_has_its_slope() {
        let slope = (normal_integral(0.71) - normal_integral(0.69)) / 0.02;
        assert!((slope - normal_distribution(0.7)).abs() < 1e-5);
    }

    #[test]
    fn rounding_costs_about_its_variance_and_outliers_about_their_share() {
        let plain = 1.0 / (NOISE_KMH * NOISE_KMH);
        let rounded = sample_information(0.0);
        let approximate = 1.0 / (NOISE_KMH.powi(2) + QUANTUM_KMH.powi(2) / 12.0);
        assert!(rounded < plain && (rounded / approximate - 1.0).abs() < 0.05);
        let wild = sample_information(0.05);
        assert!(wild < 0.96 * rounded && wild > 0.9 * rounded);
    }

    #[test]
    fn fewer_samples_allow_less() {
        let at_15 = |covariance| w0_std(&covariance, 15.0);
        let all = at_15(covariance(Condition::Clean, |_, _| true));
        let half = at_15(covariance(Condition::Clean, |_, index| index % 2 == 0));
        assert!((half / all - 2.0_f64.sqrt()).abs() < 0.03);
        assert!(all > 0.002 && all < 0.009, "{all} N/kN");
    }
}
