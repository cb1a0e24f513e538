//! The noise of a measured position, learned from the positions themselves.

use dynocar_model::force::ResolvedSample;

use super::BRIDGED_MAX_S;

/// Number of differences in the average.
const MEMORY: f64 = 500.0;
/// Number of differences before a noise is reported.
const COUNT_MIN: f64 = 50.0;
/// A difference counts up to this many standard deviations of the known error: a jump of the position is not noise.
const CLIP_DEVIATIONS: f64 = 5.0;

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
        self.count = (self.count + 1.0).min(MEMORY);
        let clip = match self.count > COUNT_MIN {
            true => CLIP_DEVIATIONS * CLIP_DEVIATIONS * self.square_m2,
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
        let is_known = self.count >= COUNT_MIN && self.variance_m2 > 1.5 * declared_m2;
        if is_known { self.variance_m2 } else { declared_m2 }
    }
}

#[cfg(test)]
mod tests {
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
