//! Regression data from measured forces: means of short blocks, and the impulse from one block to the next.
//!
//! A row compares the change of the mean momentum from one block to the next with the impulse of
//! the known forces. All speeds of a block are used, so that white noise averages out, and the
//! regressors are integrals of powers of the speed, not powers of its mean. Neighbouring rows share the mean of a block
//! (their errors correlate by -1/2); the whitener that follows accounts for this, so that short blocks lose no
//! information.

use dynocar_model::train::Davis;
use dynocar_shared::RejectionReason;

use super::{
    BRAKE_SCALE, DataSettings, FORCE_DELAY, MomentumBlock, MomentumColumns, SinceBlock, SpeedWatch,
    TRACTION_SCALE, UnitSample, resistance_integral, trapezoids,
};
use crate::filter::FittedLine;
use crate::pipeline::motion::{SpeedNoise, jump_variance};

/// Fewest samples in a block: the scatter about a line needs three.
const COUNT_MIN: f64 = 3.0;

/// Sums over the samples of a block.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Block {
    first: UnitSample,
    /// Time in s from the mean of the block before to the first sample.
    start_s: f64,
    speed_sum: f64,
    integral_sum: MomentumColumns,
    /// The speed less the part that the forces explain, over time: its scatter is noise.
    rest: FittedLine,
    edge_variance: f64,
    speed_min_mps: f64,
    speed_max_mps: f64,
}

/// An unbroken row of samples.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Chain {
    start_ns: i64,
    last: UnitSample,
    /// Integral of each column since the mean of the block before.
    integral: MomentumColumns,
    block: Block,
    /// Variance of the impulse in the block before; `None` in the first block.
    variance_before: Option<f64>,
}

/// Builds [`MomentumBlock`]s from samples.
#[derive(Clone, Debug, PartialEq)]
pub struct MomentumBlocks {
    settings: DataSettings,
    watch: SpeedWatch,
    chain: Option<Chain>,
}

impl MomentumBlocks {
    /// Returns a builder without samples.
    pub fn new(settings: DataSettings) -> Self {
        MomentumBlocks { settings, watch: SpeedWatch::new(settings.spike_mps), chain: None }
    }

    /// Returns the noise of the speed so far.
    pub fn noise(&self) -> &SpeedNoise {
        &self.watch.noise
    }

    /// Returns the time in ns of the first sample of the chain; `None` between chains.
    pub fn chain_start_ns(&self) -> Option<i64> {
        self.chain.as_ref().map(|chain| chain.start_ns)
    }

    /// Returns the integrals since the middle of the newest block; `None` before the first of a chain.
    pub fn since_block(&self) -> Option<SinceBlock> {
        let chain = self.chain.as_ref().filter(|chain| chain.variance_before.is_some())?;
        Some(SinceBlock { impulse: chain.integral, inertia: chain.last.inertia })
    }

    /// Ends the chain: the next sample starts a new one.
    pub fn break_chain(&mut self) {
        self.chain = None;
    }

    /// Takes in a sample that moves; gives the block that it closes. `known` is the resistance
    /// as far as it is known, for detecting spikes.
    ///
    /// # Errors
    ///
    /// [`RejectionReason::Outlier`] for a spike of the speed.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn push(
        &mut self,
        now: &UnitSample,
        known: &Davis,
    ) -> Result<Option<MomentumBlock>, RejectionReason> {
        self.watch.noise.rounding.see(now.speed_mps);
        let Some(chain) = self.chain.as_mut().filter(|chain| chain.last.segment == now.segment)
        else {
            self.chain = Some(Chain::start(now));
            return Ok(None);
        };
        if let Some(is_believed) = self.watch.judge(&chain.last, now, known) {
            if is_believed {
                self.chain = Some(Chain::start(now));
            }
            return Err(RejectionReason::Outlier);
        }
        chain.advance(now, known);
        if chain.integral[1] - chain.block.start_s < self.settings.block_s
            || chain.block.rest.count() < COUNT_MIN
        {
            return Ok(None);
        }
        let rest = &chain.block.rest;
        self.watch.noise.take_scatter(rest.scatter(), rest.count() - 2.0);
        let range_mps = chain.block.speed_max_mps - chain.block.speed_min_mps;
        let speed_variance = self.watch.noise.variance_of_mean(rest.count(), range_mps);
        Ok(Some(chain.close(speed_variance, &self.settings)))
    }
}

