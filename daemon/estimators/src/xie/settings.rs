//! Settings of sliding-window EM.

use dynocar_core::pipeline::Estimator;
use dynocar_core::pipeline::braking::intake::BrakingCoefficient;
use dynocar_core::pipeline::braking::motion::MotionNoise;
use dynocar_core::pipeline::braking::settings::{BrakeFactor, BrakingSettings};
use dynocar_core::pipeline::settings::{SettingError, require};
use dynocar_core::settings;
use dynocar_model::train::TrainModel;
use dynocar_shared::PipelineKind;
use serde::Deserialize;

use super::expectation::{KalmanExpectation, ParticleExpectation};
use super::sliding::{EmModel, EmWindow};

/// How the expectation of the EM is taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EStep {
    /// Particle filter and smoother, as in the papers.
    #[default]
    Particle,
    /// Kalman filter and Rauch-Tung-Striebel smoother: exact for the Gaussian model.
    Kalman,
}

settings! {
    /// Settings of sliding-window EM.
    #[derive(Copy)]
    EmSettings {
        /// Motion, measurement and braking; speeds are used only to start with.
        braking: BrakingSettings = BrakingSettings::default();
        /// Particles, of the particle E-step.
        particles: usize = 20 => (2 or more);
        /// Most iterations in a window.
        iterations: usize = 50 => (1 or more);
        /// Observations in a window (S).
        window: usize = 40 => (3 or more);
        /// Observations by which the window slides (L).
        slide: usize = 5;
        /// Iterations end when the coefficient changes by less, as a share of the demand.
        tolerance: f64 = 1e-7 => (0 or more);
        /// The coefficient before the first window; when absent the declared one, and for adhesion
        /// what the brake would need.
        initial: Option<f64> = None => (0 or more);
        /// Seed of the particles.
        seed: u64 = 1;
        /// How the expectation is taken.
        e_step: EStep = EStep::Particle;
        /// True for the papers' cap on the coefficient, under which values above the demand stick.
        has_printed_cap: bool = false;
        /// What a brake pipeline reports; no meaning for adhesion.
        reports: BrakeFactor = BrakeFactor::Friction;
    }
}

impl EmSettings {
    fn check(&self) -> Result<(), SettingError> {
        self.braking.check()?;
        self.check_ranges()?;
        let slides = self.slide >= 1 && self.slide < self.window;
        require(slides, "slide", self.slide as f64, "at least 1 and below window")
    }

    /// Builds an estimator of a kind.
    ///
    /// # Errors
    ///
    /// When a setting lies outside its range.
    pub fn build(
        &self,
        kind: PipelineKind,
        quantity: BrakingCoefficient,
        train: &TrainModel,
    ) -> Result<Box<dyn Estimator>, SettingError> {
        self.check()?;
        let model = EmModel {
            noise: MotionNoise { measured_speed_m2_per_s2: None, ..self.braking.noise() },
            window_steps: self.window,
            slide_steps: self.slide,
            iterations: self.iterations,
            tolerance: self.tolerance,
            initial: self.initial,
            initial_speed_std_mps: self.braking.first_speed_std_mps,
            has_printed_cap: self.has_printed_cap,
        };
        Ok(match self.e_step {
            EStep::Particle => {
                let particles = ParticleExpectation::new(self.particles, self.window, self.seed);
                self.braking.estimator(kind, quantity, train, EmWindow::new(model, particles))
            }
            EStep::Kalman => {
                let kalman = KalmanExpectation::new(self.window);
                self.braking.estimator(kind, quantity, train, EmWindow::new(model, kalman))
            }
        })
    }
}
