//! What the speed signal itself says of its noise.

use crate::pipeline::motion::Rounding;

/// Variance of the speed's white noise and its quantum, from the signal itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedNoise {
    square_sum: f64,
    freedom: f64,
    /// The steps of the signal.
    pub rounding: Rounding,
    /// Variance of one value before the first scatter, in (m/s)².
    unknown_variance: f64,
}

/// The degrees of freedom that the variance looks back over.
const MEMORY: f64 = 2_000.0;
/// A scatter counts up to so many standard deviations above what the known variance lets expect:
/// a spike too small for the gate would else widen every interval.
const CLIP_DEVIATIONS: f64 = 4.0;
/// No speed is known better, in (m/s)².
const VARIANCE_MIN: f64 = 1e-10;
/// Degrees of freedom before the scatter is clipped.
const FREEDOM_BEFORE_CLIP: f64 = 20.0;

impl SpeedNoise {
    /// Before the first scatter a value is taken to have a standard deviation of `unknown_mps`.
    pub fn new(unknown_mps: f64) -> Self {
        SpeedNoise {
            square_sum: 0.0,
            freedom: 0.0,
            rounding: Rounding::default(),
            unknown_variance: unknown_mps * unknown_mps,
        }
    }

    /// Takes in the sum of squares, in (m/s)², of `freedom` independent deviations.
    pub fn take(&mut self, square_sum: f64, freedom: f64) {
        if freedom <= 0.0 || !square_sum.is_finite() {
            return;
        }
        let clipped = match self.freedom > FREEDOM_BEFORE_CLIP {
            true => {
                let most = freedom + CLIP_DEVIATIONS * (2.0 * freedom).sqrt();
                square_sum.min(most * self.variance().max(self.rounding.variance()))
            }
            false => square_sum,
        };
        let kept = 1.0 - freedom / MEMORY;
        self.square_sum = kept * self.square_sum + clipped;
        self.freedom = kept * self.freedom + freedom;
    }

    /// Variance of one speed value in (m/s)²; 0 before the first scatter.
    pub fn variance(&self) -> f64 {
        if self.freedom > 0.0 { self.square_sum / self.freedom } else { 0.0 }
    }

    /// Variance of the mean of `count` values that ran through `range_mps`.
    ///
    /// A speed that hardly moves falls on the same step again and again, so that averaging does
    /// not lessen its rounding error.
    pub fn variance_of_mean(&self, count: f64, range_mps: f64) -> f64 {
        let rounding =
            self.rounding.variance() / count.min(1.0 + range_mps / self.rounding.quantum_mps());
        (self.variance() / count).max(rounding).max(VARIANCE_MIN)
    }

    /// Variance of one value, such that one may treat it as independent of its neighbours;
    /// `per_step_mps` is how far the speed moves from one sample to the next.
    pub fn variance_of_sample(&self, per_step_mps: f64) -> f64 {
        let variance = if self.freedom > 0.0 { self.variance() } else { self.unknown_variance };
        self.rounding.variance_of_sample(variance, per_step_mps).max(VARIANCE_MIN)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_of_a_steady_speed_does_not_average_out() {
        let mut noise = SpeedNoise::new(0.05);
        for speed_mps in [5.0, 5.1, 5.1, 5.2] {
            noise.rounding.see(speed_mps);
        }
        let rounding = 0.1_f64.powi(2) / 12.0;
        assert!((noise.rounding.variance() - rounding).abs() < 1e-12);
        assert!((noise.variance_of_mean(25.0, 0.0) - rounding).abs() < 1e-9);
        assert!((noise.variance_of_mean(25.0, 10.0) - rounding / 25.0).abs() < 1e-9);
        assert!((noise.variance_of_sample(0.2) - 0.05_f64.powi(2)).abs() < 1e-9, "no scatter yet");
        noise.take(0.0, 10.0);
        assert!((noise.variance_of_sample(0.2) - rounding).abs() < 1e-9);
        assert!((noise.variance_of_sample(0.01) - 10.0 * rounding).abs() < 1e-9);
    }

    #[test]
    fn one_wild_scatter_hardly_moves_the_variance() {
        let mut noise = SpeedNoise::new(0.05);
        [5.0, 5.11, 5.13].into_iter().for_each(|speed_mps| noise.rounding.see(speed_mps));
        for _ in 0..50 {
            noise.take(10.0 * 4e-4, 10.0);
        }
        noise.take(10.0 * 4.0, 10.0);
        assert!(noise.variance() < 6e-4);
        noise.take(f64::NAN, 10.0);
        assert!(noise.variance() < 6e-4);
    }
}
