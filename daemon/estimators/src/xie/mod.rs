//! Sliding-window expectation maximisation (Xie 2019, section 2; Jin 2020, section 3).
//!
//! The steps are the papers'; this module differs where the printed form cannot work:
//!
//! - The process noise in the E- and M-steps is Gaussian with the variance of the papers'
//!   uniform noise. With the uniform density itself, Q is constant where it is finite, and that
//!   is an interval of about 1e-5 around the old value: the M-step never moves. The Gaussian
//!   makes the M-step, eq. (29)-(33), a weighted least-squares problem with a closed form.
//! - The motion is that of [`dynocar_core::pipeline::braking::motion`], without the cap min(F(mu), B), unless
//!   [`EmSettings::has_printed_cap`] asks for it.
//! - An estimate belongs to the middle of its window; attributed to the end, as printed, it
//!   lags behind a changing coefficient by half a window.
//! - The first state of a window, whose density I_1 needs and the papers do not give, is the
//!   filter's prediction from the window before.
//!
//! Here are the settings, the window as it slides, and its iterations; `expectation` has the E-step.

mod expectation;
#[cfg(test)]
mod tests;

pub use expectation::{
    Expectation, KalmanExpectation, ObservedWindow, ParticleExpectation, Statistics, WindowModel,
};

use dynocar_core::filter::Gaussian;
use dynocar_core::pipeline::Estimator;
use dynocar_core::pipeline::braking::engine::{
    BrakingEstimate, BrakingObservation, Engine, EngineStep,
};
use dynocar_core::pipeline::braking::intake::BrakingCoefficient;
use dynocar_core::pipeline::braking::law::BrakingLaw;
use dynocar_core::pipeline::braking::motion::{MotionNoise, SCALE, StepInputs, Walk};
use dynocar_core::pipeline::braking::settings::{BrakeFactor, BrakingSettings};
use dynocar_core::pipeline::braking::tracker::{PriorScale, TrackerModel, measure};
use dynocar_core::pipeline::settings::{SettingError, require};
use dynocar_core::settings;
use dynocar_model::train::TrainModel;
use dynocar_shared::{PipelineKind, Uncertain};
use nalgebra::{SMatrix, SVector};
use serde::Deserialize;

use self::expectation::{MoveNoise, ObservedStep};

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
        /// The coefficient before the first window; when absent the declared one, and for adhesion the one that the
        /// brake would need.
        initial: Option<f64> = None => (0 or more);
        /// Seed of the particles.
        seed: u64 = 1;
        /// How the expectation is taken.
        e_step: EStep = EStep::Particle;
        /// True for the papers' cap on the coefficient, under which values above the demand stick.
        has_printed_cap: bool = false;
        /// Factor that a brake pipeline reports; no meaning for adhesion.
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
        let noise = MotionNoise { measured_speed_m2_per_s2: None, ..self.braking.noise() };
        Ok(match self.e_step {
            EStep::Particle => {
                let particles = ParticleExpectation::new(self.particles, self.window, self.seed);
                let window = EmWindow::new(*self, noise, particles);
                self.braking.estimator(kind, quantity, train, window)
            }
            EStep::Kalman => {
                let window = EmWindow::new(*self, noise, KalmanExpectation::new(self.window));
                self.braking.estimator(kind, quantity, train, window)
            }
        })
    }
}

/// Sliding-window EM with an interchangeable E-step.
#[derive(Clone, Debug)]
pub struct EmWindow<E> {
    settings: EmSettings,
    /// Noise of motion and measurement; speeds are not used.
    noise: MotionNoise,
    expectation: E,
    window: ObservedWindow,
    share: f64,
    estimate: Option<BrakingEstimate>,
}

impl<E: Expectation> EmWindow<E> {
    /// Returns an estimator with an E-step made for windows of `settings.window`.
    pub fn new(settings: EmSettings, noise: MotionNoise, expectation: E) -> Self {
        let first = Gaussian { mean: SVector::zeros(), covariance: SMatrix::zeros() };
        EmWindow {
            settings,
            noise,
            expectation,
            window: ObservedWindow { entries: Vec::with_capacity(settings.window), first },
            share: 1.0,
            estimate: None,
        }
    }

