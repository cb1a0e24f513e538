//! Settings of sliding-window EM.

use dynocar_shared::PipelineKind;
use serde::Deserialize;

use super::{BrakeFactor, BrakingSettings};
use crate::pipeline::Estimator;
use crate::pipeline::braking::em::{EmModel, EmWindow, KalmanExpectation, ParticleExpectation};
use crate::pipeline::braking::intake::Quantity;
use crate::pipeline::braking::motion::MotionNoise;
use crate::pipeline::settings::{SettingError, require};
use crate::train::TrainModel;

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

/// Settings of sliding-window EM.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EmSettings {
    /// Motion, measurement and braking; speeds are used only to start with.
    pub braking: BrakingSettings,
    /// Particles, of the particle E-step.
    pub particles: usize,
    /// Most iterations in a window.
    pub iterations: usize,
    /// Observations in a window (S).
    pub window: usize,
    /// Observations by which the window slides (L).
    pub slide: usize,
    /// Iterations end when the coefficient changes by less, as a share of the demand.
    pub tolerance: f64,
    /// The coefficient before the first window; when absent the declared one, and for adhesion
    /// what the brake would need.
    pub initial: Option<f64>,
    /// Seed of the particles.
    pub seed: u64,
    /// How the expectation is taken.
    pub e_step: EStep,
    /// True for the papers' cap on the coefficient, under which values above the demand stick.
    pub has_printed_cap: bool,
    /// What a brake pipeline reports; no meaning for adhesion.
    pub reports: BrakeFactor,
}

impl Default for EmSettings {
    fn default() -> Self {
        EmSettings {
            braking: BrakingSettings::default(),
            particles: 20,
            iterations: 50,
            window: 40,
            slide: 5,
            tolerance: 1e-7,
            initial: None,
            seed: 1,
            e_step: EStep::Particle,
            has_printed_cap: false,
            reports: BrakeFactor::Friction,
        }
    }
}

impl EmSettings {
    fn check(&self) -> Result<(), SettingError> {
        self.braking.check()?;
        let at_least = |key, value: usize, least: usize, allowed| {
            require(value >= least, key, value as f64, allowed)
        };
        at_least("particles", self.particles, 2, "2 or more")?;
        at_least("iterations", self.iterations, 1, "1 or more")?;
        at_least("window", self.window, 3, "3 or more")?;
        let slides = self.slide >= 1 && self.slide < self.window;
        require(slides, "slide", self.slide as f64, "at least 1 and below window")?;
        let initial = self.initial.unwrap_or(0.0);
        require(initial >= 0.0 && initial.is_finite(), "initial", initial, "0 or more")?;
        require(self.tolerance >= 0.0, "tolerance", self.tolerance, "0 or more")
    }

    fn build(
        &self,
        kind: PipelineKind,
        quantity: Quantity,
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

    /// Builds `adhesion_em`.
    ///
    /// # Errors
    ///
    /// When a setting lies outside its range.
    pub fn build_adhesion(&self, train: &TrainModel) -> Result<Box<dyn Estimator>, SettingError> {
        self.build(PipelineKind::AdhesionEm, Quantity::Adhesion, train)
    }

    /// Builds `brake_em`.
    ///
    /// # Errors
    ///
    /// When a setting lies outside its range.
    pub fn build_brake(&self, train: &TrainModel) -> Result<Box<dyn Estimator>, SettingError> {
        self.build(PipelineKind::BrakeEm, self.reports.quantity(), train)
    }
}
