//! The online filter of `trajectory_kalman`, apart from samples and snapshots.

use dynocar_model::train::Davis;
use nalgebra::{Matrix3, Vector3};

use super::bank::{JumpBank, JumpModel, StepDoubt};
use super::hypothesis::{Hypothesis, Innovation, OutlierModel};
use super::long_run::LongRunVariance;
use super::noise::{LearnedNoise, NoiseModel};
use super::step::{Step, StepRule};

/// How the online filter starts and what it expects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OnlineSettings {
    /// Coefficients before any data.
    pub davis: Davis,
    /// Their standard deviations.
    pub davis_std: Vector3<f64>,
    /// Jumps of the coefficients.
    pub jumps: JumpModel,
    /// The most hypotheses about the last jump.
    pub hypotheses: usize,
    /// Noise of the measured speed and of the forces.
    pub noise: NoiseModel,
}

impl OnlineSettings {
    fn first(&self, davis: &Davis) -> Hypothesis {
        Hypothesis::new(davis, &self.davis_std, LearnedNoise::new(&self.noise))
    }

    fn bank_of(&self, first: Hypothesis) -> JumpBank {
        JumpBank::new(first, self.hypotheses, self.jumps, self.noise, OUTLIERS)
    }
}

/// Outliers: one sample in a hundred, anywhere within ±1 m/s of the prediction.
pub const OUTLIERS: OutlierModel = OutlierModel { share: 0.01, density: 0.5 };

/// Blocks of 30 s that the long-run variance of the innovations looks back over.
const LONG_RUN_BLOCKS: f64 = 60.0;

/// Kalman filters of [a, b, c, v] with jump hypotheses.
#[derive(Clone, Debug, PartialEq)]
pub struct OnlineFilter {
    settings: OnlineSettings,
    bank: JumpBank,
    long_run: LongRunVariance,
    resets: u64,
}

impl OnlineFilter {
    /// A filter that knows no speed yet.
    pub fn new(settings: OnlineSettings) -> Self {
        OnlineFilter {
            settings,
            bank: settings.bank_of(settings.first(&settings.davis)),
            long_run: LongRunVariance::new(LONG_RUN_BLOCKS),
            resets: 0,
        }
    }

    /// Takes coefficients with a full covariance as its start, before the first step; false when
    /// the covariance cannot be factored. A reset goes back to the settings.
    pub fn warm_start(&mut self, davis: &Davis, covariance: &Matrix3<f64>) -> bool {
        let Some(factor) = covariance.cholesky() else { return false };
        let mut first = self.settings.first(davis);
        first.factor.0.fixed_view_mut::<3, 3>(0, 0).copy_from(&factor.unpack());
        self.bank = self.settings.bank_of(first);
        true
    }

    /// Takes a speed as the start of a trajectory; the coefficients keep what they know.
    pub fn begin(&mut self, measured_mps: f64) {
        self.bank.anchor(measured_mps);
        self.long_run.break_here();
    }

    /// Says how far the next step can be believed; none is doubted unless this is called.
    pub fn doubt(&mut self, doubt: StepDoubt) {
        self.bank.doubt(doubt);
    }

    /// Takes in a step and the speed measured after it; `None` after a reset for numerical
    /// failure.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn advance(
        &mut self,
        rule: StepRule,
        step: &Step,
        duration_s: f64,
        measured_mps: f64,
    ) -> Option<Innovation> {
        let Some(innovation) = self.bank.advance(rule, step, duration_s, measured_mps) else {
            self.bank = self.settings.bank_of(self.settings.first(&self.settings.davis));
            self.resets += 1;
            self.begin(measured_mps);
            return None;
        };
        if innovation.is_used {
            let normalised = innovation.innovation_mps / innovation.deviation_mps;
            self.long_run.push(normalised, duration_s);
        }
        Some(innovation)
    }

    /// Mean and covariance of the coefficients, widened for disturbances that last.
    pub fn davis(&self) -> (Davis, Matrix3<f64>) {
        let (davis, covariance) = self.bank.davis();
        (davis, covariance * self.long_run.inflation())
    }

    /// Factor on the covariance for disturbances that last; 1 when innovations are white.
    pub fn inflation(&self) -> f64 {
        self.long_run.inflation()
    }

    /// The hypotheses.
    pub fn bank(&self) -> &JumpBank {
        &self.bank
    }

    /// Resets for numerical failure so far.
    pub fn resets(&self) -> u64 {
        self.resets
    }
}
