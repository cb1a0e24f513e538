//! The steps that a speed is reported in.

/// Finds the quantum of a speed signal and the noise that it makes.
///
/// Speeds on a grid differ by multiples of its step: the smallest difference ever seen is the step
/// of a coarse signal, and soon all but nothing for a fine one. Without noise it is the least
/// change from one sample to the next, which stands for what a model without any error would make
/// of perfect speeds: no model is that good. A speed that only repeats shows nothing of its step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rounding {
    quantum_mps: f64,
    last_mps: Option<f64>,
}

/// The coarsest step in m/s that speeds are reported in: 1 km/h.
const QUANTUM_MAX_MPS: f64 = 1.0 / 3.6;
/// Below this a difference in m/s is the rounding of the numbers themselves.
const DIFFERENCE_MIN_MPS: f64 = 1e-6;
/// The most samples that are taken to share one rounding error.
const ALIKE_MAX: f64 = 100.0;

impl Default for Rounding {
    fn default() -> Self {
        Rounding { quantum_mps: QUANTUM_MAX_MPS, last_mps: None }
    }
}

impl Rounding {
    /// Takes in the next speed in m/s.
    pub fn see(&mut self, speed_mps: f64) {
        let Some(last_mps) = self.last_mps.replace(speed_mps) else { return };
        let difference_mps = (speed_mps - last_mps).abs();
        if difference_mps > DIFFERENCE_MIN_MPS {
            self.quantum_mps = self.quantum_mps.min(difference_mps);
        }
    }

    /// The quantum in m/s; the coarsest before two different speeds.
    pub fn quantum_mps(&self) -> f64 {
        self.quantum_mps
    }

    /// Variance of rounding in (m/s)².
    pub fn variance(&self) -> f64 {
        self.quantum_mps * self.quantum_mps / 12.0
    }

    /// Variance in (m/s)² such that one may treat a sample as independent of its neighbours, for a
    /// speed of which one value has a variance, rounding included, and which moves by `per_step_mps`
    /// from one sample to the next.
    ///
    /// A speed that hardly moves falls on the same step again and again, so that averaging does not
    /// lessen its rounding error; noise of the size of a step undoes that, by the characteristic
    /// function of the difference of two values (Widrow, Kollár 2008, chapter 19).
    pub fn variance_of_sample(&self, variance: f64, per_step_mps: f64) -> f64 {
        let rounding = self.variance();
        let square = self.quantum_mps * self.quantum_mps;
        let dither = (variance - rounding).max(0.0) / square;
        let likeness = (-4.0 * std::f64::consts::PI.powi(2) * dither).exp();
        let alike = (self.quantum_mps / per_step_mps).clamp(1.0, ALIKE_MAX);
        variance.max(rounding * (1.0 + likeness * (alike - 1.0)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(speeds_mps: impl IntoIterator<Item = f64>) -> Rounding {
        let mut rounding = Rounding::default();
        speeds_mps.into_iter().for_each(|speed_mps| rounding.see(speed_mps));
        rounding
    }

    #[test]
    fn the_grid_of_coarse_speeds_is_found_and_fine_ones_have_none() {
        let exact = |k: i32| 5.0 + 0.06 * f64::from(k) - 1e-4 * f64::from(k * k);
        let coarse = after((0..50).map(|k| (exact(k) / 0.05).round() * 0.05));
        assert!((coarse.quantum_mps() - 0.05).abs() < 1e-9);
        let own = coarse.variance();
        assert!((own - 0.05_f64.powi(2) / 12.0).abs() < 1e-12);
        assert!((coarse.variance_of_sample(own, 0.2) / own - 1.0).abs() < 1e-9);
        assert!((coarse.variance_of_sample(own, 0.01) / own - 5.0).abs() < 1e-9, "alike");
        let dithered = own + 0.025 * 0.025;
        assert!(coarse.variance_of_sample(dithered, 0.01) == dithered, "no longer alike");
        let turning = |k: i32| 5.0 + 0.01 * f64::from(k) - 1e-4 * f64::from(k * k);
        assert!(after((0..100).map(turning)).quantum_mps() < 2e-4);
        assert_eq!(after([3.0, 3.0, 3.0]).quantum_mps(), QUANTUM_MAX_MPS, "nothing is known");
    }
}
