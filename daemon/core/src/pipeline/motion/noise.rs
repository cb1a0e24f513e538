//! The noise of a measured speed, learned from the speeds themselves, and the steps that it is reported in; the noise
//! of a measured position, learned from the positions themselves.

use dynocar_model::force::ResolvedSample;

use super::BRIDGED_MAX_S;

/// Degrees of freedom that a guess counts for.
const GUESS_FREEDOM: f64 = 2.0;
/// Number of degrees of freedom in the average of the variance.
const MEMORY: f64 = 3000.0;
/// A scatter counts up to this many standard deviations above the expectation of the known variance: a spike too
/// small for the gate would else widen every interval.
const CLIP_DEVIATIONS: f64 = 4.0;
/// Degrees of freedom before a scatter is clipped.
const FREEDOM_BEFORE_CLIP: f64 = 20.0;
/// Least variance of a speed in (m/s)².
const VARIANCE_MIN: f64 = 1e-6;

/// Variance of a speed's white noise, and the steps that the speed is reported in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedNoise {
    /// Variance in (m/s)² before anything was seen, and the degrees of freedom that it counts for.
    first: f64,
    first_freedom: f64,
    variance: f64,
    freedom: f64,
    /// The steps of the signal.
    pub rounding: Rounding,
}

impl SpeedNoise {
    /// Starts without knowledge; until the first scatter the standard deviation of a sample is taken to be this, in
    /// m/s.
    pub fn unknown(first_mps: f64) -> Self {
        let first = first_mps * first_mps;
        let rounding = Rounding::default();
        SpeedNoise { first, first_freedom: 0.0, variance: 0.0, freedom: 0.0, rounding }
    }

    /// Starts at a standard deviation in m/s that counts for two degrees of freedom.
    pub fn guessed(first_mps: f64) -> Self {
        let unknown = Self::unknown(first_mps);
        let (variance, freedom) = (unknown.first, GUESS_FREEDOM);
        SpeedNoise { variance, freedom, first_freedom: freedom, ..unknown }
    }

    /// Takes in the sum of squares, in (m/s)², of `freedom` independent deviations.
    pub fn take_scatter(&mut self, square_sum: f64, freedom: f64) {
        if freedom <= 0.0 || !square_sum.is_finite() {
            return;
        }
        let clipped = match self.freedom > FREEDOM_BEFORE_CLIP {
            true => {
                let most = freedom + CLIP_DEVIATIONS * (2.0 * freedom).sqrt();
                square_sum.min(most * self.variance.max(self.rounding.variance()))
            }
            false => square_sum,
        };
        self.average(clipped, freedom);
    }

    /// Takes in the residual that a filter leaves of a measurement, in m/s, the variance of the filtered speed, and the
    /// weight of the measurement, 1 being a full one.
    ///
    /// After an update, the residual r and the variance P of the filtered speed obey `E(r²) + P = R`
    /// for the variance R of the measurement. A residual counts up to where its weight begins to fall (Huber 1964): a
    /// spike that is not left out would otherwise widen the estimated noise.
    pub fn take_residual(&mut self, residual_mps: f64, filtered_variance: f64, weight: f64) {
        let bounded_mps = weight * residual_mps;
        self.average(bounded_mps * bounded_mps + filtered_variance, 1.0);
    }

    /// The mean over all degrees of freedom, over the newest once they are as many as are looked back over.
    fn average(&mut self, square_sum: f64, freedom: f64) {
        self.freedom = (self.freedom + freedom).min(MEMORY);
        let change = (square_sum - freedom * self.variance) / self.freedom;
        self.variance = (self.variance + change).max(VARIANCE_MIN);
    }

    /// Returns the variance of one speed value in (m/s)²; 0 before the first scatter.
    pub fn variance(&self) -> f64 {
        self.variance
    }

    /// Returns the variance of the mean of `count` values that ran through `range_mps`.
    ///
    /// A speed that hardly moves falls on the same step again and again, so that averaging does
    /// not lessen its rounding error.
    pub fn variance_of_mean(&self, count: f64, range_mps: f64) -> f64 {
        let rounding =
            self.rounding.variance() / count.min(1.0 + range_mps / self.rounding.quantum_mps());
        (self.variance.max(VARIANCE_MIN) / count).max(rounding)
    }

