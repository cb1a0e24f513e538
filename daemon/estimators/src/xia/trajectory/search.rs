//! The search behind a trajectory fit: coefficients and noise in turn, with its request and its answer.

use dynocar_core::filter::levenberg_marquardt::{
    LeastSquares, LeastSquaresSolution, ParameterBox, SolverSettings, Termination, minimise,
};
use dynocar_core::filter::triangular::TriangularSystem;
use dynocar_model::train::Davis;
use nalgebra::{Matrix3, Vector3};

use super::residuals::{InitialSpeeds, ResidualSums, Residuals, Weighting};
use super::step::{MotionSegment, StepRule};

/// The least speed noise in m/s that residuals are divided by; below it the round-off of a long
/// trajectory would count as a residual.
const SPEED_NOISE_MIN_MPS: f64 = 1e-8;
const NOISE_ROUNDS_MAX: u32 = 8;

/// The least-squares solution for one disturbance ratio.
pub struct RatioFit {
    solution: LeastSquaresSolution<3>,
    pass: ResidualSums,
    /// Noise that the residuals were divided by.
    used_noise_mps: f64,
    /// The given noise or, if the noise is to be estimated, the noise that the residuals show.
    noise_mps: f64,
    /// Noise that the residuals show.
    shown_mps: f64,
}

impl RatioFit {
    /// Returns the covariance of the coefficients by the noise that the residuals show.
    fn covariance(&self) -> Result<Matrix3<f64>, FitError> {
        let raw = self.solution.linearisation.system.covariance().ok_or(FitError::NotDetermined)?;
        Ok(raw * (self.noise_mps / self.used_noise_mps).powi(2))
    }
}

/// Memory that a fit keeps for the next.
#[derive(Clone, Debug, Default)]
pub struct Buffers {
    /// Initial speeds, segment by segment.
    pub initial: InitialSpeeds,
    /// Residuals of a pass.
    pub residuals: Vec<f64>,
}

/// A fit under way.
pub struct TrajectorySearch<'a, 'b> {
    segments: &'a [MotionSegment<'a>],
    settings: &'a FitSettings,
    prior: Option<TriangularSystem<3>>,
    buffers: &'b mut Buffers,
    iterations: u32,
}

impl<'a, 'b> TrajectorySearch<'a, 'b> {
    /// Returns a search from the initial speeds in the buffers.
    pub fn new(
        segments: &'a [MotionSegment<'a>],
        settings: &'a FitSettings,
        prior: Option<TriangularSystem<3>>,
        buffers: &'b mut Buffers,
    ) -> Self {
        TrajectorySearch { segments, settings, prior, buffers, iterations: 0 }
    }

    /// Repeats the fit until the noise that weighs the residuals is the noise that they show.
    pub fn run(&mut self, start: &Vector3<f64>) -> Result<RatioFit, FitError> {
        let mut point = *start;
        let mut noise_mps = match self.settings.speed_noise_mps {
            Some(known_mps) => known_mps,
            None => self.median_noise_mps(&point)?,
        };
        let mut rounds = 0;
        loop {
            noise_mps = noise_mps.max(SPEED_NOISE_MIN_MPS);
            rounds += 1;
            let fitted = self.minimise(&point, noise_mps)?;
            let is_settled = (fitted.noise_mps / noise_mps - 1.0).abs() < 0.01
                || (fitted.noise_mps < SPEED_NOISE_MIN_MPS && noise_mps <= SPEED_NOISE_MIN_MPS);
            let is_known = self.settings.speed_noise_mps.is_some();
            if is_known || is_settled || rounds == NOISE_ROUNDS_MAX {
                return Ok(fitted);
            }
            (point, noise_mps) = (fitted.solution.point, fitted.noise_mps);
        }
    }

    fn minimise(&mut self, point: &Vector3<f64>, noise_mps: f64) -> Result<RatioFit, FitError> {
        let settings = self.settings;
        let weighting = Weighting {
            speed_noise_mps: noise_mps,
            disturbance_ratio: settings.disturbance_ratio,
            outlier_threshold: settings.outlier_threshold,
        };
        let start = settings.bounds.clamp(point);
        let mut residuals = Residuals::new(
            self.segments,
            settings.rule,
            weighting,
            self.prior,
            &mut self.buffers.initial,
            start,
        );
        let solver = SolverSettings {
            scales: Vector3::from(SCALES),
            iterations_max: 60,
            decrease_tolerance: settings.decrease_tolerance,
            relative_tolerance: 1e-14,
        };
        let solution = minimise(&mut residuals, &start, &settings.bounds, &solver)
            .ok_or(FitError::NotFinite { segment: 0 })?;
        let pass = *residuals.pass();
        self.iterations += solution.iterations;
        let free = pass.count.saturating_sub(3 + self.segments.len()).max(1) as f64;
        let shown_mps = noise_mps * (pass.clipped_square / free).sqrt();
        Ok(RatioFit {
            solution,
            pass,
            used_noise_mps: noise_mps,
            noise_mps: settings.speed_noise_mps.unwrap_or(shown_mps),
            shown_mps,
        })
    }

    /// Returns the noise by the median absolute residual, which half the residuals cannot spoil.
    fn median_noise_mps(&mut self, point: &Vector3<f64>) -> Result<f64, FitError> {
        let weighting = Weighting {
            speed_noise_mps: 1.0,
            disturbance_ratio: self.settings.disturbance_ratio,
            outlier_threshold: f64::INFINITY,
        };
        let start = self.settings.bounds.clamp(point);
        let Buffers { initial, residuals: record } = &mut *self.buffers;
        let mut residuals =
            Residuals::new(self.segments, self.settings.rule, weighting, None, initial, start)
                .recording(record);
        residuals.linearise(&start).ok_or(FitError::NotFinite { segment: 0 })?;
        record.iter_mut().for_each(|residual| *residual = residual.abs());
        let middle = record.len() / 2;
        let (_, median, _) = record.select_nth_unstable_by(middle, f64::total_cmp);
        // Median of the absolute value of a standard normal variable.
        Ok(*median / 0.6745)
    }

    /// The fit with covariance and counts.
    pub fn describe(&self, fitted: &RatioFit) -> Result<TrajectoryFit, FitError> {
        let RatioFit { solution, pass, .. } = fitted;
        let inflation = pass.long_run.inflation();
        let point = solution.point;
        let bounds = &self.settings.bounds;
        Ok(TrajectoryFit {
            davis: Davis { a: point[0], b: point[1], c: point[2] },
            covariance: fitted.covariance()? * inflation,
            inflation,
            speed_noise_mps: fitted.noise_mps,
            residual_std_mps: fitted.shown_mps,
            rmse_mps: (pass.square_mps2 / pass.count as f64).sqrt(),
            end_speed_mps: pass.end_speed_mps,
            end_variance: pass.end_variance,
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

/// Prior of the coefficients before the fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DavisPrior {
    /// Expected coefficients.
    pub davis: Davis,
    /// Their standard deviations, independent.
    pub std: Vector3<f64>,
}

impl DavisPrior {
    pub(super) fn rows(&self) -> TriangularSystem<3> {
        let mean = Vector3::new(self.davis.a, self.davis.b, self.davis.c);
        TriangularSystem {
            factor: Matrix3::from_diagonal(&self.std.map(|std| 1.0 / std)),
            residual: -mean.component_div(&self.std),
        }
    }
}

/// How to fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitSettings {
    /// Rule for the sizes of the steps.
    pub rule: StepRule,
    /// Lowest and highest a, b and c.
    pub bounds: ParameterBox<3>,
    /// Prior knowledge of the coefficients.
    pub prior: Option<DavisPrior>,
    /// Standard deviation of the measured speed in m/s; `None` estimates it.
    pub speed_noise_mps: Option<f64>,
    /// Density of a disturbing acceleration, white over the steps (wind, gradient errors, force
    /// errors), over the variance of the measured speed, q / R in 1/s; 0 for exact forces: output
    /// error, as in Xia 2023.
    pub disturbance_ratio: f64,
    /// Residuals beyond this many standard deviations count linearly; infinity for never.
    pub outlier_threshold: f64,
    /// Decrease of the cost, half the sum of squared standard deviations, that is worth another
    /// iteration: ε leaves the coefficients within √(2 ε) standard deviations.
    pub decrease_tolerance: f64,
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
            disturbance_ratio: 0.0,
            outlier_threshold: 4.0,
            decrease_tolerance: 1e-8,
        }
    }
}

