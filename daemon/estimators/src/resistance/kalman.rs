//! The pipeline `resistance_kalman`: a robust filter over every sample.
//!
//! States are speed, disturbance and the unknowns of the regression. Where the least-squares pipelines wait for a block
//! of samples, this one corrects at every sample, weights each speed by Student's t, lets the coefficients drift, and
//! follows the disturbance as it changes. The noise of the data comes from a least-squares estimator that runs in
//! parallel.

use dynocar_core::filter::Gaussian;
use dynocar_core::pipeline::judge::{InputState, Judgement};
use dynocar_core::pipeline::momentum::{
    BRAKE_SCALE, Disturbance, FORCE_DELAY, PARAMETERS, TRACTION_SCALE, UNKNOWNS, UnitSample,
    regressors,
};
use dynocar_core::pipeline::motion::jump_variance;
use dynocar_core::pipeline::{Estimator, InnovationMonitor, KeptEstimate, Outcome};
use dynocar_model::force::ResolvedSample;
use dynocar_model::train::TrainModel;
use dynocar_shared::{ParameterSnapshot, PipelineKind, RejectionReason};
use nalgebra::{SMatrix, SVector};

use super::least_squares::ResistanceLeastSquares;
use super::noise_bank::LikeliestNoise;
use super::regression::{AffineMotion, RegressionSolution};
use super::report::ResistanceReport;
use super::settings::KalmanSettings;

const SPEED: usize = 0;
const DISTURBANCE: usize = 1;
/// Index of the first unknown of the regression.
const FIRST_UNKNOWN: usize = 2;
const STATES: usize = FIRST_UNKNOWN + UNKNOWNS;

type State = SVector<f64, STATES>;

/// How long a change of force is remembered, in s.
const FORCE_RATE_MEMORY_S: f64 = 0.5;
/// Samples that the innovation statistics look back over.
const MONITOR_SAMPLES: u32 = 600;
/// Standard deviations beyond which a speed speaks against the filter.
const OUTLIER_BEYOND: f64 = 3.0;
/// After this many of them in a row on one side, each no spike, the filter is wrong.
const CONSECUTIVE_OUTLIERS_MAX: i32 = 10;

/// Davis coefficients by a robust Kalman filter with a disturbance state.
#[derive(Clone, Debug)]
pub struct ResistanceKalman {
    settings: KalmanSettings,
    /// The weight that normal noise has on average: without it the covariance would be too wide.
    mean_weight: f64,
    train_length_m: f64,
    least_squares: ResistanceLeastSquares,
    filter: Gaussian<STATES>,
    last: Option<UnitSample>,
    last_time_ns: Option<i64>,
    noise: LikeliestNoise,
    /// The fastest change of force lately, in N/kN per s.
    force_rate: f64,
    /// How far the speed moved in the newest step, in m/s.
    moved_mps: f64,
    /// Speeds in a row that speak against the filter, with the sign of their side.
    consecutive_outliers: i32,
    monitor: InnovationMonitor,
    report: ResistanceReport,
    resets: u64,
}

impl ResistanceKalman {
    /// Returns a filter for a train; `least_squares` learns the noise.
    pub fn new(
        train: &TrainModel,
        settings: KalmanSettings,
        least_squares: ResistanceLeastSquares,
    ) -> Self {
        let declared = &least_squares.declared;
        ResistanceKalman {
            settings,
            mean_weight: mean_student_weight(settings.student_freedom),
            train_length_m: train.length_m,
            filter: filter_at(declared),
            last: None,
            last_time_ns: None,
            noise: least_squares.bank.likeliest_noise(),
            force_rate: 0.0,
            moved_mps: 0.0,
            consecutive_outliers: 0,
            monitor: InnovationMonitor::new(MONITOR_SAMPLES),
            report: least_squares.report,
            resets: 0,
            least_squares,
        }
    }

    /// Starts a motion segment at a sample: the speed anew, the disturbance as far as it
    /// lasts.
    fn start(&mut self, now: &UnitSample) {
        let variance = self.least_squares.source.noise().variance_of_sample(0.0);
        self.filter.replace(SPEED, now.speed_mps, variance);
        let gap_s = self
            .last_time_ns
            .map(|last_ns| now.time_ns.saturating_sub(last_ns) as f64 * 1e-9)
            .filter(|&gap_s| gap_s > 0.0);
        self.decay(gap_s.unwrap_or(f64::INFINITY));
        self.monitor.break_here();
        self.last = Some(*now);
        self.consecutive_outliers = 0;
    }

