//! Davis coefficients from whole trajectories, offline or over a window.
//!
//! All stretches share a, b and c; each has its own initial speed. The start is integral least
//! squares, the search Gauss-Newton with damping within bounds: no restarts are needed. The
//! noise of the measured speed and, on demand, the density of a disturbing acceleration are
//! estimated with the coefficients, so that the covariance means something.

use nalgebra::{Matrix3, Vector3};

use super::integral_start::integral_start;
use super::residuals::{InitialSpeeds, Pass, Residuals, Weighting};
use super::step::{Step, StepRule};
use crate::filter::levenberg_marquardt::{ParameterBox, Solution, SolverSettings, Stop, minimise};
use crate::filter::triangular::TriangularSystem;
use crate::train::Davis;

/// An unbroken trajectory: steps and the speeds measured before, between and after them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch<'a> {
    /// The steps.
    pub steps: &'a [Step],
    /// One speed in m/s more than steps.
    pub speeds_mps: &'a [f64],
}

/// What is known of the coefficients before the fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DavisPrior {
    /// Expected coefficients.
    pub davis: Davis,
    /// Their standard deviations, independent.
    pub std: Vector3<f64>,
}

impl DavisPrior {
    fn rows(&self) -> TriangularSystem<3> {
        let mean = Vector3::new(self.davis.a, self.davis.b, self.davis.c);
        TriangularSystem {
            factor: Matrix3::from_diagonal(&self.std.map(|std| 1.0 / std)),
            residual: -mean.component_div(&self.std),
        }
    }
}

/// A disturbing acceleration, white over the steps: wind, gradient errors, force errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Disturbance {
    /// The forces are exact: output error, as in Xia 2023.
    None,
    /// Density over the variance of the measured speed, q / R in 1/s.
    Ratio(f64),
    /// The ratio of greatest likelihood.
    Estimated,
}

/// How to fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitSettings {
    /// What the steps' sizes count.
    pub rule: StepRule,
    /// Lowest and highest a, b and c.
    pub bounds: ParameterBox<3>,
    /// Prior knowledge of the coefficients.
    pub prior: Option<DavisPrior>,
    /// Standard deviation of the measured speed in m/s; `None` estimates it.
    pub speed_noise_mps: Option<f64>,
    /// Disturbing acceleration.
    pub disturbance: Disturbance,
    /// Residuals beyond so many standard deviations count linearly; infinity for never.
    pub outlier_threshold: f64,
}

impl FitSettings {
    /// Physical bounds, no prior, exact forces, noise estimated, outliers beyond 4 standard
    /// deviations (the loss of efficiency without outliers is below 0.1 %).
    pub fn new(rule: StepRule) -> Self {
        FitSettings {
            rule,
            bounds: ParameterBox { low: Vector3::zeros(), high: Vector3::new(50.0, 1.0, 0.1) },
            prior: None,
            speed_noise_mps: None,
            disturbance: Disturbance::None,
            outlier_threshold: 4.0,
        }
    }
}

/// Why trajectories cannot be fitted.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// A stretch has not one speed more than steps.
    #[error("stretch {stretch}: expected one speed more than its {steps} steps, got {speeds}")]
    LengthMismatch {
        /// Number of the stretch, from 0.
        stretch: usize,
        /// Its steps.
        steps: usize,
        /// Its speeds.
        speeds: usize,
    },
    /// A speed, step or setting is not a usable number.
    #[error("stretch {stretch}: expected finite numbers and steps above 0")]
    NotFinite {
        /// Number of the stretch, from 0.
        stretch: usize,
    },
    /// Fewer samples than parameters.
    #[error("expected at least {need} speeds, got {got}")]
    TooFewSamples {
        /// Needed.
        need: usize,
        /// Given.
        got: usize,
    },
    /// The data leave a direction of (a, b, c) open.
    #[error("the trajectories do not determine the coefficients")]
    NotDetermined,
}

