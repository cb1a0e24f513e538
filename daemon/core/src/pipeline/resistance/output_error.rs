//! Davis a, b, c by fitting computed speeds to measured ones.
//!
//! Liu 2018 differentiates the speed over short segments and regresses the result; the errors
//! of the differences swamp the resistance. Here the equation of motion is integrated from each
//! run's start and its speeds are fitted as they were measured (output error): the speed at the
//! end of a run tells of the resistance all along it. Noise with outliers is modelled by Student's
//! t with its scale estimated (Lange, Little and Taylor 1989).

use nalgebra::{Matrix3, Vector3};

use super::regression::{PARAMETERS, scaled, unscaling};
pub use super::speed_run::{DrivenRun, DrivenSpeed};
use super::speed_run::{residuals, simulate, start_speed_mps};
use crate::filter::bounded_minimum;
use crate::train::Davis;

/// How to fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutputErrorSettings {
    /// Degrees of freedom of Student's t; infinite for the normal distribution.
    pub student_freedom: f64,
    /// Prior mean.
    pub prior: Davis,
    /// Prior standard deviation of (a, 20 b, 400 c), each in N/kN.
    pub prior_std_n_per_kn: f64,
    /// True to keep a, b, c from going below 0.
    pub is_bounded: bool,
    /// Most iterations.
    pub iterations_max: u32,
}

impl Default for OutputErrorSettings {
    fn default() -> Self {
        OutputErrorSettings {
            student_freedom: 5.0,
            prior: Davis { a: 1.5, b: 0.03, c: 0.003 },
            prior_std_n_per_kn: 20.0,
            is_bounded: true,
            iterations_max: 50,
        }
    }
}

/// Why there is no fit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OutputErrorFailure {
    /// There are fewer samples than unknowns.
    #[error("expected more than {needed} samples, got {got}")]
    TooFewSamples {
        /// Unknowns: a, b, c and a start speed for each run.
        needed: usize,
        /// Samples.
        got: usize,
    },
    /// A sample is not finite or not later than the one before.
    #[error("run {run}, sample {sample}: expected finite values, later than the sample before")]
    BadSample {
        /// Number of the run, from 1.
        run: usize,
        /// Number of the sample in the run, from 1.
        sample: usize,
    },
    /// The normal equations are singular.
    #[error("the samples do not determine a, b and c")]
    Undetermined,
    /// The iteration did not settle.
    #[error("expected convergence within {iterations} iterations")]
    NotConverged {
        /// Iterations done.
        iterations: u32,
    },
}

/// Result of a fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutputErrorFit {
    /// The coefficients.
    pub davis: Davis,
    /// Their covariance in their units: that of an M-estimator, right for noise of any
    /// symmetric distribution.
    pub covariance: Matrix3<f64>,
    /// Scale of the noise of the speed in m/s: its standard deviation without outliers.
    pub speed_scale_mps: f64,
    /// Iterations done.
    pub iterations: u32,
}

/// Fits a, b, c to all runs together, each with its own start speed.
///
/// Iterated: weights by Student's t, a Gauss-Newton step within the bounds, a line search, the
/// scale.
///
/// # Errors
///
/// See [`OutputErrorFailure`].
pub fn fit_output_error(
    runs: &[DrivenRun],
    settings: &OutputErrorSettings,
) -> Result<OutputErrorFit, OutputErrorFailure> {
    check(runs)?;
    let mut fit = Fit::start(runs, settings);
    for iteration in 1..=settings.iterations_max {
        let moved = fit.improve()?;
        let before = fit.scale_mps;
        fit.rescale();
        if moved < 1e-7 && (fit.scale_mps / before - 1.0).abs() < 1e-6 {
            return fit.finish(iteration);
        }
    }
    Err(OutputErrorFailure::NotConverged { iterations: settings.iterations_max })
}