    /// Runs the iterations of a full window.
    fn maximise(&mut self) -> Option<()> {
        // The iterates of the second half scatter by the particles' randomness, and go on moving
        // where they have not converged: both are part of the error.
        let (mut scatter, mut scatter_count, mut halfway) = (0.0, 0.0, self.share);
        for iteration in 0..self.settings.iterations {
            let change = self.expectation.expect(&WindowModel {
                window: &self.window,
                noise: &self.noise,
                share: self.share,
                has_printed_cap: self.settings.has_printed_cap,
            })?;
            let change = change.newton_step();
            if 2 * iteration >= self.settings.iterations {
                scatter += change * change;
                scatter_count += 1.0;
            } else {
                halfway = self.share + change;
            }
            self.share += change;
            if !self.share.is_finite() {
                return None;
            }
            if change.abs() <= self.settings.tolerance {
                break;
            }
        }
        // Successive iterates differ by two independent draws.
        let scatter_variance =
            if scatter_count > 0.0 { 0.5 * scatter / scatter_count } else { 0.0 };
        let trend = self.share - halfway;
        let std = (self.information_variance()? + scatter_variance + trend * trend).sqrt();
        let demand = self.window.entries[self.window.entries.len() / 2].observed.demand;
        self.estimate = Some(BrakingEstimate {
            coefficient: Uncertain::new(demand * self.share, demand * std),
            scale: Uncertain::new(self.share, std),
            covariance: demand * std * std,
            demand,
            brake_limited: None,
        });
        Some(())
    }

    /// Returns the variance of the share given the window alone, by a Kalman filter in which it is
    /// constant and unknown beforehand.
    fn information_variance(&self) -> Option<f64> {
        let scale = Uncertain::new(self.share, 10.0);
        let model = TrackerModel {
            law: BrakingLaw::Demand,
            noise: MotionNoise { measured_speed_m2_per_s2: None, ..self.noise },
            walk: Walk::Scale(0.0),
            first_speed_std_mps: 1.0,
            prior: PriorScale::OfLaw(scale),
        };
        let first = &self.window.first;
        let mut state = Gaussian::independent(
            SVector::from([first.mean[0], first.mean[1], scale.value, 0.0]),
            SVector::from([0.0, 0.0, scale.std, 0.0]),
        );
        state.covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&first.covariance);
        for (step, entry) in self.window.entries.iter().enumerate() {
            if step > 0 {
                model.advance(&entry.inputs, &mut state);
            }
            measure(&model, &mut state, &entry.observed).ok()?;
        }
        Some(state.covariance[(SCALE, SCALE)])
    }

    /// Moves the window on, with the filter's prediction as belief about its new first state.
    fn slide(&mut self) {
        let by = self.settings.slide;
        let noise = &self.noise;
        if let Some(mut first) = self.expectation.predicted(by) {
            // A handful of particles may collapse; one step's noise is the least uncertainty.
            let step_s = self.window.entries[by.min(self.window.entries.len() - 1)].inputs.step_s;
            first.covariance[(0, 0)] += noise.distance_m2_per_s * step_s;
            first.covariance[(1, 1)] += noise.speed_m2_per_s3 * step_s;
            self.window.first = first;
        }
        self.window.entries.drain(..by.min(self.window.entries.len()));
    }
}

impl<E: Expectation> Engine for EmWindow<E> {
    fn start(&mut self, first: &BrakingObservation) {
        self.window.entries.clear();
        self.share = self.settings.initial.map_or(1.0, |initial| initial / first.demand);
        self.estimate = None;
        let std = SVector::from([
            self.noise.measured_distance_m2.sqrt(),
            self.settings.braking.first_speed_std_mps,
        ]);
        self.window.first =
            Gaussian::independent(SVector::from([first.distance_m, first.speed_mps]), std);
        let inputs = StepInputs {
            step_s: 0.0,
            gain_mps2: 0.0,
            demand: first.demand,
            tied_mps2: 0.0,
            basic_mps2: [0.0; 3],
        };
        let noise = MoveNoise::over(&self.noise, inputs.step_s);
        self.window.entries.push(ObservedStep { inputs, observed: *first, noise });
    }

    fn step(&mut self, inputs: &StepInputs, observed: &BrakingObservation) -> Option<EngineStep> {
        if self.window.entries.is_empty() {
            self.start(observed);
            return Some(EngineStep::Restarted);
        }
        let noise = MoveNoise::over(&self.noise, inputs.step_s);
        self.window.entries.push(ObservedStep { inputs: *inputs, observed: *observed, noise });
        if self.window.entries.len() < self.settings.window {
            return Some(EngineStep::Collected);
        }
        self.maximise()?;
        self.slide();
        Some(EngineStep::Updated { normalised_innovation: None })
    }

    fn set_distance_variance(&mut self, variance_m2: f64) {
        self.noise.measured_distance_m2 = variance_m2;
    }

    /// A force that lacks early counts twice in the distance over a window.
    fn lacking_share(&self) -> f64 {
        2.0
    }

    fn estimate(&self) -> Option<BrakingEstimate> {
        self.estimate
    }
}