/// Why trajectories cannot be fitted.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// A motion segment has not one speed more than steps.
    #[error(
        "motion segment {segment}: expected one speed more than its {steps} steps, got {speeds}"
    )]
    LengthMismatch {
        /// Number of the motion segment, from 0.
        segment: usize,
        /// Its steps.
        steps: usize,
        /// Its speeds.
        speeds: usize,
    },
    /// A speed, step or setting is not a usable number.
    #[error("motion segment {segment}: expected finite numbers and steps above 0")]
    NotFinite {
        /// Number of the motion segment, from 0.
        segment: usize,
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
    /// Their covariance, widened where the residuals are correlated over tens of seconds.
    pub covariance: Matrix3<f64>,
    /// Factor by which it was widened, see [`super::quality`].
    pub inflation: f64,
    /// Standard deviation of the measured speed in m/s, as given or estimated.
    pub speed_noise_mps: f64,
    /// Standard deviation in m/s that the residuals show, outliers clipped.
    pub residual_std_mps: f64,
    /// Root of the mean squared residual in m/s; with exact forces that of the trajectory.
    pub rmse_mps: f64,
    /// Fitted speed in m/s at the end of the last segment.
    pub end_speed_mps: f64,
    /// Variance of the disturbance in it, over that of the measured speed.
    pub end_variance: f64,
    /// Speeds behind the fit.
    pub samples: usize,
    /// Residuals beyond the outlier threshold.
    pub outliers: usize,
    /// Steps in which the fitted train would have stopped.
    pub stalls: usize,
    /// Linearisations in all.
    pub iterations: u32,
    /// How the last search ended.
    pub stop: Termination,
    /// Coefficients at a bound.
    pub at_bound: [bool; 3],
}

impl TrajectoryFit {
    /// Returns the standard deviation of w0 in N/kN at a speed in m/s.
    pub fn w0_std_n_per_kn(&self, speed_mps: f64) -> f64 {
        let powers = Vector3::new(1.0, speed_mps, speed_mps * speed_mps);
        (powers.transpose() * self.covariance * powers)[0].max(0.0).sqrt()
    }
}

/// Typical sizes of a, b and c.
pub(super) const SCALES: [f64; 3] = [1.0, 0.02, 0.001];
