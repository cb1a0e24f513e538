//! `trajectory_newton`: a trajectory fit over a sliding window, the online scheme of Xia 2023.

use dynocar_core::filter::levenberg_marquardt::ParameterBox;
use dynocar_core::pipeline::judge::{InputState, Judgement};
use dynocar_core::pipeline::motion::SpeedRange;
use dynocar_core::pipeline::output::{DAVIS, write_parameters};
use dynocar_core::pipeline::settings::{SettingError, require};
use dynocar_core::pipeline::{Estimator, InnovationMonitor, Outcome};
use dynocar_core::settings;
use dynocar_model::force::{ResolvedSample, mps2_per_n_per_kn};
use dynocar_model::train::{Davis, TrainModel};
use dynocar_shared::{ParameterSnapshot, PipelineKind, Reason, Status};
use nalgebra::{Matrix3, Vector3};
use serde::Deserialize;

use super::window::StepWindow;
use super::wolfe_newton::{NewtonSettings, RestartSource, Restarts, wolfe_newton};
use crate::xia::trajectory::fit::{
    DavisPrior, FitError, FitSettings, TrajectoryFit, TrajectoryFitter,
};
use crate::xia::trajectory::motion::{MotionTracker, MotionUpdate, UnexplainedForce};
use crate::xia::trajectory::quality::{DavisEstimate, LongRunVariance, prior_std};
use crate::xia::trajectory::step::StepRule;

/// Speed noise before the first window, in m/s.
const SPEED_NOISE_FIRST_MPS: f64 = 0.1;
/// Windows that the learned speed noise looks back over.
const NOISE_WINDOWS: f64 = 50.0;
/// Innovations that the published statistics look back over.
const INNOVATION_MEMORY: u32 = 200;

/// Standard deviations by which the mean square of a window's residuals may exceed the noise that
/// windows before have shown; more, and something in the window is wrong.
const EXCESS_MAX: f64 = 4.0;

/// Blocks of 30 s that the long-run variance of the innovations looks back over.
const LONG_RUN_BLOCKS: f64 = 60.0;

/// Fits Davis coefficients to the newest window each time a step is completed.
#[derive(Clone, Debug)]
pub struct TrajectoryNewton {
    settings: TrajectoryNewtonSettings,
    prior_std: Vector3<f64>,
    /// Root of the density of the disturbance in m/s² √s.
    disturbance_mps2: f64,
    newton: NewtonSettings,
    fit: FitSettings,
    speed_noise_mps: f64,
    source: RestartSource,
    tracker: MotionTracker,
    window: StepWindow,
    fitter: TrajectoryFitter,
    davis: Davis,
    covariance: Matrix3<f64>,
    /// Speed in m/s at the window's end by the newest fit, and the variance of the disturbance
    /// in it over that of the measured speed.
    end: Option<(f64, f64)>,
    at_bound: bool,
    windows: u64,
    innovations: InnovationMonitor,
    long_run: LongRunVariance,
    unexplained: UnexplainedForce,
    speeds: SpeedRange,
    /// False when the newest window's residuals are larger than the noise accounts for.
    is_consistent: bool,
    fault: Option<(Status, Reason)>,
}

impl TrajectoryNewton {
    /// Returns an estimator for a train.
    ///
    /// # Errors
    ///
    /// When a setting lies outside its range.
    pub fn new(
        settings: &TrajectoryNewtonSettings,
        train: &TrainModel,
    ) -> Result<Self, SettingError> {
        let (bounds, prior) = settings.checked(train)?;
        let capacity = settings.window as usize;
        let rule = match settings.method {
            FitMethod::LevenbergMarquardt => StepRule::Time,
            FitMethod::WolfeNewton => StepRule::Distance,
        };
        Ok(TrajectoryNewton {
            newton: NewtonSettings {
                bounds,
                mean_square_max: settings.mean_square_max,
                restarts: Restarts::WhenStalled,
                ..NewtonSettings::of_the_paper()
            },
            fit: FitSettings {
                bounds,
                prior: Some(prior),
                decrease_tolerance: 1e-4,
                ..FitSettings::new(rule)
            },
            speed_noise_mps: settings.speed_noise_mps.unwrap_or(SPEED_NOISE_FIRST_MPS),
            source: RestartSource::new(settings.seed),
            tracker: MotionTracker::default(),
            window: StepWindow::new(rule, capacity, settings.interval_m),
            fitter: TrajectoryFitter::with_capacity(1, capacity + 1),
            davis: prior.davis,
            covariance: Matrix3::from_diagonal(&prior.std.component_mul(&prior.std)),
            end: None,
            at_bound: false,
            windows: 0,
            innovations: InnovationMonitor::new(INNOVATION_MEMORY),
            long_run: LongRunVariance::new(LONG_RUN_BLOCKS),
            unexplained: UnexplainedForce::default(),
            speeds: SpeedRange::default(),
            is_consistent: true,
            fault: None,
            prior_std: prior.std,
            disturbance_mps2: settings.disturbance_mps2(train),
            settings: *settings,
        })
    }