    /// Returns the variance of one value, such that one may treat it as independent of its neighbours;
    /// `per_step_mps` is how far the speed moves from one sample to the next.
    pub fn variance_of_sample(&self, per_step_mps: f64) -> f64 {
        let variance = if self.freedom > 0.0 { self.variance } else { self.first };
        self.rounding.variance_of_sample(variance, per_step_mps)
    }

    /// Back to the start, but for the steps of the signal.
    pub fn reset(&mut self) {
        self.freedom = self.first_freedom;
        self.variance = if self.freedom > 0.0 { self.first } else { 0.0 };
    }
}

/// Finds the quantum of a speed signal and the noise that it makes.
///
/// Speeds on a grid differ by multiples of its step: the smallest difference ever seen is the step
/// of a coarse signal, and soon all but nothing for a fine one. Without noise the quantum is the least change from one
/// sample to the next. It stands for the residual that a model without any error would leave of perfect speeds: no
/// model is that good. A speed that only repeats shows nothing of its step.
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

    /// Returns the quantum in m/s; the coarsest before two different speeds.
    pub fn quantum_mps(&self) -> f64 {
        self.quantum_mps
    }

    /// Returns the variance of rounding in (m/s)².
    pub fn variance(&self) -> f64 {
        self.quantum_mps * self.quantum_mps / 12.0
    }

    /// Returns the variance in (m/s)² such that one may treat a sample as independent of its neighbours, for a
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

/// Number of differences in the average.
const DIFFERENCES_MAX: f64 = 500.0;
/// Number of differences before a noise is reported.
const DIFFERENCES_MIN: f64 = 50.0;
/// A difference counts up to this many standard deviations of the known error: a jump of the position is not noise.
const DIFFERENCE_CLIP_DEVIATIONS: f64 = 5.0;

/// Variance of a position's white noise.
///
/// A position moves on by the integral of the speed. The residual of a step is the noise at its end less the noise at
/// its beginning, so that neighbouring steps share one noise with opposite signs: the product of successive residuals
/// has the mean `-R`, regardless of a slow scale error or drift.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PositionNoise {
    last: Option<PositionPair>,
    rest_m: Option<f64>,
    variance_m2: f64,
    square_m2: f64,
    count: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct PositionPair {
    segment: u32,
    time_ns: i64,
    along_m: f64,
    speed_mps: f64,
}