fn check(runs: &[DrivenRun]) -> Result<(), OutputErrorFailure> {
    let needed = PARAMETERS + runs.len();
    let got = runs.iter().map(|run| run.samples.len()).sum();
    if got <= needed {
        return Err(OutputErrorFailure::TooFewSamples { needed, got });
    }
    for (r, run) in runs.iter().enumerate() {
        for (i, sample) in run.samples.iter().enumerate() {
            let values = [sample.time_s, sample.speed_mps, sample.driving_n_per_kn];
            let is_later = i == 0 || sample.time_s > run.samples[i - 1].time_s;
            if !(values.iter().all(|value| value.is_finite()) && is_later) {
                return Err(OutputErrorFailure::BadSample { run: r + 1, sample: i + 1 });
            }
        }
    }
    Ok(())
}

/// The sums of one run: its start speed against itself, the coefficients, the residuals.
#[derive(Clone, Copy, Default)]
struct RunSums {
    own: f64,
    cross: Vector3<f64>,
    side: f64,
    plain_own: f64,
    plain_cross: Vector3<f64>,
}

/// Normal equations of the coefficients, every run's start speed eliminated.
struct Normal {
    /// Weighted, in 1/(N/kN)².
    information: Matrix3<f64>,
    side: Vector3<f64>,
    /// With every weight 1, in (m/s)²/(N/kN)².
    plain: Matrix3<f64>,
    runs: Vec<RunSums>,
}

/// The state of the iteration.
struct Fit<'a> {
    runs: &'a [DrivenRun<'a>],
    settings: &'a OutputErrorSettings,
    theta: Vector3<f64>,
    starts_mps: Vec<f64>,
    residuals: Vec<f64>,
    scale_mps: f64,
}

impl<'a> Fit<'a> {
    fn start(runs: &'a [DrivenRun], settings: &'a OutputErrorSettings) -> Self {
        let theta = scaled(&settings.prior);
        let starts_mps: Vec<f64> = runs.iter().map(start_speed_mps).collect();
        let residuals = residuals(runs, &theta, &starts_mps);
        let scale_mps = robust_scale(&residuals);
        Fit { runs, settings, theta, starts_mps, residuals, scale_mps }
    }

    /// Weight of a residual by Student's t: 1 for the normal distribution.
    fn weight(&self, residual: f64) -> f64 {
        let freedom = self.settings.student_freedom;
        if freedom.is_infinite() {
            return 1.0;
        }
        (freedom + 1.0) / (freedom + (residual / self.scale_mps).powi(2))
    }

    /// Minus the log-likelihood and log-prior, up to a constant.
    fn cost(&self, residuals: &[f64], theta: &Vector3<f64>) -> f64 {
        let freedom = self.settings.student_freedom;
        let one = |residual: &f64| {
            let square = (residual / self.scale_mps).powi(2);
            match freedom.is_infinite() {
                true => 0.5 * square,
                false => 0.5 * (freedom + 1.0) * (square / freedom).ln_1p(),
            }
        };
        let distance = (theta - scaled(&self.settings.prior)) / self.settings.prior_std_n_per_kn;
        residuals.iter().map(one).sum::<f64>() + 0.5 * distance.norm_squared()
    }

    fn normal(&self) -> Normal {
        let prior_weight = self.settings.prior_std_n_per_kn.powi(-2);
        let mut normal = Normal {
            information: Matrix3::identity() * prior_weight,
            side: (scaled(&self.settings.prior) - self.theta) * prior_weight,
            plain: Matrix3::zeros(),
            runs: Vec::with_capacity(self.runs.len()),
        };
        let unit = self.scale_mps.powi(-2);
        let mut index = 0;
        for (run, start_mps) in self.runs.iter().zip(&self.starts_mps) {
            let mut sums = RunSums::default();
            simulate(run, &self.theta, *start_mps, |state| {
                let residual = self.residuals[index];
                index += 1;
                let weight = self.weight(residual) * unit;
                let (by_start, by_theta) = (state[1], state.fixed_rows::<PARAMETERS>(2));
                normal.information += by_theta * by_theta.transpose() * weight;
                normal.side += by_theta * (weight * residual);
                normal.plain += by_theta * by_theta.transpose();
                sums.own += weight * by_start * by_start;
                sums.cross += by_theta * (weight * by_start);
                sums.side += weight * by_start * residual;
                sums.plain_own += by_start * by_start;
                sums.plain_cross += by_theta * by_start;
            });
            normal.information -= sums.cross * sums.cross.transpose() / sums.own;
            normal.side -= sums.cross * (sums.side / sums.own);
            normal.plain -= sums.plain_cross * sums.plain_cross.transpose() / sums.plain_own;
            normal.runs.push(sums);
        }
        normal
    }

