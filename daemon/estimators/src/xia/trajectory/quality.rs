//! Quality of an estimate of (a, b, c): status, reason, excitation.
//!
//! In cruise a and b cannot be distinguished (correlations beyond ±0.9999), while w0 over the
//! driven speeds is known well. The status therefore rests on w0 over the driven speeds; which
//! coefficients the data excited is stated with it.
//!
//! Disturbances that last widen the intervals: gradient errors, wind and force errors last for tens of seconds, but the
//! learned noise is white. Sums of normalised innovations over blocks show the part that white noise leaves out: their
//! mean square over the block's length is 1 for white innovations and the long-run variance otherwise. The estimate is
//! nearly linear in the innovations with weights that change slowly, so that its covariance grows by the same factor
//! (Newey, West 1987, with a flat kernel over blocks).

use dynocar_core::pipeline::InnovationMonitor;
use dynocar_core::pipeline::judge::{Judgement, LONG_RUN_MAX, StatusInputs};
use dynocar_core::pipeline::motion::SpeedRange;
use dynocar_core::pipeline::output::{excitation, write_innovations};
use dynocar_model::train::{Davis, TrainModel};
use dynocar_shared::{Manoeuvre, ParameterSnapshot, Reason, Status};
use nalgebra::{Matrix3, Vector3};

/// Standard deviation of w0, as a share of w0, above which an estimate is degraded.
const W0_DEVIATION_MAX: f64 = 0.1;
/// A coefficient is excited when the data have cut its prior standard deviation to this share.
const EXCITED_SHARE: f64 = 0.5;
/// Returns the standard deviations of declared coefficients: a share of each, or of a fifth of the resistance at the
/// train's highest speed for a coefficient that is declared small or zero.
pub fn prior_std(train: &TrainModel, relative: f64) -> Vector3<f64> {
    let davis = &train.resistance;
    let speed_mps = train.speed_max_mps().filter(|speed| *speed > 1.0).unwrap_or(30.0);
    let typical = 0.2 * davis.w0_n_per_kn(speed_mps).max(2.0);
    Vector3::new(
        relative * davis.a.max(typical),
        relative * davis.b.max(typical / speed_mps),
        relative * davis.c.max(typical / (speed_mps * speed_mps)),
    )
}

/// An estimate with the evidence by which it is judged.
#[derive(Clone, Copy, Debug)]
pub struct DavisEstimate<'a> {
    /// The coefficients.
    pub davis: Davis,
    /// Their covariance.
    pub covariance: Matrix3<f64>,
    /// Their standard deviations before any data.
    pub prior_std: Vector3<f64>,
    /// Speeds behind them.
    pub speeds: SpeedRange,
    /// Innovations so far.
    pub innovations: &'a InnovationMonitor,
    /// Factor by which disturbances that last have widened the covariance.
    pub inflation: f64,
    /// True when enough samples were used.
    pub is_ready: bool,
    /// True when a coefficient lies at a bound.
    pub is_at_bound: bool,
    /// Why there is no estimate, when something else than the samples is to blame.
    pub fault: Option<(Status, Reason)>,
    /// Fault of the samples.
    pub input: Option<Reason>,
    /// Other contradiction of the estimate.
    pub doubt: Option<Reason>,
}

impl DavisEstimate<'_> {
    /// Returns all that the judge asks for.
    pub fn case(&self) -> StatusInputs {
        let is_finite = self.covariance.iter().all(|entry| entry.is_finite());
        let speeds_mps = self.speeds.get().filter(|_| self.is_ready);
        let is_known = speeds_mps.is_none_or(|(low_mps, high_mps)| {
            [low_mps, 0.5 * (low_mps + high_mps), high_mps].into_iter().all(|speed| {
                let powers = Vector3::new(1.0, speed, speed * speed);
                let variance = (powers.transpose() * self.covariance * powers)[0];
                let w0 = self.davis.w0_n_per_kn(speed).abs().max(0.1);
                variance.max(0.0).sqrt() <= W0_DEVIATION_MAX * w0
            })
        });
        let is_ready = speeds_mps.is_some();
        let failure = (Status::Invalid, Reason::NumericalFailure);
        StatusInputs {
            fault: self.fault.or((is_ready && !is_finite).then_some(failure)),
            input: self.input,
            is_ready,
            is_known,
            lacking: if is_ready { Status::Degraded } else { Status::Unestimated },
            contradiction: self
                .innovations
                .contradiction()
                .or((self.inflation > LONG_RUN_MAX).then_some(Reason::InnovationsNotWhite))
                .or(self.doubt),
            caveat: self.caveat(),
        }
    }

    fn caveat(&self) -> Reason {
        if self.is_at_bound {
            Reason::AtBound
        } else if self.excited() == [true; 3] {
            Reason::None
        } else {
            Reason::WeakExcitation
        }
    }

    /// Returns which coefficients the data distinguished.
    pub fn excited(&self) -> [bool; 3] {
        std::array::from_fn(|i| {
            let std = self.covariance[(i, i)].max(0.0).sqrt();
            self.is_ready && std <= EXCITED_SHARE * self.prior_std[i]
        })
    }

    /// Writes everything but parameters and unexplained force; returns the judgement.
    ///
    /// # Real-time
    ///
    /// Allocates nothing.
    pub fn write(&self, snapshot: &mut ParameterSnapshot) -> Judgement {
        write_innovations(snapshot, self.innovations);
        (snapshot.excited, snapshot.missing_manoeuvres) = excitation(self.excited());
        if self.speeds.get().is_none() {
            snapshot.missing_manoeuvres |= Manoeuvre::Move.bit();
        }
        self.speeds.write(snapshot);
        self.case().verdict().into()
    }
}