    /// Fits the window, which has just gained a step.
    fn take_window(&mut self) -> Outcome {
        self.judge_prediction();
        let needed = match self.settings.method {
            FitMethod::LevenbergMarquardt => self.settings.window as usize / 2,
            FitMethod::WolfeNewton => self.settings.window as usize,
        };
        if self.window.count() < needed {
            return Outcome::Used;
        }
        self.fit.speed_noise_mps = Some(self.speed_noise_mps);
        let fitted = match self.settings.method {
            FitMethod::LevenbergMarquardt => {
                let density = self.disturbance_mps2.powi(2) + self.window.missed_density();
                self.fit.disturbance_ratio = density / self.speed_noise_mps.powi(2);
                let start = (self.windows > 0).then_some(self.davis);
                self.fitter.fit(&[self.window.segment()], start.as_ref(), &self.fit)
            }
            FitMethod::WolfeNewton => self.run_newton(),
        };
        match fitted {
            Ok(fit) => self.take_fit(&fit),
            Err(error) => {
                let reason = match error {
                    FitError::NotDetermined => Reason::NotIdentifiable,
                    _ => Reason::NumericalFailure,
                };
                self.fault = Some((Status::Invalid, reason));
                self.end = None;
                return Outcome::Used;
            }
        }
        Outcome::Updated
    }

    /// Algorithm 1 from the window before; then the covariance of a fit that is held there.
    fn run_newton(&mut self) -> Result<TrajectoryFit, FitError> {
        let segment = self.window.segment();
        let result = wolfe_newton(
            segment.steps,
            segment.speeds_mps,
            &self.davis,
            &self.newton,
            &mut self.source,
        );
        let point = Vector3::new(result.davis.a, result.davis.b, result.davis.c);
        let held = FitSettings { bounds: ParameterBox { low: point, high: point }, ..self.fit };
        self.fitter.fit(&[segment], Some(&result.davis), &held)
    }

    fn take_fit(&mut self, fit: &TrajectoryFit) {
        self.davis = fit.davis;
        // The fit's own factor rests on the few blocks of its window.
        self.covariance = fit.covariance / fit.inflation;
        self.at_bound = match self.settings.method {
            FitMethod::LevenbergMarquardt => fit.at_bound.contains(&true),
            FitMethod::WolfeNewton => false,
        };
        self.windows += 1;
        self.fault = None;
        self.judge_residuals(fit);
        self.end = Some((fit.end_speed_mps, fit.end_variance));
    }

    /// Compares the residuals of a window with the noise, and learns that.
    fn judge_residuals(&mut self, fit: &TrajectoryFit) {
        let shown = fit.residual_std_mps * fit.residual_std_mps;
        let variance = self.speed_noise_mps * self.speed_noise_mps;
        let limit = variance * (1.0 + EXCESS_MAX * (2.0 / fit.samples as f64).sqrt());
        // The noise before the first window is a guess.
        let is_first = self.settings.speed_noise_mps.is_none() && self.windows == 1;
        self.is_consistent = is_first || (shown <= limit && fit.outliers == 0);
        if self.settings.speed_noise_mps.is_none() {
            let gain = 1.0 / (self.windows as f64).min(NOISE_WINDOWS);
            // An error of one window is hardly noise of the next.
            let believed = if is_first { shown } else { shown.min(limit) };
            self.speed_noise_mps = (variance + gain * (believed - variance)).sqrt().max(1e-6);
        }
    }

    /// Compares the newest speed with the prediction of the fit before.
    fn judge_prediction(&mut self) {
        let segment = self.window.segment();
        let (Some((end_mps, end_variance)), Some(step), Some(measured_mps)) =
            (self.end.take(), segment.steps.last(), segment.speeds_mps.last())
        else {
            self.innovations.break_here();
            self.long_run.break_here();
            return;
        };
        let (advance, _) = self.fit.rule.advance_or_crawl(step, &self.davis, end_mps);
        let duration_s = match self.fit.rule {
            StepRule::Time => step.size,
            StepRule::Distance => step.size / measured_mps,
        };
        // The end of a line through n points has about 4 / n of a point's variance.
        let spread = 1.0 + 4.0 / segment.steps.len() as f64 + end_variance;
        let variance =
            spread * self.speed_noise_mps.powi(2) + self.disturbance_mps2.powi(2) * duration_s;
        let normalised = (measured_mps - advance.speed_mps) / variance.sqrt();
        self.innovations.push(normalised);
        self.long_run.push(normalised, duration_s);
    }

    fn end_window(&mut self) {
        self.window.clear();
        self.end = None;
        self.innovations.break_here();
        self.long_run.break_here();
    }
}

impl Estimator for TrajectoryNewton {
    fn kind(&self) -> PipelineKind {
        PipelineKind::TrajectoryNewton
    }

    fn is_gated(&self) -> bool {
        true
    }

    fn leave_out(&mut self) {
        self.tracker = MotionTracker::default();
        self.end_window();
    }