impl Chain {
    fn start(first: &UnitSample) -> Self {
        let mut chain = Chain {
            start_ns: first.time_ns,
            last: *first,
            integral: MomentumColumns::zeros(),
            block: Block::open(first, 0.0),
            variance_before: None,
        };
        chain.block.add(first, &chain.integral, 0.0);
        chain
    }

    fn advance(&mut self, now: &UnitSample, known: &Davis) {
        let before = self.last;
        for (column, area) in trapezoids(&before, now).into_iter().enumerate() {
            self.integral[column] += area;
        }
        let step_s = now.seconds_since(&before);
        let change = (now.traction - now.brake) - (before.traction - before.brake);
        self.integral[1 + TRACTION_SCALE] -= 0.5 * step_s * (before.traction + now.traction);
        self.integral[1 + BRAKE_SCALE] += 0.5 * step_s * (before.brake + now.brake);
        // A force that acts later by d has given d times its change less.
        self.integral[1 + FORCE_DELAY] += change;
        self.block.edge_variance += jump_variance(change, step_s);
        let gained = self.integral[0] - resistance_integral(known, &self.integral.as_slice()[1..]);
        self.block.add(now, &self.integral, gained / now.inertia);
        self.last = *now;
    }

    fn close(&mut self, speed_variance: f64, settings: &DataSettings) -> MomentumBlock {
        let block = &self.block;
        let count = block.rest.count();
        let inertia = self.last.inertia;
        let mean_integral = block.integral_sum / count;
        let variance = block.impulse_variance(&self.last, settings);
        let closed = MomentumBlock {
            is_first: self.variance_before.is_none(),
            momentum: inertia * block.speed_sum / count,
            momentum_variance: inertia * inertia * speed_variance,
            impulse: mean_integral,
            impulse_variance: 0.5 * (variance + self.variance_before.unwrap_or(variance)),
            time_ns: self.last.time_ns,
            speed_mps: block.speed_sum / count,
        };
        self.integral -= mean_integral;
        self.variance_before = Some(variance);
        self.block = Block::open(&self.last, self.integral[1]);
        closed
    }
}

impl Block {
    fn open(first: &UnitSample, start_s: f64) -> Self {
        Block {
            first: *first,
            start_s,
            speed_sum: 0.0,
            integral_sum: MomentumColumns::zeros(),
            rest: FittedLine::default(),
            edge_variance: 0.0,
            speed_min_mps: f64::INFINITY,
            speed_max_mps: 0.0,
        }
    }

    fn add(&mut self, now: &UnitSample, integral: &MomentumColumns, gained_mps: f64) {
        self.speed_sum += now.speed_mps;
        self.integral_sum += integral;
        self.rest.push(integral[1] - self.start_s, now.speed_mps - gained_mps);
        self.speed_min_mps = self.speed_min_mps.min(now.speed_mps);
        self.speed_max_mps = self.speed_max_mps.max(now.speed_mps);
    }