    /// The disturbance after a time without a sight of it.
    fn decay(&mut self, duration_s: f64) {
        let Disturbance { std_n_per_kn, time_s } = self.noise.disturbance;
        let kept = (-duration_s / time_s).exp();
        let renewed = std_n_per_kn.powi(2) * (1.0 - kept * kept);
        self.filter.fade(DISTURBANCE, kept, renewed);
    }

    /// The speed by the forces over a step, by Heun's rule, and the states' noise.
    fn propagate(&mut self, before: &UnitSample, now: &UnitSample) {
        let step_s = now.seconds_since(before);
        let inertia = now.inertia;
        let state = self.filter.mean;
        let unknown = |index: usize| state[FIRST_UNKNOWN + index];
        let traction = 0.5 * step_s * (before.traction + now.traction);
        let brake = 0.5 * step_s * (before.brake + now.brake);
        let change = (now.traction - now.brake) - (before.traction - before.brake);
        let impulse = 0.5 * step_s * (before.driving + now.driving)
            + unknown(TRACTION_SCALE) * traction
            - unknown(BRAKE_SCALE) * brake
            - unknown(FORCE_DELAY) * change;
        let resistance = |powers: &[f64; PARAMETERS]| -> f64 {
            (0..PARAMETERS).map(|i| powers[i] * unknown(i)).sum()
        };
        let at_start = regressors(state[SPEED]);
        let lost = |w0: f64| (impulse - step_s * (w0 + state[DISTURBANCE])) / inertia;
        let end_mps = state[SPEED] + lost(resistance(&at_start));
        let at_end = regressors(end_mps);
        let mean: [f64; PARAMETERS] = std::array::from_fn(|i| 0.5 * (at_start[i] + at_end[i]));

        let mut gradient = State::zeros();
        let slope = (resistance(&at_end) - resistance(&at_start)) / (end_mps - state[SPEED]);
        let slope = if slope.is_finite() { slope } else { 0.0 };
        gradient[SPEED] = 1.0 - step_s * slope / inertia;
        gradient[DISTURBANCE] = -step_s / inertia;
        for i in 0..PARAMETERS {
            gradient[FIRST_UNKNOWN + i] = -step_s * mean[i] / inertia;
        }
        gradient[FIRST_UNKNOWN + TRACTION_SCALE] = traction / inertia;
        gradient[FIRST_UNKNOWN + BRAKE_SCALE] = -brake / inertia;
        gradient[FIRST_UNKNOWN + FORCE_DELAY] = -change / inertia;
        let speed_mps = state[SPEED] + lost(resistance(&mean));
        self.moved_mps = speed_mps - state[SPEED];
        let variance = self.impulse_variance(before, now, change) / (inertia * inertia);
        self.filter.rewrite(SPEED, speed_mps, &gradient, variance);

        self.decay(step_s);
        let drift = self.settings.drift_n_per_kn_per_sqrt_h.powi(2) * step_s / 3600.0;
        for i in 0..PARAMETERS {
            self.filter.disturb(FIRST_UNKNOWN + i, drift);
        }
    }

    /// Returns the variance of the impulse because the moments and places at which the forces acted are uncertain.
    fn impulse_variance(&self, before: &UnitSample, now: &UnitSample, change: f64) -> f64 {
        let data = &self.settings.data;
        let step_s = now.seconds_since(before);
        let speed_mps = now.speed_mps.max(data.speed_min_mps);
        let place_s = data.position_std_m / speed_mps;
        let bend = now.known - before.known;
        // A change of gradient or curve passes under the train in many steps, all early or all late.
        let steps = (self.train_length_m / (speed_mps * step_s)).max(1.0);
        self.noise.scale * (jump_variance(change, step_s) + steps * (place_s * bend).powi(2))
    }

    /// Takes a speed into the filter, weighed by Student's t; false when it is sound for
    /// nothing.
    fn correct(&mut self, before: &UnitSample, now: &UnitSample) -> bool {
        let white = self.least_squares.source.noise().variance_of_sample(self.moved_mps.abs());
        let variance = white + self.transient_variance(before, now);
        let Ok(innovation) = self.filter.innovation(SPEED, now.speed_mps, variance) else {
            return false;
        };
        let freedom = self.settings.student_freedom;
        let square = innovation.normalised_square();
        let weight = student_weight(square, freedom);
        let relative = weight / self.mean_weight;
        let corrected = self.filter.measure(SPEED, now.speed_mps, variance / relative);
        if self.least_squares.is_warm() {
            self.monitor.push((square * weight).sqrt().copysign(innovation.value));
        }
        let side = if innovation.value > 0.0 { 1 } else { -1 };
        self.consecutive_outliers = match square > OUTLIER_BEYOND * OUTLIER_BEYOND {
            true if self.consecutive_outliers * side > 0 => self.consecutive_outliers + side,
            true => side,
            false => 0,
        };
        corrected.is_ok()
    }

