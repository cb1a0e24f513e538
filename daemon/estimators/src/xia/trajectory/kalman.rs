//! `trajectory_kalman`: Davis coefficients sample by sample, on any train.

use std::sync::Arc;

use dynocar_core::pipeline::judge::{InputState, Judgement};
use dynocar_core::pipeline::motion::{Rounding, SpeedRange, jump_variance};
use dynocar_core::pipeline::output::{DAVIS, write_parameters};
use dynocar_core::pipeline::settings::SettingError;
use dynocar_core::pipeline::{Estimator, InnovationMonitor, KeptEstimate, Outcome};
use dynocar_core::settings;
use dynocar_model::force::{ResolvedSample, mps2_per_n_per_kn};
use dynocar_model::train::{Davis, TrainModel};
use dynocar_shared::{ParameterSnapshot, PipelineKind, Reason, RejectionReason, Status};
use nalgebra::Vector3;

use super::hypothesis::SpeedInnovation;
use super::motion::{MotionStep, MotionTracker, MotionUpdate, UnexplainedForce};
use super::noise::NoiseModel;
use super::online::{OnlineFilter, OnlineSettings, StepDoubt};
use super::quality::{DavisEstimate, prior_std};
use super::step::{StepRule, TrajectoryStep};

settings! {
    /// Settings of `trajectory_kalman`.
    #[derive(Copy)]
    TrajectoryKalmanSettings {
        /// Standard deviations of the declared coefficients, as a share of each.
        prior_relative_std: f64 = 0.5 => (above 0);
        /// Evidence in nats that it takes to accept a jump of the coefficients (rain, wind, a
        /// change of the train) within a given second. Disturbances that last, as no noise model
        /// here has them, look like jumps: less evidence is quicker and more often wrong.
        jump_evidence: f64 = 16.0 => (1 to 1000 "nats");
        /// The most hypotheses about the last jump; 1 looks for no jumps.
        hypotheses: u32 = 8 => (1 to 16);
        /// Standard deviation of the measured speed in m/s; learned when absent.
        speed_noise_mps: Option<f64> = None => (above 0);
        /// Root of the density of disturbing forces in N/kN √s; learned when absent.
        disturbance_n_per_kn_sqrt_s: Option<f64> = None => (0 or more);
        /// Samples that the learned noise looks back over.
        noise_memory: u32 = 2000 => (50 or more);
    }
}

/// Lowest and highest speed noise that is learned, in m/s.
const SPEED_NOISE_RANGE_MPS: (f64, f64) = (1e-3, 1.0);
/// Speed noise before any data, in m/s.
const SPEED_NOISE_FIRST_MPS: f64 = 0.2;
/// Lowest and highest disturbance that is learned, in N/kN √s.
const DISTURBANCE_RANGE: (f64, f64) = (0.01, 10.0);
/// Disturbance before any data, in N/kN √s.
const DISTURBANCE_FIRST: f64 = 1.0;

impl TrajectoryKalmanSettings {
    /// Builds the estimator for a train.
    ///
    /// # Errors
    ///
    /// When a setting lies outside its range.
    pub fn build(&self, train: &Arc<TrainModel>) -> Result<TrajectoryKalman, SettingError> {
        self.check_ranges()?;
        let speed_noise_mps = self.speed_noise_mps.unwrap_or(SPEED_NOISE_FIRST_MPS);
        let disturbance = self.disturbance_n_per_kn_sqrt_s.unwrap_or(DISTURBANCE_FIRST);
        let gain = mps2_per_n_per_kn(train.rotating_mass_factor);
        Ok(TrajectoryKalman::new(OnlineSettings {
            davis: train.resistance,
            davis_std: prior_std(train, self.prior_relative_std),
            jump_evidence: self.jump_evidence,
            hypotheses: self.hypotheses as usize,
            noise: NoiseModel {
                speed_noise_mps,
                speed_noise_range_mps: SPEED_NOISE_RANGE_MPS,
                disturbance: gain * disturbance,
                disturbance_range: (gain * DISTURBANCE_RANGE.0, gain * DISTURBANCE_RANGE.1),
                memory: f64::from(self.noise_memory),
                learns_speed_noise: self.speed_noise_mps.is_none(),
                learns_disturbance: self.disturbance_n_per_kn_sqrt_s.is_none(),
            },
        }))
    }
}

/// Kalman filters of [a, b, c, v] with jump hypotheses over the samples of a train.
///
/// Samples are stepped over in time, one step for each sample, so that none waits for a
/// distance to pass and no force is averaged away.
#[derive(Clone, Debug)]
pub struct TrajectoryKalman {
    tracker: MotionTracker,
    rounding: Rounding,
    filter: OnlineFilter,
    prior_std: Vector3<f64>,
    innovations: InnovationMonitor,
    unexplained: UnexplainedForce,
    speeds: SpeedRange,
    updates: u64,
    /// Why there is no estimate, when something else than the samples is to blame.
    fault: Option<(Status, Reason)>,
}