    /// One weighted Gauss-Newton step with a line search; gives the largest change of a
    /// coefficient in N/kN.
    fn improve(&mut self) -> Result<f64, OutputErrorFailure> {
        let normal = self.normal();
        let factor = normal.information.cholesky().ok_or(OutputErrorFailure::Undetermined)?;
        let free = self.theta + factor.solve(&normal.side);
        let lowest = if self.settings.is_bounded { 0.0 } else { f64::NEG_INFINITY };
        let bounded = bounded_minimum(&normal.information, &free, &Vector3::repeat(lowest))
            .map_err(|_| OutputErrorFailure::Undetermined)?;
        let step = bounded.estimate - self.theta;
        let start_steps: Vec<f64> =
            normal.runs.iter().map(|sums| (sums.side - sums.cross.dot(&step)) / sums.own).collect();
        let before = self.cost(&self.residuals, &self.theta);
        let mut share = 1.0;
        for _ in 0..HALVINGS_MAX {
            let theta = self.theta + step * share;
            let starts_mps: Vec<f64> =
                self.starts_mps.iter().zip(&start_steps).map(|(v, dv)| v + share * dv).collect();
            let residuals = residuals(self.runs, &theta, &starts_mps);
            if self.cost(&residuals, &theta) <= before {
                (self.theta, self.starts_mps, self.residuals) = (theta, starts_mps, residuals);
                return Ok(share * step.amax());
            }
            share *= 0.5;
        }
        // At the minimum already, to rounding.
        Ok(0.0)
    }

    /// The likeliest scale for the residuals as they are.
    fn rescale(&mut self) {
        for _ in 0..20 {
            let sum: f64 = self.residuals.iter().map(|r| self.weight(*r) * r * r).sum();
            let free = (self.residuals.len() - PARAMETERS - self.runs.len()) as f64;
            self.scale_mps = (sum / free).sqrt().max(SCALE_MIN_MPS);
        }
    }

    /// Huber's covariance of an M-estimator, with the prior.
    fn finish(&self, iterations: u32) -> Result<OutputErrorFit, OutputErrorFailure> {
        let freedom = self.settings.student_freedom;
        let (mut influence, mut slope) = (0.0, 0.0);
        for residual in &self.residuals {
            let square = (residual / self.scale_mps).powi(2);
            let weight = self.weight(*residual);
            influence += weight * weight * square;
            slope += match freedom.is_infinite() {
                true => 1.0,
                false => weight * (freedom - square) / (freedom + square),
            };
        }
        let count = self.residuals.len() as f64;
        let free = count - (PARAMETERS + self.runs.len()) as f64;
        let variance = self.scale_mps.powi(2) * (influence / free) / (slope / count).powi(2);
        let prior = Matrix3::identity() * self.settings.prior_std_n_per_kn.powi(-2);
        let information = self.normal().plain / variance + prior;
        let covariance = information.cholesky().ok_or(OutputErrorFailure::Undetermined)?.inverse();
        let factors = unscaling();
        let unscale = Matrix3::from_diagonal(&factors);
        let values = self.theta.component_mul(&factors);
        Ok(OutputErrorFit {
            davis: Davis { a: values[0], b: values[1], c: values[2] },
            covariance: unscale * covariance * unscale,
            speed_scale_mps: self.scale_mps,
            iterations,
        })
    }
}