    /// Returns the variance of the impulse because the moments and places at which the forces acted are uncertain.
    fn impulse_variance(&self, last: &UnitSample, settings: &DataSettings) -> f64 {
        let speed_mps = (self.speed_sum / self.rest.count()).max(settings.speed_min_mps);
        let place = settings.position_std_m / speed_mps * (last.known - self.first.known);
        self.edge_variance + place * place
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::momentum::tests::{driven, unit_sample};
    use crate::pipeline::momentum::{PARAMETERS, scaled};

    const DAVIS: Davis = Davis { a: 1.5, b: 0.04, c: 0.003 };

    fn blocks_of(samples: &[UnitSample]) -> Vec<MomentumBlock> {
        let mut builder = MomentumBlocks::new(DataSettings::default());
        samples.iter().filter_map(|sample| builder.push(sample, &DAVIS).unwrap()).collect()
    }

    #[test]
    fn the_change_of_momentum_is_the_impulse_less_the_resistance() {
        for (speed_mps, driving) in [(25.0, 0.0), (8.0, 12.0), (28.0, -9.0)] {
            let blocks = blocks_of(&driven(&DAVIS, speed_mps, driving, 0.2));
            assert!(blocks.len() >= 10);
            for pair in blocks.windows(2) {
                let resistance: f64 =
                    (0..PARAMETERS).map(|i| scaled(&DAVIS)[i] * pair[1].impulse[i + 1]).sum();
                let gained = pair[1].momentum - pair[0].momentum;
                let balance = gained - (pair[1].impulse[0] - resistance);
                assert!(balance.abs() < 2e-4 * resistance, "off by {balance} N/kN s");
            }
        }
    }

    #[test]
    fn a_new_segment_of_motion_starts_a_new_chain() {
        let mut samples = driven(&DAVIS, 25.0, 0.0, 0.2);
        for sample in &mut samples[150..] {
            sample.segment = 2;
            sample.speed_mps -= 3.0;
        }
        let blocks = blocks_of(&samples);
        let firsts: Vec<_> = blocks.iter().filter(|block| block.is_first).collect();
        assert_eq!(firsts.len(), 2);
        assert!(firsts[1].time_ns >= samples[150].time_ns);
    }

    #[test]
    fn a_force_that_comes_later_shows_in_the_column_of_the_delay() {
        let mut samples = driven(&DAVIS, 15.0, 0.0, 0.2);
        for sample in &mut samples[100..] {
            sample.traction = 10.0;
        }
        let gathered: f64 =
            blocks_of(&samples).iter().skip(1).map(|block| block.impulse[1 + FORCE_DELAY]).sum();
        assert!((gathered - 10.0).abs() < 1e-9);
    }

    #[test]
    fn a_spike_is_left_out_and_the_force_through_it_is_kept() {
        let samples = driven(&DAVIS, 25.0, 5.0, 0.2);
        let clean = blocks_of(&samples);
        let mut builder = MomentumBlocks::new(DataSettings::default());
        let mut blocks = Vec::new();
        for (index, sample) in samples.iter().enumerate() {
            let mut seen = *sample;
            if index == 40 {
                seen.speed_mps += 2.0;
                assert_eq!(builder.push(&seen, &DAVIS), Err(RejectionReason::Outlier));
            } else {
                blocks.extend(builder.push(&seen, &DAVIS).unwrap());
            }
        }
        let last = |blocks: &[MomentumBlock]| blocks[blocks.len() - 1].momentum;
        assert!((last(&blocks) - last(&clean)).abs() < 0.01 * last(&clean));
        assert_eq!(blocks.iter().filter(|block| block.is_first).count(), 1);
    }

    #[test]
    fn a_change_of_gradient_and_of_force_makes_the_impulse_less_certain() {
        let mut samples: Vec<_> =
            (0..100).map(|i| unit_sample(0.2 * f64::from(i), 20.0, 1.0)).collect();
        for sample in &mut samples[40..] {
            sample.known = 8.0;
        }
        let variances: Vec<_> =
            blocks_of(&samples).iter().map(|block| block.impulse_variance).collect();
        assert_eq!(variances[0], 0.0);
        // 3 m at 20 m/s, 8 ‰; half of it in each of the two rows around.
        let most = variances.iter().fold(0.0, |most: f64, value| most.max(*value));
        assert!((most - 0.5 * (3.0 / 20.0 * 8.0_f64).powi(2)).abs() < 1e-9);
    }
}