/// Time in s that a jump of the coefficients has to last before it is trusted: a force that stays
/// wrong for seconds looks like one.
const FRESH_S: f64 = 30.0;
/// Updates before the estimate is more than the declared values.
const UPDATES_MIN: u64 = 50;
/// Innovations that the published statistics look back over.
const INNOVATION_MEMORY: u32 = 500;

impl TrajectoryKalman {
    /// Returns an estimator from checked settings.
    pub fn new(settings: OnlineSettings) -> Self {
        TrajectoryKalman {
            tracker: MotionTracker::default(),
            rounding: Rounding::default(),
            filter: OnlineFilter::new(settings),
            prior_std: settings.davis_std,
            innovations: InnovationMonitor::new(INNOVATION_MEMORY),
            unexplained: UnexplainedForce::default(),
            speeds: SpeedRange::default(),
            updates: 0,
            fault: None,
        }
    }

    /// Returns the filter, for tests and offline work.
    pub fn filter(&self) -> &OnlineFilter {
        &self.filter
    }

    fn take_step(&mut self, motion: &MotionStep, sample: &ResolvedSample) -> Outcome {
        let step = TrajectoryStep::from(motion);
        let moved_mps = motion.distance_m / motion.duration_s - sample.speed_mps;
        let learned = self.filter.likeliest().noise.speed_variance;
        let doubt = StepDoubt {
            impulse_variance: jump_variance(motion.drive_change_mps2, motion.duration_s),
            rounding_variance: self.rounding.variance_of_sample(learned, 2.0 * moved_mps.abs()),
        };
        let step = (StepRule::Time, &step);
        let absorbed = self.filter.advance(step, motion.duration_s, sample.speed_mps, &doubt);
        let Some(innovation) = absorbed else {
            self.fault = Some((Status::Unestimated, Reason::NumericalFailure));
            self.updates = 0;
            return Outcome::Used;
        };
        self.fault = None;
        self.unexplained.push(motion, sample, &self.filter.likeliest().davis());
        let SpeedInnovation { innovation_mps, deviation_mps, is_used, .. } = innovation;
        if !is_used {
            self.innovations.break_here();
            return Outcome::Rejected(RejectionReason::Outlier);
        }
        self.innovations.push(innovation_mps / deviation_mps);
        self.speeds.push(sample.speed_mps);
        self.updates += 1;
        Outcome::Updated
    }
}

impl Estimator for TrajectoryKalman {
    fn kind(&self) -> PipelineKind {
        PipelineKind::TrajectoryKalman
    }

    fn is_gated(&self) -> bool {
        true
    }

    fn leave_out(&mut self) {
        self.tracker = MotionTracker::default();
    }

    fn update(&mut self, sample: &ResolvedSample) -> Outcome {
        self.rounding.see(sample.speed_mps);
        match self.tracker.advance(sample) {
            MotionUpdate::Continue(motion) => self.take_step(&motion, sample),
            MotionUpdate::Begin => {
                self.filter.begin(sample.speed_mps);
                self.unexplained.begin(sample.speed_mps);
                self.innovations.break_here();
                Outcome::Used
            }
            MotionUpdate::Standstill => Outcome::Used,
            MotionUpdate::Unusable(reason) => Outcome::Rejected(reason),
        }
    }

    fn write(&self, input: &InputState, snapshot: &mut ParameterSnapshot) -> Judgement {
        let (davis, covariance) = self.filter.davis();
        write_parameters(snapshot, DAVIS, &Vector3::new(davis.a, davis.b, davis.c), &covariance);
        let is_fresh = self.filter.likeliest().age_s < FRESH_S;
        let estimate = DavisEstimate {
            davis,
            covariance,
            prior_std: self.prior_std,
            speeds: self.speeds,
            innovations: &self.innovations,
            inflation: self.filter.inflation(),
            is_ready: self.updates >= UPDATES_MIN,
            is_at_bound: false,
            fault: self.fault,
            input: input.doubt,
            doubt: is_fresh.then_some(Reason::InnovationsTooLarge),
        };
        let judgement = estimate.write(snapshot);
        let speed_variance = self.filter.likeliest().noise.speed_variance;
        self.unexplained.write(snapshot, speed_variance);
        snapshot.generation = self.filter.resets;
        judgement
    }

    fn warm_start(&mut self, kept: &KeptEstimate) -> bool {
        kept.moments(DAVIS).is_some_and(|(mean, covariance)| {
            let davis = Davis { a: mean[0], b: mean[1], c: mean[2] };
            self.filter.warm_start(&davis, &covariance)
        })
    }
}