/// Davis coefficients with all that is known about them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrajectoryFit {
    /// The coefficients.
    pub davis: Davis,
    /// Their covariance, for residuals as the noise model has them.
    pub covariance: Matrix3<f64>,
    /// Their covariance by the scatter between stretches, which also holds when residuals are
    /// correlated within a stretch (Liang, Zeger 1986); from 4 stretches on, good from 20 on.
    pub cluster_covariance: Option<Matrix3<f64>>,
    /// Standard deviation of the measured speed in m/s, as given or estimated.
    pub speed_noise_mps: f64,
    /// Standard deviation in m/s that the residuals show, outliers clipped.
    pub residual_std_mps: f64,
    /// Density of the disturbing acceleration over the variance of the measured speed, in 1/s.
    pub disturbance_ratio: f64,
    /// Root of the mean squared residual in m/s; with exact forces that of the trajectory.
    pub rmse_mps: f64,
    /// Speeds behind the fit.
    pub samples: usize,
    /// Residuals beyond the outlier threshold.
    pub outliers: usize,
    /// Steps in which the fitted train would have stopped.
    pub stalls: usize,
    /// Linearisations in all.
    pub iterations: u32,
    /// How the last search ended.
    pub stop: Stop,
    /// Coefficients at a bound.
    pub at_bound: [bool; 3],
}

impl TrajectoryFit {
    /// Standard deviation of w0 in N/kN at a speed in m/s.
    pub fn w0_std_n_per_kn(&self, speed_mps: f64) -> f64 {
        let powers = Vector3::new(1.0, speed_mps, speed_mps * speed_mps);
        (powers.transpose() * self.covariance * powers)[0].max(0.0).sqrt()
    }
}

/// The least speed noise in m/s that residuals are divided by; below it the round-off of a long
/// trajectory would count as a residual.
const SPEED_NOISE_MIN_MPS: f64 = 1e-8;
/// Typical sizes of a, b and c.
const SCALES: [f64; 3] = [1.0, 0.02, 0.001];
const NOISE_ROUNDS_MAX: u32 = 8;
/// Decrease of the cost worth a step: 1e-4 standard deviations for the answer, 0.02 for the
/// comparison of disturbance ratios.
const FINE_DECREASE: f64 = 1e-8;
const ROUGH_DECREASE: f64 = 2e-4;

/// Fits trajectories; keeps its buffers between fits.
#[derive(Clone, Debug, Default)]
pub struct TrajectoryFitter {
    initial: InitialSpeeds,
    residuals: Vec<f64>,
}

impl TrajectoryFitter {
    /// A fitter that allocates nothing for so many stretches and samples in all.
    pub fn with_capacity(stretches: usize, samples: usize) -> Self {
        TrajectoryFitter {
            initial: InitialSpeeds::with_capacity(stretches),
            residuals: Vec::with_capacity(samples),
        }
    }

    /// Initial speeds in m/s by the last fit, stretch by stretch.
    pub fn initial_speeds_mps(&self) -> impl Iterator<Item = f64> + '_ {
        self.initial.speeds_mps()
    }

    /// Fits all stretches jointly, from integral least squares or from given coefficients.
    ///
    /// # Errors
    ///
    /// See [`FitError`].
    ///
    /// # Real-time
    ///
    /// No allocation within the capacity; time grows with the samples, a few passes for a warm
    /// start with known noise.
    pub fn fit(
        &mut self,
        stretches: &[Stretch<'_>],
        start: Option<&Davis>,
        settings: &FitSettings,
    ) -> Result<TrajectoryFit, FitError> {
        check(stretches)?;
        let prior = settings.prior.map(|prior| prior.rows());
        let mut point = match start {
            Some(davis) => Vector3::new(davis.a, davis.b, davis.c),
            None => {
                let from = settings.prior.map_or(Vector3::from(SCALES), |prior| {
                    Vector3::new(prior.davis.a, prior.davis.b, prior.davis.c)
                });
                let noise_mps = settings.speed_noise_mps.unwrap_or(0.1);
                integral_start(
                    stretches,
                    settings.rule,
                    noise_mps,
                    prior.as_ref(),
                    &settings.bounds,
                    &Vector3::from(SCALES),
                    &settings.bounds.clamp(&from),
                )
                .ok_or(FitError::NotFinite { stretch: 0 })?
            }
        };
        self.initial.reset(stretches.iter().map(|stretch| stretch.speeds_mps[0]));
        let mut search = Search {
            stretches,
            settings,
            prior,
            fitter: self,
            decrease_tolerance: ROUGH_DECREASE,
            iterations: 0,
        };
        let ratio = match settings.disturbance {
            Disturbance::None => 0.0,
            Disturbance::Ratio(ratio) => ratio,
            Disturbance::Estimated => search.likeliest_ratio(&mut point)?,
        };
        search.decrease_tolerance = FINE_DECREASE;
        let fitted = search.at_ratio(&point, ratio)?;
        search.describe(&fitted, ratio)
    }
}

