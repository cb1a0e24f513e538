//! Kalman filter of distance, speed and scale, with a fixed-lag smoother of the scale.
//!
//! With a random walk of the scale it is the extended Kalman filter that both papers compare
//! with; with an integrated random walk and a lag it is our smoother.

use dynocar_shared::Uncertain;
use nalgebra::{SMatrix, SVector};

use super::engine::{BrakingEstimate, BrakingObservation, BrakingSettings, Engine, EngineStep};
use super::law::BrakingLaw;
use super::motion::{self, DISTANCE, MotionNoise, SCALE, SPEED, STATES, StepInputs, Walk};
use crate::filter::fixed_lag::FixedLagSmoother;
use crate::filter::{Gaussian, NotPositiveDefinite};
use crate::pipeline::motion::OutlierRow;

/// Prior of the scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PriorScale {
    /// The scale itself.
    OfLaw(Uncertain),
    /// The coefficient, law times scale, at the first observation.
    OfCoefficient(Uncertain),
}

/// A model of the motion with everything but the state.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackerModel {
    /// Shape of the coefficient.
    pub law: BrakingLaw,
    /// Noise of motion and measurement.
    pub noise: MotionNoise,
    /// How the scale wanders.
    pub walk: Walk,
    /// Standard deviation of the first speed in m/s.
    pub first_speed_std_mps: f64,
    /// Belief about the scale before the first observation.
    pub prior: PriorScale,
}

impl TrackerModel {
    /// Returns the model of a law with the noise of the settings.
    pub fn new(settings: &BrakingSettings, law: BrakingLaw, walk: Walk, prior: PriorScale) -> Self {
        let first_speed_std_mps = settings.first_speed_std_mps;
        TrackerModel { law, noise: settings.noise(), walk, first_speed_std_mps, prior }
    }

    /// Returns the belief about the scale beforehand, at a speed in m/s and a demand.
    pub fn prior_scale(&self, speed_mps: f64, demand: f64) -> Uncertain {
        match self.prior {
            PriorScale::OfLaw(scale) => scale,
            PriorScale::OfCoefficient(coefficient) => {
                let (shape, _) = self.law.at(speed_mps, demand);
                Uncertain::new(coefficient.value / shape, coefficient.std / shape)
            }
        }
    }

    /// Returns the belief after a first observation.
    pub fn initial(&self, first: &BrakingObservation) -> Gaussian<STATES> {
        let scale = self.prior_scale(first.speed_mps, first.demand);
        Gaussian::independent(
            SVector::from([first.distance_m, first.speed_mps, scale.value, 0.0]),
            SVector::from([
                self.noise.measured_distance_m2.sqrt(),
                self.first_speed_std_mps,
                scale.std,
                self.walk.drift_std_per_s(),
            ]),
        )
    }

    /// Moves a belief over one step; gives the Jacobian of the move.
    #[inline]
    pub fn advance(
        &self,
        inputs: &StepInputs,
        state: &mut Gaussian<STATES>,
    ) -> SMatrix<f64, STATES, STATES> {
        let (mean, jacobian) = motion::predict(inputs, &self.law, self.walk, &state.mean);
        let added = motion::process_noise(&self.noise, self.walk, inputs.step_s);
        state.mean = mean;
        state.covariance = motion::move_covariance(&jacobian, &state.covariance, &added);
        jacobian
    }

    /// Returns the measured components with their values and noise variances, in order.
    pub fn measurements(&self, observed: &BrakingObservation) -> [Option<(usize, f64, f64)>; 2] {
        let distance = (DISTANCE, observed.distance_m, self.noise.measured_distance_m2);
        let speed = self
            .noise
            .measured_speed_m2_per_s2
            .filter(|_| observed.is_speed_valid)
            .map(|variance| (SPEED, observed.speed_mps, variance));
        [Some(distance), speed]
    }

    /// Returns the estimate that a belief about the state implies.
    pub fn estimate(&self, state: &Gaussian<STATES>, demand: f64) -> BrakingEstimate {
        let (shape, shape_slope) = self.law.at(state.mean[SPEED], demand);
        let scale = state.mean[SCALE];
        let mut row = SVector::<f64, STATES>::zeros();
        (row[SPEED], row[SCALE]) = (shape_slope * scale, shape);
        let cross = state.covariance * row;
        BrakingEstimate {
            coefficient: Uncertain::new(shape * scale, row.dot(&cross).max(0.0).sqrt()),
            scale: Uncertain::new(scale, state.std(SCALE)),
            covariance: cross[SCALE],
            demand,
            brake_limited: None,
        }
    }
}

/// State at a remembered moment.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Moment {
    /// Time in s since the start.
    time_s: f64,
    shape: f64,
    demand: f64,
}

/// An innovation beyond this many standard deviations is refused.
const OUTLIER_GATE: f64 = 5.0;
/// Forgetting factors of the mean innovations that show a change: one for a sudden one, one
/// for a small one.
const CHANGE_FORGETTING: [f64; 2] = [0.8, 0.95];
/// A mean innovation beyond this many of its standard deviations is a change.
const CHANGE_GATE: f64 = 5.0;

/// Forgotten means of white numbers of unit variance, scaled to unit variance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct ChangeDetector {
    means: [f64; 2],
}

impl ChangeDetector {
    /// Takes in a normalised innovation; true when the innovations no longer have mean zero.
    fn push(&mut self, normalised: f64) -> bool {
        for (mean, forgetting) in self.means.iter_mut().zip(CHANGE_FORGETTING) {
            *mean = forgetting * *mean + (1.0 - forgetting * forgetting).sqrt() * normalised;
        }
        self.means.iter().any(|mean| mean.abs() > CHANGE_GATE)
    }
}

