//! Liu 2018: the recursions, and the coasting segments that they run on.
//!
//! # Coasting segments
//!
//! Regression data from coasting are least-squares slopes of half-overlapping segments (figure 2): a segment is so long
//! that the speed changes by 0.5 km/h, and the next starts in its middle. This module departs from the paper in three
//! ways. A segment's length is set when it starts, from the resistance known so far: if it ended where a noisy speed
//! first crosses its bound, it would be too short on average and w0 would come out 1.7 % low. The regressors are the
//! slopes of the integrals of 1, v, v² over the same samples, so that they weight the speeds as the slope does. Spikes
//! are refused before they reach a segment.

use dynocar_core::filter::{FittedLine, Gaussian, Mils, NotPositiveDefinite, Penalty, Rls};
use dynocar_core::pipeline::momentum::{
    DataSettings, MomentumColumns, PARAMETERS, SPEED_SCALE_MPS, SpeedWatch, UNKNOWNS, UnitSample,
    resistance_integral, trapezoids,
};
use dynocar_core::pipeline::motion::SpeedNoise;
use dynocar_model::train::Davis;
use dynocar_shared::RejectionReason;

use crate::resistance::noise_bank::NoiseBank;
use crate::resistance::regression::{CoastingSegment, RegressionSolution, Unknowns, WhiteRow};
use crate::resistance::settings::{INNOVATION_LENGTH_MAX, MilsSettings, RlsSettings};

/// Up to this force in N per kN of weight the train counts as coasting.
const COASTING_MAX: f64 = 0.05;
/// After this time in s a chain starts anew, so that its times and integrals stay small.
const CHAIN_MAX_S: f64 = 600.0;
/// Shortest and longest half segment in s.
const HALF_S: (f64, f64) = (0.4, 10.0);
/// Fewest samples in a half segment.
const HALF_COUNT_MIN: f64 = 2.0;

/// Half a segment: lines through the momentum less the known impulse, through each regressor's
/// integral, and through the speed less all that is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Half {
    columns: [FittedLine; 1 + PARAMETERS],
    rest: FittedLine,
    start_s: f64,
    length_s: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Chain {
    last: UnitSample,
    /// Seconds of coasting before the chain's first segment may start, still to come.
    settling_s: f64,
    /// Integrals since the chain began: of the known forces, then of the regressors.
    integral: [f64; 1 + PARAMETERS],
    half_before: Option<Half>,
    half: Option<Half>,
    row_before: Option<MomentumColumns>,
}

/// Builder of coasting segments from samples.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CoastingSegments {
    settings: DataSettings,
    watch: SpeedWatch,
    chain: Option<Chain>,
}

impl CoastingSegments {
    /// Returns a builder without samples.
    pub fn new(settings: DataSettings) -> Self {
        CoastingSegments { settings, watch: SpeedWatch::new(settings.spike_mps), chain: None }
    }

    /// Returns the noise of the speed so far.
    pub fn noise(&self) -> &SpeedNoise {
        &self.watch.noise
    }

    /// Ends the chain: the next sample starts a new one.
    pub fn break_chain(&mut self) {
        self.chain = None;
    }

    /// Takes in a sample that moves; gives the segment that it closes.
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
    ) -> Result<Option<CoastingSegment>, RejectionReason> {
        self.watch.noise.rounding.see(now.speed_mps);
        if now.traction > COASTING_MAX || now.brake > COASTING_MAX {
            self.chain = None;
            return Ok(None);
        }
        let settle_s = self.settings.coasting_settle_s;
        let continues = |chain: &&mut Chain| {
            chain.last.segment == now.segment && chain.integral[1] < CHAIN_MAX_S
        };
        let Some(chain) = self.chain.as_mut().filter(continues) else {
            self.chain = Some(Chain::start(now, settle_s));
            return Ok(None);
        };
        if let Some(is_believed) = self.watch.judge(&chain.last, now, known) {
            if is_believed {
                self.chain = Some(Chain::start(now, settle_s));
            }
            return Err(RejectionReason::Outlier);
        }
        chain.advance(now);
        if chain.settling_s > 0.0 {
            return Ok(None);
        }
        Ok(chain.gather(now, known, &self.settings, &mut self.watch))
    }
}

impl Chain {
    fn start(first: &UnitSample, settling_s: f64) -> Self {
        Chain {
            last: *first,
            settling_s,
            integral: [0.0; 1 + PARAMETERS],
            half_before: None,
            half: None,
            row_before: None,
        }
    }

    fn advance(&mut self, now: &UnitSample) {
        self.settling_s -= now.seconds_since(&self.last);
        for (sum, area) in self.integral.iter_mut().zip(trapezoids(&self.last, now)) {
            *sum += area;
        }
        self.last = *now;
    }

