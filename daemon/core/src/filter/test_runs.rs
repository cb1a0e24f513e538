//! A small system whose smoothed states are known from one batch solution, for tests.

use nalgebra::{DMatrix, DVector, Matrix2, SMatrix, SVector, Vector2};

use super::fixed_lag::ForwardStep;
use super::gaussian::Gaussian;
use super::random::Random;

/// A moving state of two components, of which the first is measured.
pub struct MovingState {
    pub jacobian: Matrix2<f64>,
    pub noise: Matrix2<f64>,
    pub prior: Gaussian<2>,
    pub measured: Vec<f64>,
    pub variance: f64,
}

impl MovingState {
    pub fn new(steps: usize) -> Self {
        let mut random = Random::new(5);
        MovingState {
            jacobian: Matrix2::new(1.0, 0.5, -0.1, 0.9),
            noise: Matrix2::new(0.05, 0.01, 0.01, 0.03),
            prior: Gaussian::independent(SVector::from([1.0, -1.0]), SVector::from([0.7, 1.5])),
            measured: (0..steps).map(|_| random.normal()).collect(),
            variance: 0.2,
        }
    }

    /// Filters forward; `seen` takes each step and the Jacobian of the move before it, `None` at the first step.
    pub fn forward(
        &self,
        mut seen: impl FnMut(&ForwardStep<2>, Option<&Matrix2<f64>>),
    ) -> Vec<ForwardStep<2>> {
        let mut state = self.prior;
        let mut forward = Vec::new();
        for (step, &measured) in self.measured.iter().enumerate() {
            let mut jacobian = Matrix2::identity();
            if step > 0 {
                jacobian = self.jacobian;
                state.predict(jacobian * state.mean, &jacobian, &self.noise);
            }
            let predicted = state;
            let innovation = state.innovation(0, measured, self.variance).unwrap();
            state.take(0, &innovation, self.variance);
            let filtered = state;
            let taken = ForwardStep { predicted, filtered, component: 0, innovation, jacobian };
            seen(&taken, (step > 0).then_some(&jacobian));
            forward.push(taken);
        }
        forward
    }

    /// Returns all states at once, from the normal equations of prior, moves and measurements: means and
    /// covariances by step.
    pub fn batch(&self) -> (Vec<Vector2<f64>>, Vec<Matrix2<f64>>) {
        let steps = self.measured.len();
        let mut information = DMatrix::zeros(2 * steps, 2 * steps);
        let mut vector = DVector::zeros(2 * steps);
        let prior = self.prior.covariance.try_inverse().unwrap();
        let mut block = information.fixed_view_mut::<2, 2>(0, 0);
        block += prior;
        let mut first = vector.fixed_rows_mut::<2>(0);
        first += prior * self.prior.mean;
        let weight: SMatrix<f64, 2, 2> = self.noise.try_inverse().unwrap();
        for step in 0..steps {
            information[(2 * step, 2 * step)] += 1.0 / self.variance;
            vector[2 * step] += self.measured[step] / self.variance;
            if step + 1 < steps {
                let (from, to) = (2 * step, 2 * step + 2);
                let back = self.jacobian.transpose() * weight;
                let mut block = information.fixed_view_mut::<2, 2>(from, from);
                block += back * self.jacobian;
                let mut block = information.fixed_view_mut::<2, 2>(to, to);
                block += weight;
                let mut block = information.fixed_view_mut::<2, 2>(from, to);
                block -= back;
                let mut block = information.fixed_view_mut::<2, 2>(to, from);
                block -= back.transpose();
            }
        }
        let covariance = information.try_inverse().unwrap();
        let means = &covariance * vector;
        (0..steps)
            .map(|step| {
                let own = covariance.fixed_view::<2, 2>(2 * step, 2 * step).into_owned();
                (means.fixed_rows::<2>(2 * step).into_owned(), own)
            })
            .unzip()
    }
}