/// The least-squares solution for one disturbance ratio.
struct Fitted {
    solution: Solution<3>,
    pass: Pass,
    /// Noise that the residuals were divided by.
    used_noise_mps: f64,
    /// Noise as given or, if it is to be estimated, as the residuals show it.
    noise_mps: f64,
    /// Noise that the residuals show.
    shown_mps: f64,
    log_likelihood: f64,
}

struct Search<'a, 'b> {
    stretches: &'a [Stretch<'a>],
    settings: &'a FitSettings,
    prior: Option<TriangularSystem<3>>,
    fitter: &'b mut TrajectoryFitter,
    decrease_tolerance: f64,
    iterations: u32,
}

impl Search<'_, '_> {
    /// Fits for one disturbance ratio; repeats until the noise that weighs the residuals is
    /// the noise that they show.
    fn at_ratio(&mut self, start: &Vector3<f64>, ratio: f64) -> Result<Fitted, FitError> {
        let mut point = *start;
        let mut noise_mps = match self.settings.speed_noise_mps {
            Some(known_mps) => known_mps,
            None => self.median_noise_mps(&point, ratio)?,
        };
        let mut rounds = 0;
        loop {
            noise_mps = noise_mps.max(SPEED_NOISE_MIN_MPS);
            rounds += 1;
            let fitted = self.minimise(&point, ratio, noise_mps)?;
            let is_settled = (fitted.noise_mps / noise_mps - 1.0).abs() < 0.01
                || (fitted.noise_mps < SPEED_NOISE_MIN_MPS && noise_mps <= SPEED_NOISE_MIN_MPS);
            let is_known = self.settings.speed_noise_mps.is_some();
            if is_known || is_settled || rounds == NOISE_ROUNDS_MAX {
                return Ok(fitted);
            }
            (point, noise_mps) = (fitted.solution.point, fitted.noise_mps);
        }
    }

    fn minimise(
        &mut self,
        point: &Vector3<f64>,
        ratio: f64,
        noise_mps: f64,
    ) -> Result<Fitted, FitError> {
        let settings = self.settings;
        let weighting = Weighting {
            speed_noise_mps: noise_mps,
            disturbance_ratio: ratio,
            outlier_threshold: settings.outlier_threshold,
        };
        let start = settings.bounds.clamp(point);
        let mut residuals = Residuals::new(
            self.stretches,
            settings.rule,
            weighting,
            self.prior,
            &mut self.fitter.initial,
            start,
        );
        let solver = SolverSettings {
            scales: Vector3::from(SCALES),
            iterations_max: 60,
            decrease_tolerance: self.decrease_tolerance,
            relative_tolerance: 1e-14,
        };
        let solution = minimise(&mut residuals, &start, &settings.bounds, &solver)
            .ok_or(FitError::NotFinite { stretch: 0 })?;
        let pass = *residuals.pass();
        self.iterations += solution.iterations;
        let free = pass.count.saturating_sub(3 + self.stretches.len()).max(1) as f64;
        let shown_mps = noise_mps * (pass.clipped_square / free).sqrt();
        let count = pass.count as f64;
        let log_likelihood =
            -(solution.linearisation.cost + count * noise_mps.ln() + 0.5 * pass.log_variance);
        Ok(Fitted {
            solution,
            pass,
            used_noise_mps: noise_mps,
            noise_mps: settings.speed_noise_mps.unwrap_or(shown_mps),
            shown_mps,
            log_likelihood,
        })
    }

    /// Noise by the median absolute residual, which half the residuals cannot spoil.
    fn median_noise_mps(&mut self, point: &Vector3<f64>, ratio: f64) -> Result<f64, FitError> {
        use crate::filter::levenberg_marquardt::LeastSquares;
        let weighting = Weighting {
            speed_noise_mps: 1.0,
            disturbance_ratio: ratio,
            outlier_threshold: f64::INFINITY,
        };
        let start = self.settings.bounds.clamp(point);
        let TrajectoryFitter { initial, residuals: record } = &mut *self.fitter;
        let mut residuals =
            Residuals::new(self.stretches, self.settings.rule, weighting, None, initial, start)
                .recording(record);
        residuals.linearise(&start).ok_or(FitError::NotFinite { stretch: 0 })?;
        record.iter_mut().for_each(|residual| *residual = residual.abs());
        let middle = record.len() / 2;
        let (_, median, _) = record.select_nth_unstable_by(middle, f64::total_cmp);
        // Median of the absolute value of a standard normal variable.
        Ok(*median / 0.6745)
    }