    fn update(&mut self, sample: &ResolvedSample) -> Outcome {
        match self.tracker.advance(sample) {
            MotionUpdate::Continue(motion) => {
                self.unexplained.push(&motion, sample, &self.davis);
                self.speeds.push(sample.speed_mps);
                if self.window.push(&motion, sample.speed_mps) {
                    self.take_window()
                } else {
                    Outcome::Used
                }
            }
            MotionUpdate::Begin => {
                self.end_window();
                self.window.begin(sample.speed_mps);
                self.unexplained.begin(sample.speed_mps);
                Outcome::Used
            }
            MotionUpdate::Standstill => {
                self.end_window();
                Outcome::Used
            }
            MotionUpdate::Unusable(reason) => {
                self.end_window();
                Outcome::Rejected(reason)
            }
        }
    }

    fn write(&self, input: &InputState, snapshot: &mut ParameterSnapshot) -> Judgement {
        let Davis { a, b, c } = self.davis;
        let inflation = self.long_run.inflation();
        let covariance = self.covariance * inflation;
        write_parameters(snapshot, DAVIS, &Vector3::new(a, b, c), &covariance);
        let estimate = DavisEstimate {
            davis: self.davis,
            covariance,
            prior_std: self.prior_std,
            speeds: self.speeds,
            innovations: &self.innovations,
            inflation,
            is_ready: self.windows > 0,
            is_at_bound: self.at_bound,
            fault: self.fault,
            input: input.doubt,
            doubt: (!self.is_consistent).then_some(Reason::InnovationsTooLarge),
        };
        self.unexplained.write(snapshot, self.speed_noise_mps.powi(2));
        estimate.write(snapshot)
    }
}

/// How a window is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FitMethod {
    /// Box-constrained least squares with free initial speed and a prior; steps in time.
    LevenbergMarquardt,
    /// Algorithm 1 of the paper: Newton, Wolfe steps, restarts; steps by eq. 7.
    WolfeNewton,
}

settings! {
    /// Settings of `trajectory_newton`.
    #[derive(Copy)]
    TrajectoryNewtonSettings {
        /// How a window is fitted.
        method: FitMethod = FitMethod::LevenbergMarquardt;
        /// Steps of a window, the data capacity I of the paper.
        window: u32 = 20 => (5 to 5000 "steps");
        /// Distance in m between points.
        interval_m: f64 = 100.0 => (1 to 10000 "m");
        /// Standard deviations of the declared coefficients, as a share of each; they bind directions that a window
        /// does not determine.
        prior_relative_std: f64 = 0.5 => (above 0);
        /// Standard deviation of the measured speed in m/s; learned from the residuals when absent.
        speed_noise_mps: Option<f64> = None => (above 0);
        /// Root of the density of disturbing forces in N/kN √s, for `levenberg_marquardt`; 0 fits
        /// the whole trajectory as the paper does.
        disturbance_n_per_kn_sqrt_s: f64 = 0.2 => (0 or more);
        /// Lowest a, b, c; 0 when absent. Table 2 of the paper has 0.4, 0, 0.
        low: Option<[f64; 3]> = None;
        /// Highest a, b, c; five prior standard deviations above the declared when absent. Table 2
        /// of the paper has 3, 0.2, 0.01.
        high: Option<[f64; 3]> = None;
        /// ε1 of eq. 25 in (m/s)², for `wolfe_newton`.
        mean_square_max: f64 = 0.05 => (above 0);
        /// Seed of the restarts, for `wolfe_newton`.
        seed: u64 = 1;
    }
}

impl TrajectoryNewtonSettings {
    /// Returns the bounds and prior for a train.
    ///
    /// # Errors
    ///
    /// When a setting lies outside its range.
    pub(crate) fn checked(
        &self,
        train: &TrainModel,
    ) -> Result<(ParameterBox<3>, DavisPrior), SettingError> {
        self.check_ranges()?;
        let davis = train.resistance;
        let std = prior_std(train, self.prior_relative_std);
        let mean = Vector3::new(davis.a, davis.b, davis.c);
        let bounds = ParameterBox {
            low: self.low.map_or(Vector3::zeros(), Vector3::from),
            high: self.high.map_or(mean + std * 5.0, Vector3::from),
        };
        for i in 0..3 {
            let (low, high) = (bounds.low[i], bounds.high[i]);
            let is_allowed = low.is_finite() && high.is_finite() && low < high;
            require(is_allowed, "high", high, "finite numbers above those of `low`")?;
        }
        Ok((bounds, DavisPrior { davis, std }))
    }

    /// Returns the root of the density of the disturbance in m/s² √s.
    pub(crate) fn disturbance_mps2(&self, train: &TrainModel) -> f64 {
        match self.method {
            FitMethod::LevenbergMarquardt => {
                self.disturbance_n_per_kn_sqrt_s * mps2_per_n_per_kn(train.rotating_mass_factor)
            }
            FitMethod::WolfeNewton => 0.0,
        }
    }
}
