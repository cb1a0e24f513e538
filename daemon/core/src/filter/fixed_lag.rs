//! What later measurements say of an earlier state.
//!
//! For each remembered moment the smoother keeps one linear function of the state at that
//! moment: its mean, its variance, and its covariance with the present state. A measurement of
//! the present state then corrects every remembered value through that covariance, exactly as
//! if it were a further component of the state (Anderson and Moore 1979, section 7.3). No
//! matrix is inverted and no backward pass is made; the cost of a step is one small
//! matrix-vector product for each remembered moment.

use nalgebra::{SMatrix, SVector};

use super::kalman::{GaussianState, ScalarUpdate};

/// A linear function of the state at an earlier moment, given all measurements since.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lagged<const N: usize, T> {
    /// What the caller attached to the moment.
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
    /// Place of the oldest moment once the ring is full.
    oldest: usize,
}

impl<const N: usize, T: Copy> FixedLagSmoother<N, T> {
    /// A smoother that remembers `capacity` moments, at least one.
    pub fn new(capacity: usize) -> Self {
        let capacity = capacity.max(1);
        FixedLagSmoother { moments: Vec::with_capacity(capacity), capacity, oldest: 0 }
    }

    /// Forgets every moment.
    pub fn clear(&mut self) {
        self.moments.clear();
        self.oldest = 0;
    }

    /// Remembers `row` times the present state, in place of the oldest moment when full.
    ///
    /// # Real-time
    ///
    /// Allocates nothing.
    pub fn remember(&mut self, state: &GaussianState<N>, row: SVector<f64, N>, tag: T) {
        let cross = state.covariance * row;
        let moment = Lagged { tag, mean: row.dot(&state.mean), variance: row.dot(&cross), cross };
        if self.moments.len() < self.capacity {
            self.moments.push(moment);
        } else {
            self.moments[self.oldest] = moment;
            self.oldest = (self.oldest + 1) % self.capacity;
        }
    }

    /// Follows a prediction of the present state.
    pub fn predict(&mut self, jacobian: &SMatrix<f64, N, N>) {
        for moment in &mut self.moments {
            moment.cross = jacobian * moment.cross;
        }
    }

    /// Follows a measurement of the present state.
    pub fn apply(&mut self, update: &ScalarUpdate<N>) {
        for moment in &mut self.moments {
            let covariance = moment.cross.dot(&update.row);
            moment.mean += covariance / update.variance * update.innovation;
            moment.variance -= covariance * covariance / update.variance;
            moment.cross -= update.gain * covariance;
        }
    }

    /// Keeps the estimates as they are: later measurements tell nothing of them.
    pub fn freeze(&mut self) {
        for moment in &mut self.moments {
            moment.cross = SVector::zeros();
        }
    }

    /// The oldest remembered moment.
    pub fn oldest(&self) -> Option<&Lagged<N, T>> {
        self.moments.get(self.oldest)
    }

    /// The remembered moments, the latest first.
    pub fn newest_first(&self) -> impl Iterator<Item = &Lagged<N, T>> {
        let (before, from) = self.moments.split_at(self.oldest);
        before.iter().rev().chain(from.iter().rev())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::kalman::GaussianState;
    use crate::filter::random::Random;
    use crate::filter::rts::{self, ForwardStep, SmoothedStep};
    use nalgebra::Matrix2;

    /// Constant speed with noise, position measured; forward pass and the smoother's moments.
    fn run(capacity: usize) -> (Vec<ForwardStep<2>>, FixedLagSmoother<2, usize>) {
        let mut random = Random::new(3);
        let noise = Matrix2::new(0.01, 0.002, 0.002, 0.02);
        let mut state =
            GaussianState::independent(SVector::from([0.0, 1.0]), SVector::from([1.0, 2.0]));
        let mut smoother = FixedLagSmoother::new(capacity);
        let mut forward = Vec::new();
        for step in 0..40 {
            let jacobian = if step == 0 {
                Matrix2::identity()
            } else {
                Matrix2::new(1.0, 0.3 + 0.01 * step as f64, 0.0, 0.98)
            };
            if step > 0 {
                state.predict(jacobian * state.mean, &jacobian, &noise);
                smoother.predict(&jacobian);
            }
            let predicted = state;
            let measured = 0.4 * step as f64 + random.normal();
            let update = state.innovation(SVector::from([1.0, 0.0]), measured, 0.25).unwrap();
            state.apply(&update);
            smoother.apply(&update);
            smoother.remember(&state, SVector::from([0.5, 2.0]), step);
            forward.push(ForwardStep { predicted, filtered: state, jacobian });
        }
        (forward, smoother)
    }

    #[test]
    fn every_moment_equals_the_backward_pass_of_rauch_tung_and_striebel() {
        let (forward, smoother) = run(12);
        let mut smoothed = vec![SmoothedStep::empty(); forward.len()];
        rts::smooth(&forward, &mut smoothed).unwrap();
        let row = SVector::from([0.5, 2.0]);
        let mut newest_first = smoother.newest_first();
        for step in (28..40).rev() {
            let moment = newest_first.next().unwrap();
            let exact = &smoothed[step].state;
            assert_eq!(moment.tag, step);
            assert!((moment.mean - row.dot(&exact.mean)).abs() < 1e-10);
            assert!((moment.variance - row.dot(&(exact.covariance * row))).abs() < 1e-10);
        }
        assert!(newest_first.next().is_none());
        assert_eq!(smoother.oldest().unwrap().tag, 28);
    }

    #[test]
    fn a_frozen_moment_no_longer_changes() {
        let (forward, mut smoother) = run(5);
        smoother.freeze();
        let before = smoother.oldest().unwrap().mean;
        let mut state = forward[39].filtered;
        let update = state.innovation(SVector::from([1.0, 0.0]), 99.0, 0.25).unwrap();
        state.apply(&update);
        smoother.apply(&update);
        assert_eq!(smoother.oldest().unwrap().mean, before);
    }
}
