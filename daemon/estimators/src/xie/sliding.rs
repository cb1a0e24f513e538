//! The window as it slides, and its iterations.

use dynocar_core::filter::Gaussian;
use dynocar_core::pipeline::braking::engine::{Engine, EngineError, Estimate, Observation, Step};
use dynocar_core::pipeline::braking::law::Law;
use dynocar_core::pipeline::braking::motion::{self, MotionNoise, StepInputs, Walk};
use dynocar_core::pipeline::braking::tracker::{Prior, PriorScale, TrackerModel, measure};
use dynocar_shared::Uncertain;
use nalgebra::{SMatrix, SVector};

use super::expectation::Expectation;
use super::window::{Entry, MoveNoise, Window, WindowModel};

/// What does not change from window to window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmModel {
    /// Noise of motion and measurement; speeds are not used.
    pub noise: MotionNoise,
    /// Observations in a window (S).
    pub window_steps: usize,
    /// Observations by which the window slides (L), at most `window_steps`.
    pub slide_steps: usize,
    /// Most iterations in a window.
    pub iterations: usize,
    /// Iterations end when the coefficient changes by less, as a share of the demand.
    pub tolerance: f64,
    /// The coefficient before the first window; `None` for the demand.
    pub initial: Option<f64>,
    /// Standard deviation in m/s of the speed before the first window.
    pub initial_speed_std_mps: f64,
    /// True for the printed model, in which the coefficient acts only up to the demand.
    pub has_printed_cap: bool,
}

/// Sliding-window EM with an interchangeable E-step.
#[derive(Clone, Debug)]
pub struct EmWindow<E> {
    model: EmModel,
    expectation: E,
    window: Window,
    share: f64,
    estimate: Option<Estimate>,
}

impl<E: Expectation> EmWindow<E> {
    /// An estimator with an E-step made for windows of `model.window_steps`.
    pub fn new(model: EmModel, expectation: E) -> Self {
        let first = Gaussian { mean: SVector::zeros(), covariance: SMatrix::zeros() };
        let entries = Vec::with_capacity(model.window_steps);
        EmWindow {
            model,
            expectation,
            window: Window { entries, first },
            share: 1.0,
            estimate: None,
        }
    }

    /// Runs the iterations of a full window.
    fn maximise(&mut self) -> Result<(), EngineError> {
        // The iterates of the second half scatter by the particles' randomness, and go on moving
        // where they have not converged: both are part of the error.
        let (mut scatter, mut scatter_count, mut halfway) = (0.0, 0.0, self.share);
        for iteration in 0..self.model.iterations {
            let statistics = {
                let model = WindowModel {
                    window: &self.window,
                    noise: &self.model.noise,
                    share: self.share,
                    has_printed_cap: self.model.has_printed_cap,
                };
                self.expectation.expect(&model)?
            };
            let change = statistics.newton_step();
            if 2 * iteration >= self.model.iterations {
                scatter += change * change;
                scatter_count += 1.0;
            } else {
                halfway = self.share + change;
            }
            self.share += change;
            if !self.share.is_finite() {
                return Err(EngineError::NotFinite { value: self.share });
            }
            if change.abs() <= self.model.tolerance {
                break;
            }
        }
        // Successive iterates differ by two independent draws.
        let scatter_variance =
            if scatter_count > 0.0 { 0.5 * scatter / scatter_count } else { 0.0 };
        let trend = self.share - halfway;
        let std = (self.information_variance()? + scatter_variance + trend * trend).sqrt();
        let demand = self.window.entries[self.window.entries.len() / 2].observed.demand;
        self.estimate = Some(Estimate {
            coefficient: Uncertain::new(demand * self.share, demand * std),
            scale: Uncertain::new(self.share, std),
            covariance: demand * std * std,
            demand,
            brake_limited: None,
        });
        Ok(())
    }

    /// Variance of the share given the window alone, by a Kalman filter in which it is
    /// constant and unknown beforehand.
    fn information_variance(&self) -> Result<f64, EngineError> {
        let scale = Uncertain::new(self.share, 10.0);
        let model = TrackerModel {
            law: Law::Demand,
            noise: MotionNoise { measured_speed_m2_per_s2: None, ..self.model.noise },
            walk: Walk::Scale(0.0),
            prior: Prior { speed_std_mps: 1.0, scale: PriorScale::OfLaw(scale) },
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
            measure(&model, &mut state, &entry.observed)?;
        }
        Ok(state.covariance[(motion::State::Scale as usize, motion::State::Scale as usize)])
    }

    /// Moves the window on, with the filter's prediction as belief about its new first state.
    fn slide(&mut self) {
        let by = self.model.slide_steps;
        let noise = &self.model.noise;
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
    fn start(&mut self, first: &Observation) {
        self.window.entries.clear();
        self.share = self.model.initial.map_or(1.0, |initial| initial / first.demand);
        self.estimate = None;
        let std = SVector::from([
            self.model.noise.measured_distance_m2.sqrt(),
            self.model.initial_speed_std_mps,
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
        let noise = MoveNoise::over(&self.model.noise, inputs.step_s);
        self.window.entries.push(Entry { inputs, observed: *first, noise });
    }

    fn step(&mut self, inputs: &StepInputs, observed: &Observation) -> Result<Step, EngineError> {
        if self.window.entries.is_empty() {
            self.start(observed);
            return Ok(Step::Restarted);
        }
        let noise = MoveNoise::over(&self.model.noise, inputs.step_s);
        self.window.entries.push(Entry { inputs: *inputs, observed: *observed, noise });
        if self.window.entries.len() < self.model.window_steps {
            return Ok(Step::Collected);
        }
        self.maximise()?;
        self.slide();
        Ok(Step::Updated { normalised_innovation: None })
    }

    fn set_distance_variance(&mut self, variance_m2: f64) {
        self.model.noise.measured_distance_m2 = variance_m2;
    }

    fn estimate(&self) -> Option<Estimate> {
        self.estimate
    }
}
