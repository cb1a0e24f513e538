//! Bootstrap particle filter and marginal particle smoother (Doucet, Godsill, Andrieu 2000; Xie 2019, eq. 24-27; Jin
//! 2020, eq. 22-25), with systematic resampling without a search.

use std::f64::consts::LOG2_E;
use std::ops::Range;

use super::lanes;
use super::random::Random;

/// A Markov model of a state of `D` components, observed at every step.
///
/// Values that depend on the step alone are prepared once for all particles: the methods return functions of a
/// particle.
pub trait ParticleModel<const D: usize> {
    /// Draws a state of the first step.
    fn draw_initial(&self, random: &mut Random) -> [f64; D];

    /// Returns the next step's state without process noise.
    fn advance(&self, step: usize) -> impl Fn([f64; D]) -> [f64; D];

    /// Draws the process noise of the move that starts at `step`.
    fn draw_noise(&self, step: usize) -> impl Fn(&mut Random) -> [f64; D];

    /// Writes the transition densities, up to a common factor, from every advanced state (row) to every successor
    /// (column); states come as one slice for each component.
    fn transition_densities(
        &self,
        step: usize,
        advanced: [&[f64]; D],
        successors: [&[f64]; D],
        densities: &mut [f64],
    );

    /// Returns the logarithm of the density of the step's measurement given the state.
    fn log_likelihood(&self, step: usize) -> impl Fn([f64; D]) -> f64;
}

/// Why particles cannot represent the state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ParticleError {
    /// No particle explains the measurement, or a weight is not finite.
    #[error("no particle explains the measurement of step {step}")]
    Degenerate {
        /// Number of the step, from 0.
        step: usize,
    },
}

/// Particles over a window of steps, with filtered and smoothed weights.
#[derive(Clone, Debug)]
pub struct ParticleSmoother<const D: usize> {
    particles: usize,
    steps_max: usize,
    /// Steps of the last run.
    steps: usize,
    /// By component, then step, then particle.
    states: [Vec<f64>; D],
    advanced: [Vec<f64>; D],
    /// By step, then particle.
    filtered: Vec<f64>,
    smoothed: Vec<f64>,
    /// Densities from each particle (row) to each successor.
    densities: Vec<f64>,
    /// Smoothed weight of a successor over its predicted density.
    ratios: Vec<f64>,
    /// Which particle of the step before each is moved from; one place more than particles.
    ancestors: Vec<usize>,
}

impl<const D: usize> ParticleSmoother<D> {
    /// Room for a number of particles over at most `steps_max` steps; at least one of each.
    pub fn new(particles: usize, steps_max: usize) -> Self {
        let (particles, steps_max) = (particles.max(1), steps_max.max(1));
        let all = || vec![0.0; particles * steps_max];
        ParticleSmoother {
            particles,
            steps_max,
            steps: 0,
            states: std::array::from_fn(|_| all()),
            advanced: std::array::from_fn(|_| all()),
            filtered: all(),
            smoothed: all(),
            densities: vec![0.0; particles * particles],
            ratios: vec![0.0; particles],
            ancestors: vec![0; particles + 1],
        }
    }

    /// Runs the filter forward over `steps` steps, resampling systematically at each.
    ///
    /// # Errors
    ///
    /// When all weights of a step vanish.
    ///
    /// # Panics
    ///
    /// When there is room for fewer steps.
    ///
    /// # Real-time
    ///
    /// Allocates nothing; `steps * particles` operations.
    pub fn filter(
        &mut self,
        model: &impl ParticleModel<D>,
        steps: usize,
        random: &mut Random,
    ) -> Result<(), ParticleError> {
        assert!(steps <= self.steps_max, "room for {} steps, not {steps}", self.steps_max);
        self.steps = 0;
        for step in 0..steps {
            if step > 0 {
                self.advance(model, step - 1);
                let weights = &self.filtered[self.indices(step - 1)];
                find_ancestors(weights, random.uniform(), &mut self.ancestors);
                self.move_on(model, step, random);
            } else {
                for particle in 0..self.particles {
                    let drawn = model.draw_initial(random);
                    self.set_state(particle, drawn);
                }
            }
            let here = self.indices(step);
            let states = at(&self.states, &here);
            let weights = &mut self.filtered[here];
            let log_likelihood = model.log_likelihood(step);
            for (particle, weight) in weights.iter_mut().enumerate() {
                *weight = log_likelihood(states.map(|states| states[particle]));
            }
            normalise_logarithms(weights).ok_or(ParticleError::Degenerate { step })?;
        }
        self.steps = steps;
        Ok(())
    }