    /// The disturbance ratio of greatest likelihood: by decades, then by golden section.
    fn likeliest_ratio(&mut self, point: &mut Vector3<f64>) -> Result<f64, FitError> {
        let mut best = (f64::NEG_INFINITY, 0.0_f64);
        // Downwards, since much disturbance binds the trajectory to the measured speeds.
        for exponent in (-7..=2).rev().map(f64::from) {
            let fitted = self.at_ratio(point, 10f64.powf(exponent))?;
            *point = fitted.solution.point;
            if fitted.log_likelihood > best.0 {
                best = (fitted.log_likelihood, exponent);
            }
        }
        let (mut low, mut high) = (best.1 - 1.0, best.1 + 1.0);
        let share = 0.5 * (5f64.sqrt() - 1.0);
        while high - low > 0.1 {
            let (left, right) = (high - share * (high - low), low + share * (high - low));
            let at_left = self.at_ratio(point, 10f64.powf(left))?;
            let at_right = self.at_ratio(point, 10f64.powf(right))?;
            *point = at_left.solution.point;
            if at_left.log_likelihood > at_right.log_likelihood { high = right } else { low = left }
        }
        let ratio = 10f64.powf(0.5 * (low + high));
        let (with, without) = (self.at_ratio(point, ratio)?, self.at_ratio(point, 0.0)?);
        // Half a unit of likelihood is what the free ratio gains by chance (Akaike 1974: 1).
        Ok(if with.log_likelihood > without.log_likelihood + 0.5 { ratio } else { 0.0 })
    }

    fn describe(&self, fitted: &Fitted, ratio: f64) -> Result<TrajectoryFit, FitError> {
        let Fitted { solution, pass, .. } = fitted;
        let shown_over_used = fitted.noise_mps / fitted.used_noise_mps;
        let raw = solution.linearisation.system.covariance().ok_or(FitError::NotDetermined)?;
        let stretches = self.stretches.len() as f64;
        let cluster_covariance = (self.stretches.len() >= 4)
            .then(|| raw * pass.score_square * raw * (stretches / (stretches - 1.0)));
        let point = solution.point;
        let bounds = &self.settings.bounds;
        Ok(TrajectoryFit {
            davis: Davis { a: point[0], b: point[1], c: point[2] },
            covariance: raw * (shown_over_used * shown_over_used),
            cluster_covariance,
            speed_noise_mps: fitted.noise_mps,
            residual_std_mps: fitted.shown_mps,
            disturbance_ratio: ratio,
            rmse_mps: (pass.square_mps2 / pass.count as f64).sqrt(),
            samples: pass.count,
            outliers: pass.outliers,
            stalls: pass.stalls,
            iterations: self.iterations,
            stop: solution.stop,
            at_bound: std::array::from_fn(|i| {
                point[i] == bounds.low[i] || point[i] == bounds.high[i]
            }),
        })
    }
}

fn check(stretches: &[Stretch<'_>]) -> Result<(), FitError> {
    let mut samples = 0;
    for (index, stretch) in stretches.iter().enumerate() {
        let (steps, speeds) = (stretch.steps.len(), stretch.speeds_mps.len());
        if speeds != steps + 1 {
            return Err(FitError::LengthMismatch { stretch: index, steps, speeds });
        }
        let is_usable = |step: &Step| {
            step.size > 0.0
                && step.size.is_finite()
                && step.drive_mps2.is_finite()
                && step.resistance_gain.is_finite()
        };
        if !(stretch.steps.iter().all(is_usable)
            && stretch.speeds_mps.iter().all(|speed| speed.is_finite()))
        {
            return Err(FitError::NotFinite { stretch: index });
        }
        samples += speeds;
    }
    let need = stretches.len() + 3;
    if samples < need { Err(FitError::TooFewSamples { need, got: samples }) } else { Ok(()) }
}
