//! Liu's coasting runs, with assumptions for the conditions that the paper leaves open, and the Cramér-Rao bound
//! computed from them.
//!
//! The speeds have noise and outliers and are rounded: a sample is the number of the rounding step that it falls on.
//! Its Fisher information about the true speed is the sum over steps of (dp/dspeed)² / p, averaged over where in a step
//! the true speed lies.

use dynocar_model::simulate::motion::quantised;
use dynocar_model::simulate::motion::{SimulatedMotion, advance};
use dynocar_model::train::Davis;
use dynocar_tests::chance::Chance;
use nalgebra::{Matrix3, SMatrix, SVector};
use statrs::distribution::{Continuous, ContinuousCDF, Normal};

use crate::statistics::jacobian;

/// Approximately the last row of table 1: w0 = 2.2 + 0.025 v + 0.0013 v² in N/kN, v in km/h.
pub const THETA_KMH: [f64; 3] = [2.2, 0.025, 0.0013];
/// Rotating-mass factor.
pub const ROTATING_MASS_FACTOR: f64 = 0.06;
/// Time between samples in s.
pub const STEP_S: f64 = 0.2;
/// Step of the speed's display in km/h.
pub const QUANTUM_KMH: f64 = 0.1;
/// Standard deviation of the speed's noise in km/h, before rounding.
pub const NOISE_KMH: f64 = 0.05;
/// The two coasting runs: from and to, in km/h.
pub const RUNS_KMH: [(f64, f64); 2] = [(72.0, 40.0), (68.0, 42.0)];
/// a, b, c and the start speed of each run.
const UNKNOWNS: usize = 3 + RUNS_KMH.len();
/// Outliers are off by 1 to 5 km/h, up or down.
pub const OUTLIER_KMH: (f64, f64) = (1.0, 5.0);
/// Defects of the data besides noise and rounding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunCondition {
    /// In words.
    pub name: &'static str,
    /// Share of outliers, which are off by [`OUTLIER_KMH`].
    pub outlier_share: f64,
    /// Share of missing samples.
    pub missing_share: f64,
}

/// Every condition.
pub const CONDITIONS: [RunCondition; 4] = [
    RunCondition { name: "clean", outlier_share: 0.0, missing_share: 0.0 },
    RunCondition { name: "5 % outliers", outlier_share: 0.05, missing_share: 0.0 },
    RunCondition { name: "20 % missing", outlier_share: 0.0, missing_share: 0.2 },
    RunCondition { name: "5 % outliers, 20 % missing", outlier_share: 0.05, missing_share: 0.2 },
];
/// Nothing is wrong.
pub const CLEAN: RunCondition = CONDITIONS[0];

/// A measured speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuredRun {
    /// Time in s since the run's first sample.
    pub time_s: f64,
    /// Speed in km/h.
    pub speed_kmh: f64,
}

/// Returns the true coefficients, for speeds in m/s.
pub fn truth() -> Davis {
    davis(THETA_KMH)
}

/// Coefficients for speeds in m/s from those for km/h.
pub fn davis([a, b, c]: [f64; 3]) -> Davis {
    Davis { a, b: 3.6 * b, c: 3.6 * 3.6 * c }
}

/// Momentum per weight and speed, s = 1000 (1 + gamma) / g in N/kN per m/s².
pub fn inertia() -> f64 {
    1000.0 * (1.0 + ROTATING_MASS_FACTOR) / 9.81
}

/// True speeds in km/h of a run, every [`STEP_S`], until it reaches its last speed.
pub fn true_speeds_kmh((from_kmh, to_kmh): (f64, f64), davis: &Davis) -> Vec<f64> {
    let mut motion = SimulatedMotion { distance_m: 0.0, speed_mps: from_kmh / 3.6 };
    let mut speeds = Vec::new();
    while motion.speed_mps * 3.6 >= to_kmh {
        speeds.push(motion.speed_mps * 3.6);
        motion = advance(motion, STEP_S, |_, at| -davis.w0_n_per_kn(at.speed_mps) / inertia());
    }
    speeds
}

/// Returns the measured runs of a seed.
pub fn measure(condition: RunCondition, seed: u64) -> Vec<Vec<MeasuredRun>> {
    let mut random = Chance::new(seed);
    RUNS_KMH
        .iter()
        .map(|run| {
            // Where in the display's step a run begins is chance.
            let shift_kmh = QUANTUM_KMH * (random.uniform() - 0.5);
            let run = (run.0 + shift_kmh, run.1);
            let speeds = true_speeds_kmh(run, &truth());
            let samples = speeds.iter().enumerate().filter_map(|(index, &true_kmh)| {
                let mut speed_kmh = true_kmh + NOISE_KMH * random.normal();
                if random.uniform() < condition.outlier_share {
                    let size = random.between(OUTLIER_KMH.0, OUTLIER_KMH.1);
                    speed_kmh += random.sign() * size;
                }
                let is_missing = random.uniform() < condition.missing_share;
                let speed_kmh = quantised(speed_kmh, QUANTUM_KMH);
                (!is_missing).then_some(MeasuredRun { time_s: STEP_S * index as f64, speed_kmh })
            });
            samples.collect()
        })
        .collect()
}

/// Returns the speeds in m/s at which w0 is compared: where the runs coast.
pub fn compared_speeds_mps() -> Vec<f64> {
    (40..=72).map(|kmh| f64::from(kmh) / 3.6).collect()
}