    /// Returns where a step's particles lie in every array.
    fn indices(&self, step: usize) -> Range<usize> {
        step * self.particles..(step + 1) * self.particles
    }

    /// Moves the particles of a step without noise.
    fn advance(&mut self, model: &impl ParticleModel<D>, step: usize) {
        let here = self.indices(step);
        let states = at(&self.states, &here);
        let advanced = at_mut(&mut self.advanced, &here);
        let advance = model.advance(step);
        for particle in 0..here.len() {
            let moved = advance(states.map(|states| states[particle]));
            for component in 0..D {
                advanced[component][particle] = moved[component];
            }
        }
    }

    /// The particles of a step: the advanced ones that they come from, with noise.
    fn move_on(&mut self, model: &impl ParticleModel<D>, step: usize, random: &mut Random) {
        let (before, here) = (self.indices(step - 1), self.indices(step));
        let advanced = at(&self.advanced, &before);
        let states = at_mut(&mut self.states, &here);
        let draw_noise = model.draw_noise(step - 1);
        for (particle, &ancestor) in self.ancestors[..here.len()].iter().enumerate() {
            let noise = draw_noise(random);
            for component in 0..D {
                states[component][particle] = advanced[component][ancestor] + noise[component];
            }
        }
    }

    /// Weighs the filtered particles by the later measurements, newest step first.
    ///
    /// The smoothed weight of a pair of particles (Xie 2019, eq. 27) is the filtered weight of
    /// the first, times the transition density, times the smoothed weight of the second over its
    /// predicted density; summed over the second it is the smoothed weight of the first.
    ///
    /// # Errors
    ///
    /// When a particle has no possible predecessor.
    ///
    /// # Real-time
    ///
    /// Allocates nothing; `steps * particles²` operations.
    pub fn smooth(&mut self, model: &impl ParticleModel<D>) -> Result<(), ParticleError> {
        let n = self.particles;
        let Some(last) = self.steps.checked_sub(1) else { return Ok(()) };
        self.smoothed[last * n..(last + 1) * n]
            .copy_from_slice(&self.filtered[last * n..(last + 1) * n]);
        for step in (0..last).rev() {
            let here = step * n;
            self.fill_densities(model, step);
            self.fill_ratios(step)?;
            for (particle, row) in self.densities.chunks_exact(n).enumerate() {
                let index = here + particle;
                self.smoothed[index] = self.filtered[index] * lanes::dot(row, &self.ratios);
            }
        }
        Ok(())
    }

    fn fill_densities(&mut self, model: &impl ParticleModel<D>, step: usize) {
        let advanced = at(&self.advanced, &self.indices(step));
        let successors = at(&self.states, &self.indices(step + 1));
        model.transition_densities(step, advanced, successors, &mut self.densities);
    }

    /// Divides each successor's smoothed weight by its predicted density, the denominator of
    /// eq. (27).
    fn fill_ratios(&mut self, step: usize) -> Result<(), ParticleError> {
        let n = self.particles;
        let (here, next) = (step * n, (step + 1) * n);
        self.ratios.fill(0.0);
        for (row, filtered) in self.densities.chunks_exact(n).zip(&self.filtered[here..here + n]) {
            for (predicted, density) in self.ratios.iter_mut().zip(row) {
                *predicted += filtered * density;
            }
        }
        for (ratio, smoothed) in self.ratios.iter_mut().zip(&self.smoothed[next..next + n]) {
            // A successor of weight zero needs no predecessor.
            *ratio = if *smoothed > 0.0 { smoothed / *ratio } else { 0.0 };
            if !ratio.is_finite() {
                return Err(ParticleError::Degenerate { step: step + 1 });
            }
        }
        Ok(())
    }

    /// Returns the mean and covariance of the particles of a step before its measurement was weighed in;
    /// `None` unless the last run reached the step.
    pub fn predicted_moments(&self, step: usize) -> Option<([f64; D], [[f64; D]; D])> {
        (step < self.steps).then(|| self.moments(step, |_| 1.0 / self.particles as f64))
    }

    /// Returns the mean and covariance of the particles of a step given every measurement; valid after
    /// [`ParticleSmoother::smooth`], `None` unless the last run reached the step.
    pub fn smoothed_moments(&self, step: usize) -> Option<([f64; D], [[f64; D]; D])> {
        (step < self.steps).then(|| self.moments(step, |index| self.smoothed[index]))
    }