impl PositionNoise {
    /// Takes a sample in.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn see(&mut self, sample: &ResolvedSample) {
        let Some(position_m) = sample.position_m.filter(|_| !sample.is_sliding) else {
            (self.last, self.rest_m) = (None, None);
            return;
        };
        let now = PositionPair {
            segment: sample.segment,
            time_ns: sample.time_ns,
            along_m: sample.direction * position_m,
            speed_mps: sample.speed_mps,
        };
        let rest_m = self.last.replace(now).and_then(|last| {
            let step_s = now.time_ns.saturating_sub(last.time_ns) as f64 * 1e-9;
            let is_step = last.segment == now.segment && step_s > 0.0 && step_s <= BRIDGED_MAX_S;
            let driven_m = 0.5 * step_s * (last.speed_mps + now.speed_mps);
            is_step.then_some(now.along_m - last.along_m - driven_m)
        });
        let before_m = std::mem::replace(&mut self.rest_m, rest_m);
        let (Some(rest_m), Some(before_m)) = (rest_m, before_m) else { return };
        self.count = (self.count + 1.0).min(DIFFERENCES_MAX);
        let clip = match self.count > DIFFERENCES_MIN {
            true => DIFFERENCE_CLIP_DEVIATIONS * DIFFERENCE_CLIP_DEVIATIONS * self.square_m2,
            false => f64::INFINITY,
        };
        let square_m2 = (rest_m * rest_m).min(clip);
        self.square_m2 += (square_m2 - self.square_m2) / self.count;
        let shared_m2 = (-rest_m * before_m).clamp(-clip, clip);
        self.variance_m2 += (shared_m2 - self.variance_m2) / self.count;
    }

    /// Returns the variance of one position in m², at least that of a sensor as it is declared, which is taken
    /// until the positions contradict it by more than chance.
    pub fn variance_m2(&self, declared_m2: f64) -> f64 {
        let is_known = self.count >= DIFFERENCES_MIN && self.variance_m2 > 1.5 * declared_m2;
        if is_known { self.variance_m2 } else { declared_m2 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn a_filter_of_a_constant_finds_the_noise_of_its_measurements() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let mut noise = SpeedNoise::guessed(0.2);
        let (mut estimate, mut variance) = (0.0, 1.0);
        for _ in 0..5_000 {
            // Uniform between -1 and 1: variance 1/3.
            let measured = 2.0 * random.random::<f64>() - 1.0;
            let gain = variance / (variance + noise.variance());
            estimate += gain * (measured - estimate);
            variance *= 1.0 - gain;
            noise.take_residual(measured - estimate, variance, 1.0);
            variance += 1e-3;
        }
        assert!((noise.variance() - 1.0 / 3.0).abs() < 0.05, "{}", noise.variance());
        noise.reset();
        assert!((noise.variance() - 0.04).abs() < 1e-15);
    }

    #[test]
    fn rounding_of_a_steady_speed_does_not_average_out() {
        let mut noise = SpeedNoise::unknown(0.05);
        for speed_mps in [5.0, 5.1, 5.1, 5.2] {
            noise.rounding.see(speed_mps);
        }
        let rounding = 0.1_f64.powi(2) / 12.0;
        assert!((noise.rounding.variance() - rounding).abs() < 1e-12);
        assert!((noise.variance_of_mean(25.0, 0.0) - rounding).abs() < 1e-9);
        assert!((noise.variance_of_mean(25.0, 10.0) - rounding / 25.0).abs() < 1e-9);
        assert!((noise.variance_of_sample(0.2) - 0.05_f64.powi(2)).abs() < 1e-9, "no scatter yet");
        noise.take_scatter(0.0, 10.0);
        assert!((noise.variance_of_sample(0.2) - rounding).abs() < 1e-9);
        assert!((noise.variance_of_sample(0.01) - 10.0 * rounding).abs() < 1e-9);
    }

    #[test]
    fn one_wild_scatter_hardly_moves_the_variance() {
        let mut noise = SpeedNoise::unknown(0.05);
        [5.0, 5.11, 5.13].into_iter().for_each(|speed_mps| noise.rounding.see(speed_mps));
        for _ in 0..50 {
            noise.take_scatter(10.0 * 4e-4, 10.0);
        }
        noise.take_scatter(10.0 * 4.0, 10.0);
        assert!(noise.variance() < 6e-4);
        noise.take_scatter(f64::NAN, 10.0);
        assert!(noise.variance() < 6e-4);
    }
}

#[cfg(test)]
mod rounding_tests {
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

#[cfg(test)]
mod position_noise_tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    /// Returns the standard deviation in m after positions with white noise of a deviation, an odometer that is
    /// wrong by so much, and a jump of 300 m.
    fn learned(std_m: f64, odometer_share: f64) -> f64 {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(4);
        let mut noise = PositionNoise::default();
        for tick in 0..3000_u32 {
            let normal: f64 = (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
            let jump_m = if tick == 1500 { 300.0 } else { 0.0 };
            let true_m = 2.0 * f64::from(tick) * (1.0 + odometer_share);
            noise.see(&ResolvedSample {
                time_ns: i64::from(tick) * 100_000_000,
                position_m: Some(true_m + jump_m + std_m * normal),
                ..ResolvedSample::coasting()
            });
        }
        noise.variance_m2(0.01).sqrt()
    }

    #[test]
    fn white_noise_is_found_next_to_a_wrong_scale_and_a_jump() {
        assert!((learned(0.5, 0.0) - 0.5).abs() < 0.08);
        assert!((learned(3.0, 0.01) - 3.0).abs() < 0.5);
        assert_eq!(learned(0.05, 0.002), 0.1, "no better than declared");
    }
}