/// Most halvings of a step that does not improve.
const HALVINGS_MAX: u32 = 12;
/// The scale of the noise is never taken to be below this, in m/s.
const SCALE_MIN_MPS: f64 = 1e-6;
/// The median of |x| for a standard normal x.
const NORMAL_MEDIAN: f64 = 0.6745;

fn robust_scale(residuals: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = residuals.iter().map(|residual| residual.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    (sizes[sizes.len() / 2] / NORMAL_MEDIAN).max(SCALE_MIN_MPS)
}

#[cfg(test)]
mod tests {
    use super::super::simulation::normal;
    use super::super::speed_run::tests::{TRUTH, coasting};
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn fit(runs: &[Vec<DrivenSpeed>], settings: &OutputErrorSettings) -> OutputErrorFit {
        let runs: Vec<_> =
            runs.iter().map(|samples| DrivenRun { samples, rotating_mass_factor: 0.06 }).collect();
        fit_output_error(&runs, settings).unwrap()
    }

    #[test]
    fn without_noise_the_coefficients_are_exact() {
        let runs = [coasting(20.0, 600, &TRUTH), coasting(18.0, 500, &TRUTH)];
        let weak = OutputErrorSettings { prior_std_n_per_kn: 1e6, ..Default::default() };
        let fit = fit(&runs, &weak);
        assert!((fit.davis.a - TRUTH.a).abs() < 1e-4);
        assert!((fit.davis.b - TRUTH.b).abs() < 1e-5);
        assert!((fit.davis.c - TRUTH.c).abs() < 1e-6);
    }

    #[test]
    fn outliers_hardly_move_the_fit_and_its_intervals_hold() {
        let mut random = ChaCha8Rng::seed_from_u64(21);
        let mut held = 0;
        for _ in 0..50 {
            let mut runs = [coasting(20.0, 600, &TRUTH), coasting(18.0, 500, &TRUTH)];
            for sample in runs.iter_mut().flatten() {
                sample.speed_mps += 0.02 * normal(&mut random);
                if random.random::<f64>() < 0.05 {
                    sample.speed_mps += if random.random() { 1.0 } else { -1.0 };
                }
            }
            let fit = fit(&runs, &OutputErrorSettings::default());
            let powers = Vector3::new(1.0, 15.0, 225.0);
            let std = (powers.dot(&(fit.covariance * powers))).sqrt();
            let error = fit.davis.w0_n_per_kn(15.0) - TRUTH.w0_n_per_kn(15.0);
            assert!(error.abs() < 0.05 * TRUTH.w0_n_per_kn(15.0));
            held += u32::from(error.abs() < 1.96 * std);
        }
        // 50 trials of 95 %: below 42 by chance in fewer than 1 of 1000.
        assert!(held >= 42, "{held} of 50");
    }

    #[test]
    fn a_coefficient_that_would_be_negative_stays_at_its_bound() {
        let odd = Davis { a: 2.0, b: -0.05, c: 0.02 };
        let runs = [coasting(20.0, 600, &odd)];
        assert_eq!(fit(&runs, &OutputErrorSettings::default()).davis.b, 0.0);
        let free = OutputErrorSettings { is_bounded: false, ..Default::default() };
        assert!(fit(&runs, &free).davis.b < 0.0);
    }

    #[test]
    fn bad_samples_are_named() {
        let mut samples = coasting(20.0, 30, &TRUTH);
        let fit = |samples: &[DrivenSpeed]| {
            let run = DrivenRun { samples, rotating_mass_factor: 0.06 };
            fit_output_error(&[run], &OutputErrorSettings::default()).unwrap_err()
        };
        let few = fit(&samples[..4]);
        assert_eq!(few, OutputErrorFailure::TooFewSamples { needed: 4, got: 4 });
        samples[7].speed_mps = f64::NAN;
        assert_eq!(fit(&samples), OutputErrorFailure::BadSample { run: 1, sample: 8 });
        samples[7] = samples[6];
        assert_eq!(fit(&samples), OutputErrorFailure::BadSample { run: 1, sample: 8 });
    }
}