    /// By how much the next step's state exceeds, on average given every measurement, where this
    /// step's state moves without noise; valid after [`ParticleSmoother::smooth`], `None` at the
    /// last step and beyond.
    ///
    /// Summed over the pair weights of eq. (27), a difference of the two states falls apart into
    /// the two smoothed means, so that no sum over pairs is left.
    pub fn mean_deviation(&self, step: usize) -> Option<[f64; D]> {
        if step + 1 >= self.steps {
            return None;
        }
        let (here, next) = (self.indices(step), self.indices(step + 1));
        Some(std::array::from_fn(|component| {
            let after = &self.states[component][next.clone()];
            let moved = &self.advanced[component][here.clone()];
            lanes::dot(&self.smoothed[next.clone()], after)
                - lanes::dot(&self.smoothed[here.clone()], moved)
        }))
    }

    fn moments(&self, step: usize, weight: impl Fn(usize) -> f64) -> ([f64; D], [[f64; D]; D]) {
        let indices = self.indices(step);
        let mut mean = [0.0; D];
        for index in indices.clone() {
            for (mean, states) in mean.iter_mut().zip(&self.states) {
                *mean += weight(index) * states[index];
            }
        }
        let mut covariance = [[0.0; D]; D];
        for index in indices {
            for (i, row) in covariance.iter_mut().enumerate() {
                for (j, entry) in row.iter_mut().enumerate() {
                    *entry += weight(index)
                        * (self.states[i][index] - mean[i])
                        * (self.states[j][index] - mean[j]);
                }
            }
        }
        (mean, covariance)
    }

    fn set_state(&mut self, index: usize, state: [f64; D]) {
        for (component, value) in state.into_iter().enumerate() {
            self.states[component][index] = value;
        }
    }
}

/// A step's part of each component.
fn at<'a, const D: usize>(arrays: &'a [Vec<f64>; D], indices: &Range<usize>) -> [&'a [f64]; D] {
    arrays.each_ref().map(|array| &array[indices.clone()])
}

fn at_mut<'a, const D: usize>(
    arrays: &'a mut [Vec<f64>; D],
    indices: &Range<usize>,
) -> [&'a mut [f64]; D] {
    arrays.each_mut().map(|array| &mut array[indices.clone()])
}

/// Turns logarithms of weights into weights of sum 1; `None` when that cannot be done.
fn normalise_logarithms(weights: &mut [f64]) -> Option<()> {
    // Passes over NaN, which weighs nothing below.
    let greatest = weights
        .iter()
        .fold(f64::NEG_INFINITY, |greatest, &w| if w > greatest { w } else { greatest });
    if !greatest.is_finite() {
        return None;
    }
    for weight in weights.iter_mut() {
        *weight = lanes::exp2_nonpositive((*weight - greatest) * LOG2_E);
    }
    let sum = lanes::sum(weights);
    if !(sum > 0.0 && sum.is_finite()) {
        return None;
    }
    let scale = 1.0 / sum;
    weights.iter_mut().for_each(|weight| *weight *= scale);
    Some(())
}

/// Finds the ancestor of each place, the particle that it is drawn from: the ancestor of place p is the first particle
/// whose cumulated weight exceeds the level p + `offset`, where all weights together are scaled to the number of
/// particles. `offset` lies in 0 to 1; `ancestors` holds one place more than there are weights, the last without
/// meaning.
///
/// Each particle marks the place from which on later particles are drawn; the highest mark up to a place is its
/// ancestor. A search for the ancestor would take a branch that no processor can foresee.
///
/// # Real-time
///
/// Allocates nothing; work proportional to the weights.
fn find_ancestors(weights: &[f64], offset: f64, ancestors: &mut [usize]) {
    let Some(last) = weights.len().checked_sub(1) else { return };
    ancestors.fill(0);
    // Weights sum to 1 but for rounding.
    let scale = weights.len() as f64 / lanes::sum(weights);
    let mut sum = 0.0;
    for (particle, weight) in weights[..last].iter().enumerate() {
        sum += weight;
        // The levels below `sum`: their number, rounded up.
        let level = sum * scale - offset;
        let whole = level as u32;
        let below = whole + u32::from(f64::from(whole) < level);
        ancestors[(below as usize).min(last + 1)] = particle + 1;
    }
    let mut highest = 0;
    for ancestor in ancestors {
        highest = highest.max(*ancestor);
        *ancestor = highest;
    }
}

#[cfg(test)]
mod tests;