    fn gather(
        &mut self,
        now: &UnitSample,
        known: &Davis,
        settings: &DataSettings,
        watch: &mut SpeedWatch,
    ) -> Option<CoastingSegment> {
        let time_s = self.integral[1];
        let half = self.half.get_or_insert_with(|| Half::open(now, time_s, known, settings));
        half.add(now, &self.integral, known);
        if time_s - half.start_s < half.length_s || half.rest.count() < HALF_COUNT_MIN {
            return None;
        }
        watch.noise.take_scatter(half.rest.scatter(), half.rest.count() - 2.0);
        let closed = self.half.take()?;
        let before = self.half_before.replace(closed)?;
        let row = before.slopes(&closed)?;
        let row_before = self.row_before.replace(row);
        let speed_variance = watch.noise.variance().max(watch.noise.rounding.variance());
        Some(CoastingSegment {
            is_first: row_before.is_none(),
            row,
            row_before: row_before.unwrap_or_default(),
            variance: now.inertia.powi(2) * speed_variance / before.spread(&closed),
            step_s: closed.start_s - before.start_s,
            time_ns: now.time_ns,
            speed_mps: row[2] * SPEED_SCALE_MPS,
        })
    }
}

impl Half {
    fn open(now: &UnitSample, time_s: f64, known: &Davis, settings: &DataSettings) -> Self {
        let retarding = known.w0_n_per_kn(now.speed_mps) - now.driving;
        let half_change_mps = 0.5 * settings.segment_kmh / 3.6;
        let length_s = (half_change_mps * now.inertia / retarding.abs()).clamp(HALF_S.0, HALF_S.1);
        Half { start_s: time_s, length_s, ..Half::default() }
    }

    fn add(&mut self, now: &UnitSample, integral: &[f64; 1 + PARAMETERS], known: &Davis) {
        let time_s = integral[1];
        self.columns[0].push(time_s, integral[0] - now.inertia * now.speed_mps);
        for (line, value) in self.columns[1..].iter_mut().zip(&integral[1..]) {
            line.push(time_s, *value);
        }
        let gained = integral[0] - resistance_integral(known, &integral[1..]);
        self.rest.push(time_s, now.speed_mps - gained / now.inertia);
    }

    /// Returns the slopes over this half and the next.
    fn slopes(&self, next: &Half) -> Option<MomentumColumns> {
        let mut row = MomentumColumns::zeros();
        for column in 0..1 + PARAMETERS {
            row[column] = self.columns[column].joined(&next.columns[column]).slope()?;
        }
        Some(row)
    }

    /// Returns the sum of squares of the times over this half and the next.
    fn spread(&self, next: &Half) -> f64 {
        self.rest.joined(&next.rest).spread()
    }
}

/// One of the paper's algorithms.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "one stands in each pipeline, where it stays")]
pub enum Solver {
    /// All rows at once: the mixture of the noise bank itself is the estimate.
    Batch,
    /// Recursive least squares.
    Rls(Rls<UNKNOWNS>),
    /// Multi-innovation least squares; regularised RLS is its case of length 1.
    Mils {
        /// The recursion.
        recursion: Mils<UNKNOWNS, INNOVATION_LENGTH_MAX>,
        /// Robust standard deviations beyond which a row is bad, where the interval varies with bad rows.
        bad_beyond: Option<f64>,
    },
}

/// Variances of the errors of the forces, by the settings.
fn force_variances(data: &DataSettings) -> [f64; UNKNOWNS - PARAMETERS] {
    let (scale, delay) = (data.force_scale_std.powi(2), data.force_delay_std_s.powi(2));
    [scale, scale, delay]
}

fn start(data: &DataSettings, variance: f64, uses: f64) -> Unknowns {
    let forces = force_variances(data);
    Unknowns::from_fn(|i, _| match i.checked_sub(PARAMETERS) {
        None => variance,
        // A recursion that uses every row p times needs the priors p times as strong.
        Some(force) => forces[force] / uses,
    })
}

/// Returns the weights of the noise bank's penalty: lambda/2 on the resistance, the forces' own priors.
pub fn bank_penalty(data: &DataSettings, lambda: f64) -> Unknowns {
    let forces = force_variances(data);
    Unknowns::from_fn(|i, _| match i.checked_sub(PARAMETERS) {
        None => 0.5 * lambda,
        Some(force) => 1.0 / forces[force],
    })
}

impl Solver {
    /// Recursive least squares (eq. 9-11).
    pub fn rls(settings: &RlsSettings) -> Self {
        let variances = start(&settings.data, settings.start_variance, 1.0);
        Solver::Rls(Rls::new(Unknowns::zeros(), &variances, settings.forgetting))
    }

    /// Regularised multi-innovation least squares of a length, 1 for regularised RLS (eq. 12-16); with
    /// an interval that varies where bad rows are left out.
    pub fn mils(settings: &MilsSettings, length: usize, bad_beyond: Option<f64>) -> Self {
        let lambda = Unknowns::from_fn(|i, _| if i < PARAMETERS { settings.lambda } else { 0.0 });
        let penalty =
            Penalty { lambda, length: settings.length, is_printed: settings.printed_penalty };
        let variances = start(&settings.data, settings.start_variance, length as f64);
        let recursion = Mils::new(Unknowns::zeros(), &variances, length, penalty);
        Solver::Mils { recursion, bad_beyond }
    }