    /// Starts anew at a sample from the estimate of the least squares in parallel: with weights by Student's t, a
    /// filter far from the speeds would never come back to them.
    fn recover(&mut self, now: &UnitSample) {
        self.consecutive_outliers = 0;
        let known =
            self.least_squares.bank.likeliest_solution().filter(|_| self.least_squares.is_warm());
        let disturbance = *self.filter.mean.fixed_rows::<1>(DISTURBANCE).as_scalar();
        let variance = self.filter.covariance[(DISTURBANCE, DISTURBANCE)];
        self.filter = filter_at(known.as_ref().unwrap_or(&self.least_squares.declared));
        self.filter.replace(DISTURBANCE, disturbance, variance);
        self.start(now);
        self.resets += 1;
    }

    /// Returns the variance of the speed in (m/s)² while a force that acts later by d changes: its impulse
    /// is taken as d times the change at once, and is off by half d² times the rate until then.
    fn transient_variance(&mut self, before: &UnitSample, now: &UnitSample) -> f64 {
        let step_s = now.seconds_since(before);
        let change = (now.traction - now.brake) - (before.traction - before.brake);
        let faded = self.force_rate * (-step_s / FORCE_RATE_MEMORY_S).exp();
        self.force_rate = faded.max((change / step_s).abs());
        let index = FIRST_UNKNOWN + FORCE_DELAY;
        let delay = self.filter.mean[index];
        let delay_square = delay * delay + self.filter.covariance[(index, index)];
        (0.5 * delay_square * self.force_rate / now.inertia).powi(2)
    }

    fn judge(&mut self) {
        let noise = self.least_squares.bank.likeliest_noise();
        let is_other_model = noise.index != self.noise.index;
        self.noise = noise;
        // While rows are few, the filter's own tangent may lie far from the truth.
        if (is_other_model || !self.least_squares.is_warm())
            && let Some(solution) = self.least_squares.bank.likeliest_solution()
        {
            self.take_over(&solution);
        }
        let Some(solution) = self.least_squares.bank.widened(&self.solution()) else { return };
        if let Some(report) =
            self.least_squares.judged(&solution, &self.monitor, self.disturbance())
        {
            self.report = report;
        } else {
            self.reset();
        }
    }

    /// Goes on with another solution, and with the speed and the disturbance that belong to it; where the least squares
    /// do not know these, they keep their relation to the unknowns.
    fn take_over(&mut self, solution: &RegressionSolution) {
        let Some(motion) = self.least_squares.motion().or_else(|| self.own_motion()) else {
            self.reset();
            return;
        };
        let moving = motion.at_zero + motion.gain * solution.estimate;
        let crossed = motion.gain * solution.covariance;
        let mean = State::from_fn(|i, _| match i.checked_sub(FIRST_UNKNOWN) {
            Some(unknown) => solution.estimate[unknown],
            None => moving[i],
        });
        let mut joint = SMatrix::<f64, STATES, STATES>::zeros();
        joint
            .fixed_view_mut::<FIRST_UNKNOWN, FIRST_UNKNOWN>(0, 0)
            .copy_from(&(motion.covariance + crossed * motion.gain.transpose()));
        joint.fixed_view_mut::<FIRST_UNKNOWN, UNKNOWNS>(0, FIRST_UNKNOWN).copy_from(&crossed);
        joint
            .fixed_view_mut::<UNKNOWNS, FIRST_UNKNOWN>(FIRST_UNKNOWN, 0)
            .copy_from(&crossed.transpose());
        joint
            .fixed_view_mut::<UNKNOWNS, UNKNOWNS>(FIRST_UNKNOWN, FIRST_UNKNOWN)
            .copy_from(&solution.covariance);
        self.filter = Gaussian { mean, covariance: joint };
    }

    /// Returns the speed and disturbance for given unknowns, as this filter knows them.
    fn own_motion(&self) -> Option<AffineMotion> {
        let (mean, covariance) = (&self.filter.mean, &self.filter.covariance);
        let tie = covariance.fixed_view::<UNKNOWNS, FIRST_UNKNOWN>(FIRST_UNKNOWN, 0).into_owned();
        let unknowns = covariance.fixed_view::<UNKNOWNS, UNKNOWNS>(FIRST_UNKNOWN, FIRST_UNKNOWN);
        let gain = unknowns.into_owned().cholesky()?.solve(&tie).transpose();
        let estimate = mean.fixed_rows::<UNKNOWNS>(FIRST_UNKNOWN);
        Some(AffineMotion {
            at_zero: mean.fixed_rows::<FIRST_UNKNOWN>(0) - gain * estimate,
            gain,
            covariance: covariance.fixed_view::<FIRST_UNKNOWN, FIRST_UNKNOWN>(0, 0) - gain * tie,
        })
    }

