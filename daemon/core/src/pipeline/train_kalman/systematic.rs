//! What no amount of samples of one train on one line makes better known.

use dynocar_model::track::GRADIENT_ERROR_FREE_M;
use nalgebra::{Matrix4, Vector4};

use crate::pipeline::momentum::regressors;

/// The segment of line that was driven, and the scales that cannot be found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Systematic {
    /// Standard deviation in ‰ of gradients where no survey states one.
    gradient_std_permille: f64,
    /// Standard deviation of the scale of accelerations.
    scale_std: f64,
    /// Lowest and highest chainage in m.
    driven_m: Option<(f64, f64)>,
    /// Highest speed in m/s.
    top_mps: f64,
    /// Starts from a standstill, and the distance in m driven altogether.
    starts: f64,
    travelled_m: f64,
}

impl Systematic {
    /// Before the first sample.
    pub fn new(gradient_std_permille: f64, scale_std: f64) -> Self {
        Systematic {
            gradient_std_permille,
            scale_std,
            driven_m: None,
            top_mps: 0.0,
            starts: 0.0,
            travelled_m: 0.0,
        }
    }

    /// Takes in a step of a way in m, where it ends, and the speed there.
    pub fn see(&mut self, travelled_m: f64, position_m: Option<f64>, speed_mps: f64) {
        self.travelled_m += travelled_m;
        self.top_mps = self.top_mps.max(speed_mps);
        if let Some(position_m) = position_m {
            let (low, high) = self.driven_m.unwrap_or((position_m, position_m));
            self.driven_m = Some((low.min(position_m), high.max(position_m)));
        }
    }

    /// The train starts from a standstill.
    pub fn start(&mut self) {
        self.starts += 1.0;
    }

    /// Variance in (N/kN)² that the filter lacks of w0 by the mean error of the map over the line driven, and
    /// over the places where the train is slow: passing a place once more brings the same error again, which
    /// the filter takes for another one. Without chainage every place counts as new.
    fn map_variances(&self) -> (f64, f64) {
        let Some((low, high)) = self.driven_m else { return (0.0, 0.0) };
        let line_m = high - low;
        let between_stops_m = self.travelled_m / self.starts.max(1.0);
        let pieces = (line_m / GRADIENT_ERROR_FREE_M).max(1.0);
        let stops = (line_m / between_stops_m.max(1.0)).clamp(1.0, self.starts.max(1.0));
        let variance = self.gradient_std_permille.powi(2);
        let repeated = 1.0 - (line_m / self.travelled_m.max(1.0)).min(1.0);
        (variance * repeated / pieces, variance * repeated / stops)
    }

    /// Widens the covariance of a, b, c (scaled) and of the load factor.
    pub fn widen(&self, mean: &Vector4<f64>, covariance: &mut Matrix4<f64>) {
        let scale = self.scale_std * self.scale_std;
        let mut by_scale = mean * mean.transpose() * scale;
        // Whatever scales the accelerations scales resistance and mass alike: u the other way.
        for i in 0..3 {
            by_scale[(i, 3)] = -by_scale[(i, 3)];
            by_scale[(3, i)] = -by_scale[(3, i)];
        }
        *covariance += by_scale;
        let (of_line, of_stops) = self.map_variances();
        // What the map does where the train is slow fades towards the highest speed.
        let mut slow = Vector4::zeros();
        let [one, linear, _] = regressors(self.top_mps.max(1.0));
        (slow[0], slow[1]) = (one, -one / linear);
        *covariance += slow * slow.transpose() * of_stops;
        covariance[(0, 0)] += of_line;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passing_a_line_again_makes_nothing_better_known() {
        let widened = |lengths_m: &[f64]| {
            let mut systematic = Systematic::new(0.1, 0.0);
            for length_m in lengths_m {
                systematic.start();
                systematic.see(*length_m, Some(0.0), 20.0);
                systematic.see(0.0, Some(*length_m), 20.0);
            }
            let mut covariance = Matrix4::zeros();
            systematic.widen(&Vector4::zeros(), &mut covariance);
            // w0 at the highest speed, where only the line counts.
            let top = Vector4::new(1.0, 1.0, 1.0, 0.0);
            top.dot(&(covariance * top))
        };
        // The filter takes the passages for independent: of the error of one it has a seventh after seven.
        let by_one = 0.01 / 50.0;
        assert!((widened(&[10e3; 7]) + by_one / 7.0 - by_one).abs() < 1e-12);
        assert!((widened(&[40e3; 7]) - widened(&[10e3; 7]) / 4.0).abs() < 1e-12);
        assert_eq!(widened(&[10e3]), 0.0, "the filter has all of it");
    }
}