    /// Robust standard deviations beyond which a row must not be used.
    pub fn bad_beyond(&self, otherwise: f64) -> f64 {
        match self {
            Solver::Mils { bad_beyond: Some(bad_beyond), .. } => *bad_beyond,
            _ => otherwise,
        }
    }

    /// Takes in a row that the noise bank has accepted.
    ///
    /// # Errors
    ///
    /// When the recursion's covariance is no longer positive definite.
    pub fn take(&mut self, row: &WhiteRow) -> Result<(), NotPositiveDefinite> {
        match self {
            Solver::Batch => Ok(()),
            Solver::Rls(rls) => rls.update(&row.features, row.observed).map(drop),
            Solver::Mils { recursion, .. } => {
                recursion.update(&row.features, row.observed).map(drop)
            }
        }
    }

    /// Goes on from the bank's likeliest member, whose rows were whitened otherwise than the
    /// ones taken in so far.
    pub fn restart(&mut self, bank: &NoiseBank) {
        let Some(RegressionSolution { estimate, covariance }) = bank.likeliest_solution() else {
            return;
        };
        match self {
            Solver::Batch => {}
            Solver::Rls(rls) => rls.belief = Gaussian { mean: estimate, covariance },
            Solver::Mils { recursion, .. } => recursion.restart(estimate, covariance),
        }
    }

    /// Goes on after a row that was refused: a stack of innovations must not hold it.
    pub fn skip(&mut self) {
        if let Solver::Mils { recursion, bad_beyond: Some(_) } = self {
            recursion.forget_rows();
        }
    }

    /// Returns the solution so far; `None` while there is none.
    pub fn solution(&self, bank: &NoiseBank) -> Option<RegressionSolution> {
        let (estimate, covariance) = match self {
            Solver::Batch => return bank.mixture,
            Solver::Rls(rls) => (rls.belief.mean, rls.belief.covariance),
            Solver::Mils { recursion, .. } => (*recursion.estimate(), recursion.covariance()),
        };
        bank.widened(&RegressionSolution { estimate, covariance })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::resistance::test_runs::{driven, normal};
    use dynocar_core::pipeline::momentum::scaled;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    const DAVIS: Davis = Davis { a: 2.2, b: 0.09, c: 0.0168 };

    fn segments_of(samples: &[UnitSample]) -> Vec<CoastingSegment> {
        let mut builder = CoastingSegments::new(DataSettings::default());
        samples.iter().filter_map(|sample| builder.push(sample, &DAVIS).unwrap()).collect()
    }

    /// Returns the resistance of a segment over the true one of its regressors, less one.
    fn relative_error(segment: &CoastingSegment) -> f64 {
        let truth: f64 = (0..PARAMETERS).map(|i| scaled(&DAVIS)[i] * segment.row[i + 1]).sum();
        segment.row[0] / truth - 1.0
    }

    #[test]
    fn a_segment_of_a_noiseless_train_gives_its_resistance() {
        let segments = segments_of(&driven(&DAVIS, 20.0, 0.0, 0.2));
        assert!(segments.len() > 20);
        assert!(segments[0].is_first && segments[1..].iter().all(|segment| !segment.is_first));
        for segment in &segments {
            assert!(relative_error(segment).abs() < 1e-3);
        }
        for pair in segments.windows(2) {
            assert_eq!(pair[1].row_before, pair[0].row);
        }
    }

    #[test]
    fn noise_neither_biases_segments_nor_correlates_them_otherwise_than_modelled() {
        let clean = driven(&DAVIS, 20.0, 0.0, 0.2);
        let mut random = ChaCha8Rng::seed_from_u64(8);
        let (mut sum, mut square, mut product, mut count) = (0.0, 0.0, 0.0, 0.0);
        for _ in 0..60 {
            let noisy: Vec<_> = clean
                .iter()
                .map(|sample| UnitSample {
                    speed_mps: sample.speed_mps + 0.014 * normal(&mut random),
                    ..*sample
                })
                .collect();
            let errors: Vec<_> = segments_of(&noisy).iter().map(relative_error).collect();
            for pair in errors.windows(2) {
                sum += pair[1];
                square += pair[1] * pair[1];
                product += pair[0] * pair[1];
                count += 1.0;
            }
        }
        let std_of_mean = (square / count).sqrt() / f64::sqrt(count);
        assert!((sum / count).abs() < 3.5 * std_of_mean.max(1e-3), "bias {}", sum / count);
        let correlation = product / square;
        assert!((correlation + 0.25).abs() < 0.07, "correlation {correlation}");
    }

    #[test]
    fn forces_end_a_chain_and_the_next_one_settles_first() {
        let mut samples = driven(&DAVIS, 20.0, 0.0, 0.2);
        samples[100].brake = 5.0;
        let segments = segments_of(&samples);
        let firsts: Vec<_> = segments.iter().filter(|segment| segment.is_first).collect();
        assert_eq!(firsts.len(), 2);
        assert!(firsts[1].time_ns > samples[100].time_ns + 3_000_000_000);
    }
}
