//! Smoothed estimate of an earlier state by later measurements, with a fixed lag or over a fixed interval.
//!
//! For each remembered moment the smoother keeps one component of the state at that moment: its
//! mean, its variance, and its covariance with the present state. A measurement of the present
//! state then corrects every remembered value through that covariance, exactly as if it were a
//! further component of the state (Anderson and Moore 1979, section 7.3). No matrix is inverted and
//! no backward pass is made; the cost of a step is one small matrix-vector product for each
//! remembered moment.
//!
//! Over a fixed interval the adjoint of the filter smooths (Bryson and Frazier 1963; for scalar measurements Bierman
//! 1973). The backward pass carries the information of the later measurements as a vector: it multiplies and adds,
//! inverts no covariance, and so cannot fail where a prediction is nearly certain. Its means are those of Rauch, Tung
//! and Striebel.

use nalgebra::{SMatrix, SVector};

use super::{Gaussian, Innovation};

/// A component of the state at an earlier moment, given all measurements since.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lagged<const N: usize, T> {
    /// Tag that the caller attached to the moment.
    pub tag: T,
    /// Smoothed mean.
    pub mean: f64,
    /// Smoothed variance.
    pub variance: f64,
    /// Covariance with the present state.
    cross: SVector<f64, N>,
}

/// Remembers the last moments of a filter and keeps their estimates up to date.
#[derive(Clone, Debug)]
pub struct FixedLagSmoother<const N: usize, T> {
    /// Ring of at most `capacity` moments.
    moments: Vec<Lagged<N, T>>,
    capacity: usize,
    /// Index of the oldest moment once the ring is full.
    oldest: usize,
}

impl<const N: usize, T: Copy> FixedLagSmoother<N, T> {
    /// Returns a smoother that remembers `capacity` moments, at least one.
    pub fn new(capacity: usize) -> Self {
        let capacity = capacity.max(1);
        FixedLagSmoother { moments: Vec::with_capacity(capacity), capacity, oldest: 0 }
    }

    /// Forgets every moment.
    pub fn clear(&mut self) {
        self.moments.clear();
        self.oldest = 0;
    }

    /// Remembers a component of the present state, in place of the oldest moment when full.
    ///
    /// # Real-time
    ///
    /// Allocates nothing.
    #[inline]
    pub fn remember(&mut self, state: &Gaussian<N>, component: usize, tag: T) {
        let cross = state.covariance.column(component).into_owned();
        let mean = state.mean[component];
        let moment = Lagged { tag, mean, variance: cross[component], cross };
        if self.moments.len() < self.capacity {
            self.moments.push(moment);
        } else {
            self.moments[self.oldest] = moment;
            self.oldest = if self.oldest + 1 < self.capacity { self.oldest + 1 } else { 0 };
        }
    }

    /// Follows a prediction of the present state.
    pub fn predict(&mut self, jacobian: &SMatrix<f64, N, N>) {
        for moment in &mut self.moments {
            moment.cross = jacobian * moment.cross;
        }
    }

    /// Follows a measurement of a component of the present state, with the gain that it had there.
    pub fn take(&mut self, component: usize, innovation: &Innovation, gain: &SVector<f64, N>) {
        for moment in &mut self.moments {
            let covariance = moment.cross[component];
            let share = covariance * innovation.inverse_variance;
            moment.mean += share * innovation.value;
            moment.variance -= share * covariance;
            moment.cross -= gain * covariance;
        }
    }

    /// Keeps the estimates as they are: later measurements say nothing of them.
    pub fn freeze(&mut self) {
        for moment in &mut self.moments {
            moment.cross = SVector::zeros();
        }
    }

    /// Returns the oldest remembered moment.
    pub fn oldest(&self) -> Option<&Lagged<N, T>> {
        self.moments.get(self.oldest)
    }

    /// Returns the remembered moments, the latest first.
    pub fn newest_first(&self) -> impl Iterator<Item = &Lagged<N, T>> {
        let (before, from) = self.moments.split_at(self.oldest);
        before.iter().rev().chain(from.iter().rev())
    }
}

/// One step of a forward pass of a Kalman filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForwardStep<const N: usize> {
    /// Belief before the step's measurement.
    pub predicted: Gaussian<N>,
    /// Belief after it.
    pub filtered: Gaussian<N>,
    /// The component that was measured.
    pub component: usize,
    /// Innovation of the measurement.
    pub innovation: Innovation,
    /// Jacobian of the move from the step before to this one.
    pub jacobian: SMatrix<f64, N, N>,
}