/// Tracks the scale of one law.
#[derive(Clone, Debug)]
pub struct Tracker {
    model: TrackerModel,
    state: Option<Gaussian<STATES>>,
    smoother: FixedLagSmoother<STATES, Moment>,
    /// True when sudden changes restart the tracker.
    detects_changes: bool,
    lag_s: f64,
    /// Time in s since the start.
    time_s: f64,
    outliers: OutlierRow,
    /// One for each measured quantity.
    changes: [ChangeDetector; 2],
}

impl Tracker {
    /// Returns a tracker whose estimate lies `lag_s` back, with room for `lag_moments` observations in
    /// that time.
    pub fn new(model: TrackerModel, lag_s: f64, lag_moments: usize, detects_changes: bool) -> Self {
        Tracker {
            model,
            state: None,
            smoother: FixedLagSmoother::new(lag_moments + 1),
            detects_changes,
            lag_s,
            time_s: 0.0,
            outliers: OutlierRow::default(),
            changes: Default::default(),
        }
    }

    /// Returns the state after the last observation; `None` before the first.
    pub fn state(&self) -> Option<&Gaussian<STATES>> {
        self.state.as_ref()
    }

    fn remember(&mut self, demand: f64) {
        if let Some(state) = &self.state {
            let (shape, _) = self.model.law.at(state.mean[SPEED], demand);
            self.smoother.remember(state, SCALE, Moment { time_s: self.time_s, shape, demand });
        }
    }

    /// Starts anew from here, with the belief about the speed kept but opened.
    fn restart(&mut self, observed: &BrakingObservation) {
        let speed_mps = match self.state {
            Some(state) if !observed.is_speed_valid => state.mean[SPEED],
            _ => observed.speed_mps,
        };
        self.smoother.freeze();
        self.state = Some(self.model.initial(&BrakingObservation { speed_mps, ..*observed }));
        self.outliers = OutlierRow::default();
        self.changes = Default::default();
        self.remember(observed.demand);
    }
}

impl Engine for Tracker {
    fn start(&mut self, first: &BrakingObservation) {
        self.smoother.clear();
        self.state = None;
        self.time_s = 0.0;
        self.restart(first);
    }

    fn step(&mut self, inputs: &StepInputs, observed: &BrakingObservation) -> Option<EngineStep> {
        let Some(state) = &mut self.state else {
            self.start(observed);
            return Some(EngineStep::Restarted);
        };
        self.time_s += inputs.step_s;
        let jacobian = self.model.advance(inputs, state);
        // Without a lag the only moment is the newest, which is remembered anew after each step.
        let has_lag = self.lag_s > 0.0;
        if has_lag {
            self.smoother.predict(&jacobian);
        }
        let mut first_innovation = None;
        let mut is_change = false;
        let measurements = self.model.measurements(observed).into_iter();
        for (measurement, changes) in measurements.zip(&mut self.changes) {
            let Some((component, measured, variance)) = measurement else { continue };
            let innovation = state.innovation(component, measured, variance).ok()?;
            let normalised = innovation.normalised();
            let is_outlier = normalised.abs() > OUTLIER_GATE;
            if is_outlier && first_innovation.is_some() {
                // A speed that the position contradicts is left out on its own.
                continue;
            }
            if is_outlier {
                if self.outliers.push(true) {
                    self.restart(observed);
                    return Some(EngineStep::Restarted);
                }
                return Some(EngineStep::Outlier);
            }
            let gain = state.take(component, &innovation, variance);
            if has_lag {
                self.smoother.take(component, &innovation, &gain);
            }
            is_change |= changes.push(normalised);
            first_innovation.get_or_insert(normalised);
        }
        self.outliers.push(false);
        if !state.mean[SCALE].is_finite() {
            return None;
        }
        if is_change && self.detects_changes {
            self.restart(observed);
            return Some(EngineStep::Restarted);
        }
        self.remember(observed.demand);
        Some(EngineStep::Updated { normalised_innovation: first_innovation })
    }

    fn set_distance_variance(&mut self, variance_m2: f64) {
        self.model.noise.measured_distance_m2 = variance_m2;
    }

    fn lag_s(&self) -> f64 {
        self.lag_s
    }

    fn estimate(&self) -> Option<BrakingEstimate> {
        // Half a millisecond of tolerance for the rounding of summed steps.
        let until_s = self.time_s - self.lag_s + 5e-4;
        let lagged = self
            .smoother
            .newest_first()
            .find(|moment| moment.tag.time_s <= until_s)
            .or_else(|| self.smoother.oldest())?;
        let Moment { shape, demand, .. } = lagged.tag;
        let std = lagged.variance.max(0.0).sqrt();
        Some(BrakingEstimate {
            coefficient: Uncertain::new(shape * lagged.mean, shape.abs() * std),
            scale: Uncertain::new(lagged.mean, std),
            covariance: shape * lagged.variance.max(0.0),
            demand,
            brake_limited: None,
        })
    }
}

/// Log-likelihood of an observation under a belief, applying it.
///
/// # Errors
///
/// When belief or measurement are not sound.
pub fn measure(
    model: &TrackerModel,
    state: &mut Gaussian<STATES>,
    observed: &BrakingObservation,
) -> Result<(f64, f64), NotPositiveDefinite> {
    let (mut log_likelihood, mut first_normalised) = (0.0, None);
    for (component, measured, variance) in model.measurements(observed).into_iter().flatten() {
        let innovation = state.measure(component, measured, variance)?;
        log_likelihood += innovation.log_likelihood();
        first_normalised.get_or_insert(innovation.normalised());
    }
    Ok((log_likelihood, first_normalised.unwrap_or(0.0)))
}