    /// Returns the disturbance now with its standard deviation, in N/kN.
    fn disturbance(&self) -> (f64, f64) {
        let variance = self.filter.covariance[(DISTURBANCE, DISTURBANCE)];
        (self.filter.mean[DISTURBANCE], variance.max(0.0).sqrt())
    }

    fn solution(&self) -> RegressionSolution {
        RegressionSolution {
            estimate: self.filter.mean.fixed_rows::<UNKNOWNS>(FIRST_UNKNOWN).into_owned(),
            covariance: self
                .filter
                .covariance
                .fixed_view::<UNKNOWNS, UNKNOWNS>(FIRST_UNKNOWN, FIRST_UNKNOWN)
                .into_owned(),
        }
    }

    /// Starts anew after a numerical failure.
    fn reset(&mut self) {
        self.filter = filter_at(&self.least_squares.declared);
        self.last = None;
        self.resets += 1;
    }
}

fn filter_at(solution: &RegressionSolution) -> Gaussian<STATES> {
    let mut mean = State::zeros();
    let mut covariance = SMatrix::<f64, STATES, STATES>::identity();
    mean.fixed_rows_mut::<UNKNOWNS>(FIRST_UNKNOWN).copy_from(&solution.estimate);
    covariance
        .fixed_view_mut::<UNKNOWNS, UNKNOWNS>(FIRST_UNKNOWN, FIRST_UNKNOWN)
        .copy_from(&solution.covariance);
    Gaussian { mean, covariance }
}

/// Returns the weight of an observation by the square of its normalised innovation.
fn student_weight(square: f64, freedom: f64) -> f64 {
    ((freedom + 1.0) / (freedom + square)).min(1.0)
}

/// Returns the mean of the weight over standard normal innovations, by the midpoint rule.
fn mean_student_weight(freedom: f64) -> f64 {
    const STEPS: usize = 400;
    const STEP: f64 = 8.0 / STEPS as f64;
    let (mut sum, mut total) = (0.0, 0.0);
    for index in 0..STEPS {
        let square = (STEP * (index as f64 + 0.5)).powi(2);
        let density = (-0.5 * square).exp();
        sum += density * student_weight(square, freedom);
        total += density;
    }
    sum / total
}

impl Estimator for ResistanceKalman {
    fn kind(&self) -> PipelineKind {
        PipelineKind::ResistanceKalman
    }

    fn update(&mut self, sample: &ResolvedSample) -> Outcome {
        let outcome = self.least_squares.update(sample);
        let now = match (outcome, UnitSample::from_sample(sample)) {
            (Outcome::Rejected(RejectionReason::Outlier), Ok(now)) => {
                // A single spike is left out; after a row that does not fit, the speed is anew.
                if self.least_squares.has_refused_row() {
                    self.start(&now);
                }
                if let Some(jump_n_per_kn) = self.least_squares.jump_n_per_kn {
                    self.filter.disturb(DISTURBANCE, jump_n_per_kn.powi(2));
                }
                return outcome;
            }
            (_, Ok(now)) if now.speed_mps >= self.settings.data.speed_min_mps => now,
            _ => {
                self.last = None;
                return outcome;
            }
        };
        match self.last.filter(|last| last.segment == now.segment) {
            Some(before) => {
                self.propagate(&before, &now);
                if !self.correct(&before, &now) {
                    self.reset();
                } else if self.consecutive_outliers.abs() >= CONSECUTIVE_OUTLIERS_MAX {
                    self.recover(&now);
                } else {
                    self.last = Some(now);
                }
            }
            None => self.start(&now),
        }
        self.last_time_ns = Some(now.time_ns);
        if outcome == Outcome::Updated {
            self.judge();
        }
        // Every sample corrects the filter.
        if outcome == Outcome::Used { Outcome::Updated } else { outcome }
    }

    fn write(&self, _input: &InputState, snapshot: &mut ParameterSnapshot) -> Judgement {
        let judgement = self.least_squares.write_with(&self.report, &self.monitor, snapshot);
        snapshot.generation += self.resets;
        let forces_n =
            <[f64; 2]>::from(self.disturbance()).map(|it| it * self.least_squares.weight_kn);
        [snapshot.unexplained_force_n, snapshot.unexplained_force_std_n] = forces_n;
        judgement
    }

    fn warm_start(&mut self, kept: &KeptEstimate) -> bool {
        let is_taken = self.least_squares.warm_start(kept);
        self.filter = filter_at(&self.least_squares.declared);
        self.report = self.least_squares.report;
        is_taken
    }
}