/// Time in s of a block.
const BLOCK_S: f64 = 30.0;
/// Blocks before the mean counts.
const BLOCKS_MIN: f64 = 8.0;
/// Standard deviations by which the mean must exceed 1 to count.
const SIGNIFICANCE: f64 = 1.0;
/// A block counts for no more than this, so that one jump does not widen the intervals for long.
const BLOCK_SQUARE_MAX: f64 = 25.0;

/// Mean square of block sums of normalised innovations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LongRunVariance {
    memory: f64,
    sum: f64,
    count: f64,
    time_s: f64,
    mean_square: f64,
    blocks: f64,
}

impl LongRunVariance {
    /// Returns a mean that looks back over `memory_blocks` blocks; infinity for all of them.
    pub fn new(memory_blocks: f64) -> Self {
        LongRunVariance {
            memory: memory_blocks,
            sum: 0.0,
            count: 0.0,
            time_s: 0.0,
            mean_square: 0.0,
            blocks: 0.0,
        }
    }

    /// Takes in a normalised innovation after a step of a given time.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn push(&mut self, normalised: f64, duration_s: f64) {
        self.sum += normalised;
        self.count += 1.0;
        self.time_s += duration_s;
        if self.time_s < BLOCK_S {
            return;
        }
        let square = (self.sum * self.sum / self.count).min(BLOCK_SQUARE_MAX);
        self.blocks = (self.blocks + 1.0).min(self.memory);
        self.mean_square += (square - self.mean_square) / self.blocks;
        self.break_here();
    }

    /// Forgets the block that is being filled, so that none reaches across a gap.
    pub fn break_here(&mut self) {
        self.sum = 0.0;
        self.count = 0.0;
        self.time_s = 0.0;
    }

    /// Returns the factor on the covariance, at least 1.
    pub fn inflation(&self) -> f64 {
        let chance = 1.0 + SIGNIFICANCE * (2.0 / self.blocks.max(1.0)).sqrt();
        if self.blocks >= BLOCKS_MIN && self.mean_square > chance { self.mean_square } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimate(monitor: &InnovationMonitor, covariance: Matrix3<f64>) -> DavisEstimate<'_> {
        let mut speeds = SpeedRange::default();
        [75.0, 84.0].into_iter().for_each(|speed_mps| speeds.push(speed_mps));
        DavisEstimate {
            davis: Davis { a: 1.0, b: 0.02, c: 0.001 },
            covariance,
            prior_std: Vector3::new(0.5, 0.01, 0.0005),
            speeds,
            innovations: monitor,
            inflation: 1.0,
            is_ready: true,
            is_at_bound: false,
            fault: None,
            input: None,
            doubt: None,
        }
    }

    /// Known at 80 m/s alone: a = -80 b in every direction but one.
    fn cruise_covariance() -> Matrix3<f64> {
        let slack = Vector3::new(0.8, -0.01, 0.0);
        slack * slack.transpose() + Matrix3::from_diagonal(&Vector3::new(1e-6, 1e-10, 1e-14))
    }

    #[test]
    fn cruise_gives_an_estimate_that_says_what_it_lacks() {
        let monitor = InnovationMonitor::new(100);
        let estimate = estimate(&monitor, cruise_covariance());
        assert_eq!(estimate.case().verdict(), (Status::Estimated, Reason::WeakExcitation));
        assert_eq!(estimate.excited(), [false, false, true]);
        let mut snapshot = ParameterSnapshot::empty();
        estimate.write(&mut snapshot);
        assert_eq!(snapshot.excited, 0b100);
        let expected = Manoeuvre::CoastSlow.bit() | Manoeuvre::VarySpeed.bit();
        assert_eq!(snapshot.missing_manoeuvres, expected);
    }

    #[test]
    fn an_uncertain_resistance_degrades_the_estimate() {
        let monitor = InnovationMonitor::new(100);
        let covariance = Matrix3::from_diagonal(&Vector3::new(9.0, 0.0, 0.0));
        let estimate = estimate(&monitor, covariance);
        assert_eq!(estimate.case().verdict(), (Status::Degraded, Reason::WeakExcitation));
    }

    #[test]
    fn correlated_innovations_degrade_the_estimate() {
        let mut monitor = InnovationMonitor::new(100);
        (0..200).for_each(|_| monitor.push(1.0));
        let estimate = estimate(&monitor, cruise_covariance());
        assert_eq!(estimate.case().verdict(), (Status::Degraded, Reason::InnovationsNotWhite));
    }
}

#[cfg(test)]
mod long_run_tests {
    use super::*;

    use rand::{RngExt, SeedableRng};

    /// Twelve uniforms: mean 0, variance 1.
    fn normal(random: &mut rand_chacha::ChaCha8Rng) -> f64 {
        (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0
    }

    #[test]
    fn white_innovations_widen_nothing_and_lasting_ones_do() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let mut white = LongRunVariance::new(60.0);
        let mut lasting = LongRunVariance::new(60.0);
        let mut level = 0.0;
        for _ in 0..20_000 {
            let shock = normal(&mut random);
            white.push(shock, 0.2);
            level = 0.8 * level + 0.6 * shock;
            lasting.push(level, 0.2);
        }
        assert_eq!(white.inflation(), 1.0);
        // (1 + 0.8) / (1 - 0.8) for an autoregression of 0.8.
        assert!((6.0..12.0).contains(&lasting.inflation()), "{}", lasting.inflation());
    }

    #[test]
    fn a_gap_drops_the_open_block() {
        let mut variance = LongRunVariance::new(60.0);
        for _ in 0..100 {
            variance.push(1.0, 29.0);
            variance.break_here();
        }
        assert_eq!(variance.inflation(), 1.0);
    }
}
