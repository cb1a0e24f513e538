//! Whether the innovations of an estimator look as its covariance says.

/// Exponentially forgotten mean square and lag-1 correlation of normalised innovations.
///
/// A consistent estimator has mean square 1 and correlation 0 (Bar-Shalom, Li, Kirubarajan
/// 2001, section 5.4: NIS and whiteness tests).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InnovationMonitor {
    forgetting: f64,
    weight: f64,
    mean_square: f64,
    product_weight: f64,
    mean_product: f64,
    last: f64,
}

impl InnovationMonitor {
    /// A monitor that looks back over about `memory` innovations.
    pub fn new(memory: u32) -> Self {
        InnovationMonitor {
            forgetting: 1.0 - 1.0 / f64::from(memory.max(2)),
            weight: 0.0,
            mean_square: 0.0,
            product_weight: 0.0,
            mean_product: 0.0,
            last: 0.0,
        }
    }

    /// Takes in an innovation divided by its predicted standard deviation.
    pub fn push(&mut self, normalised: f64) {
        if self.weight > 0.0 {
            average(
                &mut self.mean_product,
                &mut self.product_weight,
                self.forgetting,
                normalised * self.last,
            );
        }
        let square = normalised * normalised;
        average(&mut self.mean_square, &mut self.weight, self.forgetting, square);
        self.last = normalised;
    }

    /// Forgets the last innovation, so that no correlation is formed across a gap.
    pub fn break_here(&mut self) {
        self.last = 0.0;
    }

    /// The newest normalised innovation.
    pub fn last(&self) -> f64 {
        self.last
    }

    /// Mean square of the normalised innovations; 0 before the first.
    pub fn mean_square(&self) -> f64 {
        self.mean_square
    }

    /// Lag-1 correlation, -1 to 1; 0 before the second innovation.
    pub fn correlation(&self) -> f64 {
        if self.mean_square > 0.0 {
            (self.mean_product / self.mean_square).clamp(-1.0, 1.0)
        } else {
            0.0
        }
    }

    /// The number of innovations that the averages rest on.
    pub fn effective_count(&self) -> f64 {
        self.weight
    }
}

fn average(mean: &mut f64, weight: &mut f64, forgetting: f64, value: f64) {
    *weight = *weight * forgetting + 1.0;
    *mean += (value - *mean) / *weight;
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn white_innovations_of_unit_variance_read_one_and_zero() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let mut monitor = InnovationMonitor::new(5_000);
        for _ in 0..20_000 {
            // Sum of twelve uniforms: variance 1.
            let sum: f64 = (0..12).map(|_| random.random::<f64>()).sum();
            monitor.push(sum - 6.0);
        }
        assert!((monitor.mean_square() - 1.0).abs() < 0.06);
        assert!(monitor.correlation().abs() < 0.05);
    }

    #[test]
    fn a_constant_innovation_is_fully_correlated() {
        let mut monitor = InnovationMonitor::new(100);
        for _ in 0..50 {
            monitor.push(0.5);
        }
        assert!((monitor.correlation() - 1.0).abs() < 1e-12);
        assert!((monitor.mean_square() - 0.25).abs() < 1e-12);
    }
}