/// Fisher information of one rounded speed about the true speed, in 1/(km/h)².
fn sample_information(outlier_share: f64) -> f64 {
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
            let shifted = |by: f64| {
                distribution(high - by, outlier_share) - distribution(low - by, outlier_share)
            };
            let slope = (shifted(WIDTH_KMH) - shifted(-WIDTH_KMH)) / (2.0 * WIDTH_KMH);
            if probability > 1e-300 {
                sum += slope * slope / probability;
            }
        }
    }
    sum / f64::from(phases)
}

/// Half the difference of speeds in km/h that a slope is taken over.
const WIDTH_KMH: f64 = 1e-4;

/// Returns the probability that the error before rounding lies below `error_kmh`.
fn distribution(error_kmh: f64, outlier_share: f64) -> f64 {
    let sound = Normal::standard().cdf(error_kmh / NOISE_KMH);
    // An outlier is the noise moved by a size between two bounds, up or down.
    let (low, high) = OUTLIER_KMH;
    let moved = |shift: f64| normal_integral((error_kmh - shift) / NOISE_KMH);
    let up = (moved(low) - moved(high)) * NOISE_KMH / (high - low);
    let down = (moved(-high) - moved(-low)) * NOISE_KMH / (high - low);
    (1.0 - outlier_share) * sound + outlier_share * 0.5 * (up + down)
}

/// Returns the integral of the standard normal distribution up to x.
fn normal_integral(x: f64) -> f64 {
    x * Normal::standard().cdf(x) + Normal::standard().pdf(x)
}

/// Bound of the covariance of a, b, c (for speeds in m/s) from the samples that there are, with each run's start
/// speed unknown.
pub fn bound(condition: RunCondition, runs: &[Vec<MeasuredRun>]) -> Matrix3<f64> {
    // Per (m/s)².
    let weight = sample_information(condition.outlier_share) * 3.6 * 3.6;
    let mut information = SMatrix::<f64, UNKNOWNS, UNKNOWNS>::zeros();
    for (run, (&speeds_kmh, samples)) in RUNS_KMH.iter().zip(runs).enumerate() {
        let rows = derivatives(speeds_kmh);
        let index = |sample: &MeasuredRun| (sample.time_s / STEP_S).round() as usize;
        for row in samples.iter().filter_map(|sample| rows.get(index(sample))) {
            let mut full = SVector::<f64, UNKNOWNS>::zeros();
            full.as_mut_slice()[..3].copy_from_slice(&row[..3]);
            full[3 + run] = row[3];
            information += full * full.transpose() * weight;
        }
    }
    let inverse = information.cholesky().expect("two long runs determine five unknowns").inverse();
    inverse.fixed_view::<3, 3>(0, 0).into_owned()
}

/// Central differences of the speed in m/s by a, b, c and the start speed, at every sample of a run.
fn derivatives((start_kmh, end_kmh): (f64, f64)) -> Vec<[f64; 4]> {
    let count = true_speeds_kmh((start_kmh, end_kmh), &truth()).len();
    jacobian([1e-4, 1e-5, 1e-6, 1e-4], |[da, db, dc, dv]| {
        let Davis { a, b, c } = truth();
        let davis = Davis { a: a + da, b: b + db, c: c + dc };
        let speeds_kmh = true_speeds_kmh(((start_kmh / 3.6 + dv) * 3.6, 20.0), &davis);
        speeds_kmh.iter().take(count).map(|speed_kmh| speed_kmh / 3.6).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::papers::row::w0_std;

    #[test]
    fn the_runs_coast_between_the_speeds_they_should() {
        let speeds = true_speeds_kmh(RUNS_KMH[0], &truth());
        assert_eq!(speeds[0], 72.0);
        assert!(*speeds.last().unwrap() >= 40.0 && speeds.len() > 400);
        assert!(speeds.windows(2).all(|pair| pair[1] < pair[0]));
    }

    #[test]
    fn conditions_do_to_the_data_what_they_say() {
        let count = |condition| measure(condition, 3).iter().map(Vec::len).sum::<usize>() as f64;
        let share = 1.0 - count(CONDITIONS[2]) / count(CLEAN);
        assert!((share - CONDITIONS[2].missing_share).abs() < 0.05);
        let wild = |condition| {
            let runs = measure(condition, 3);
            runs.iter()
                .flat_map(|run| run.windows(2))
                .filter(|pair| (pair[1].speed_kmh - pair[0].speed_kmh).abs() > 0.8)
                .count()
        };
        assert_eq!(wild(CLEAN), 0);
        assert!(wild(CONDITIONS[1]) > 40);
        assert_eq!(measure(CONDITIONS[3], 9), measure(CONDITIONS[3], 9));
    }

    #[test]
    fn the_integral_of_the_normal_distribution_has_its_slope() {
        let slope = (normal_integral(0.71) - normal_integral(0.69)) / 0.02;
        assert!((slope - Normal::standard().cdf(0.7)).abs() < 1e-5);
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
        let runs = measure(CLEAN, 3);
        let of_run = |run: &Vec<MeasuredRun>| run.iter().step_by(2).copied().collect();
        let half: Vec<Vec<MeasuredRun>> = runs.iter().map(of_run).collect();
        let all = at_15(bound(CLEAN, &runs));
        let half = at_15(bound(CLEAN, &half));
        assert!((half / all - 2.0_f64.sqrt()).abs() < 0.03);
        assert!(all > 0.002 && all < 0.009, "{all} N/kN");
    }
}