impl<const N: usize> ForwardStep<N> {
    /// Returns how far the measurement moved the state, for an innovation of 1.
    #[inline]
    pub fn gain(&self) -> SVector<f64, N> {
        self.predicted.covariance.column(self.component) * self.innovation.inverse_variance
    }
}

/// Writes the mean of every step, given the measurements of all, into `means`, which must be as
/// long.
///
/// # Panics
///
/// When the lengths differ.
///
/// # Real-time
///
/// Bounded work, no allocation.
pub fn smooth_means<const N: usize>(forward: &[ForwardStep<N>], means: &mut [SVector<f64, N>]) {
    assert_eq!(forward.len(), means.len(), "one mean for each forward step");
    // Gradient of the later innovations' cost by the filtered state.
    let mut later = SVector::<f64, N>::zeros();
    for (step, mean) in forward.iter().zip(means).rev() {
        *mean = step.filtered.mean - step.filtered.covariance * later;
        let Innovation { value, inverse_variance, .. } = step.innovation;
        let shift = step.gain().dot(&later) + inverse_variance * value;
        // Chosen, not indexed: the vector stays in registers.
        later =
            SVector::from_fn(|i, _| if i == step.component { later[i] - shift } else { later[i] });
        later = step.jacobian.tr_mul(&later);
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_runs::MovingState;
    use super::*;

    const SECOND: usize = 1;

    /// Returns the smoother's moments after a forward pass over 40 steps, and the last state.
    fn run(capacity: usize) -> (Gaussian<2>, FixedLagSmoother<2, usize>) {
        let mut smoother = FixedLagSmoother::new(capacity);
        let mut number = 0;
        let forward = MovingState::new(40).forward(|step, jacobian| {
            if let Some(jacobian) = jacobian {
                smoother.predict(jacobian);
            }
            smoother.take(step.component, &step.innovation, &step.gain());
            smoother.remember(&step.filtered, SECOND, number);
            number += 1;
        });
        (forward[39].filtered, smoother)
    }

    #[test]
    fn every_moment_equals_batch_least_squares() {
        let (_, smoother) = run(12);
        let (means, covariances) = MovingState::new(40).batch();
        let mut newest_first = smoother.newest_first();
        for step in (28..40).rev() {
            let moment = newest_first.next().unwrap();
            assert_eq!(moment.tag, step);
            assert!((moment.mean - means[step][SECOND]).abs() < 1e-10);
            assert!((moment.variance - covariances[step][(SECOND, SECOND)]).abs() < 1e-10);
        }
        assert!(newest_first.next().is_none());
        assert_eq!(smoother.oldest().unwrap().tag, 28);
    }

    #[test]
    fn a_frozen_moment_no_longer_changes() {
        let (mut state, mut smoother) = run(5);
        smoother.freeze();
        let before = smoother.oldest().unwrap().mean;
        let innovation = state.innovation(0, 99.0, 0.25).unwrap();
        let gain = state.take(0, &innovation, 0.25);
        smoother.take(0, &innovation, &gain);
        assert_eq!(smoother.oldest().unwrap().mean, before);
    }
}

#[cfg(test)]
mod adjoint_tests {
    use super::*;
    use crate::filter::test_runs::MovingState;

    #[test]
    fn smoothed_means_equal_batch_least_squares() {
        let moving = MovingState::new(12);
        let (batch, _) = moving.batch();
        let forward = moving.forward(|_, _| {});
        let mut means = vec![SVector::zeros(); forward.len()];
        smooth_means(&forward, &mut means);
        for (mean, exact) in means.iter().zip(batch) {
            assert!((mean - exact).norm() < 1e-10);
        }
    }

    #[test]
    fn a_state_that_is_known_for_certain_is_no_obstacle() {
        let mut moving = MovingState::new(5);
        moving.prior = Gaussian { mean: moving.prior.mean, covariance: SMatrix::zeros() };
        moving.noise = SMatrix::zeros();
        let forward = moving.forward(|_, _| {});
        let mut means = vec![SVector::zeros(); forward.len()];
        smooth_means(&forward, &mut means);
        assert_eq!(means[0], moving.prior.mean);
    }
}
