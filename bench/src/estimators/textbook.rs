//! The Kalman filter and the Rauch-Tung-Striebel smoother as textbooks print them.
//!
//! What a careful user of nalgebra would write at first: static matrices, full products,
//! `P = (I - K H) P`, inverses where the formula has one.

use nalgebra::{RowSVector, SMatrix, SVector};

/// Mean and covariance of a state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextbookFilter<const N: usize> {
    /// Mean.
    pub mean: SVector<f64, N>,
    /// Covariance.
    pub covariance: SMatrix<f64, N, N>,
    /// True for P = (I - K H) P (I - K H)' + K R K' in place of P = (I - K H) P, as textbooks advise where rounding
    /// matters.
    pub is_joseph: bool,
}

/// What a measurement said.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Said {
    /// Measured minus predicted.
    pub innovation: f64,
    /// Its variance.
    pub variance: f64,
}

impl Said {
    /// Logarithm of the predicted density.
    pub fn log_likelihood(&self) -> f64 {
        let square = self.innovation * self.innovation / self.variance;
        -0.5 * (square + (std::f64::consts::TAU * self.variance).ln())
    }
}

impl<const N: usize> TextbookFilter<N> {
    /// In the plain form.
    pub fn new(mean: SVector<f64, N>, covariance: SMatrix<f64, N, N>) -> Self {
        TextbookFilter { mean, covariance, is_joseph: false }
    }

    /// Moves on: P = F P F' + Q.
    pub fn predict(
        &mut self,
        mean: SVector<f64, N>,
        transition: &SMatrix<f64, N, N>,
        noise: &SMatrix<f64, N, N>,
    ) {
        self.mean = mean;
        self.covariance = transition * self.covariance * transition.transpose() + noise;
    }

    /// Takes in a measurement, K = P H' / (H P H' + R).
    pub fn measure(&mut self, row: &RowSVector<f64, N>, measured: f64, noise: f64) -> Said {
        let variance = (row * self.covariance * row.transpose())[0] + noise;
        let gain = self.covariance * row.transpose() / variance;
        let innovation = measured - (row * self.mean)[0];
        self.mean += gain * innovation;
        let keep = SMatrix::<f64, N, N>::identity() - gain * row;
        self.covariance = keep * self.covariance;
        if self.is_joseph {
            self.covariance = self.covariance * keep.transpose() + gain * gain.transpose() * noise;
        }
        Said { innovation, variance }
    }

    /// A step of a forward pass: over time, to a mean by a transition, unless it is the first, and to a measurement.
    pub fn pass(
        &mut self,
        moved: Option<(SVector<f64, N>, SMatrix<f64, N, N>)>,
        added: &SMatrix<f64, N, N>,
        row: &RowSVector<f64, N>,
        measured: f64,
        noise: f64,
    ) -> TextbookStep<N> {
        let (mean, transition) = moved.unwrap_or((self.mean, SMatrix::identity()));
        if moved.is_some() {
            self.predict(mean, &transition, added);
        }
        let predicted = *self;
        self.measure(row, measured, noise);
        TextbookStep { predicted, filtered: *self, transition }
    }
}

/// A step of a forward pass: before its measurement, after it, and how it was reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextbookStep<const N: usize> {
    /// Before the measurement.
    pub predicted: TextbookFilter<N>,
    /// After it.
    pub filtered: TextbookFilter<N>,
    /// Transition from the step before.
    pub transition: SMatrix<f64, N, N>,
}

/// Smooths a forward pass; `None` when a predicted covariance has no inverse.
pub fn smooth<const N: usize>(forward: &[TextbookStep<N>]) -> Option<Vec<TextbookFilter<N>>> {
    let mut smoothed: Vec<_> = forward.iter().map(|step| step.filtered).collect();
    for k in (0..forward.len().saturating_sub(1)).rev() {
        let next = &forward[k + 1];
        let filtered = &forward[k].filtered;
        let gain = filtered.covariance
            * next.transition.transpose()
            * next.predicted.covariance.try_inverse()?;
        let ahead = smoothed[k + 1];
        smoothed[k].mean = filtered.mean + gain * (ahead.mean - next.predicted.mean);
        smoothed[k].covariance = filtered.covariance
            + gain * (ahead.covariance - next.predicted.covariance) * gain.transpose();
    }
    Some(smoothed)
}
