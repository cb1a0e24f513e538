//! Motion of the train that every estimator takes from the samples.
//!
//! - [`STANDING_MPS`], [`MOVING_MPS`], [`BRIDGED_MAX_S`]: speeds at which a train stands or moves, and the longest gap
//!   between samples
//! - [`Trust`], [`OutlierRow`]: how far a measured speed is trusted
//! - [`jump_variance`], [`kink_variance`]: the error of a trapezoid over a step
//! - [`Rounding`], [`SpeedNoise`]: the steps that a speed is reported in, and its noise
//! - [`PositionNoise`]: the noise of a measured position
//! - [`SpeedRange`]: the speeds driven
//! - [`StopWatch`], [`is_same_mass`]: when the mass may have changed

use dynocar_shared::ParameterSnapshot;

use super::admission::limits::{INNOVATION, REPEATED};
use crate::filter::{Gaussian, Innovation, NotPositiveDefinite};

mod noise;

pub use dynocar_model::terms::wheel::STANDING_MPS;
pub use noise::{PositionNoise, Rounding, SpeedNoise};

/// Speed in m/s up to which nothing is learned of a train's motion: holding brakes, slack and starting
/// resistance are no part of the model.
pub const MOVING_MPS: f64 = 1.0;
/// The longest time in s between two samples that is integrated over: missing forces are bridged by the mean of those
/// around them, and records at 1 Hz are used.
pub const BRIDGED_MAX_S: f64 = REPEATED.high;

/// Returns the variance of the impulse per mass that a force brings which changes by so much from one sample to
/// the next: in (m/s)² for a change in m/s², likewise in other units.
///
/// Where within the step h the force changed by a is not known: at once at any moment, the trapezoid
/// errs by up to a h / 2 either way, with a mean square of a² h² / 12. No sample shows that a force
/// never jumps, however straight it has run so far, nor that a reading half way is not a mean.
pub fn jump_variance(change: f64, step_s: f64) -> f64 {
    (step_s * change).powi(2) / 12.0
}

/// Returns the variance in (m/s)² that a force brings whose slope jumps between two samples, from the second
/// difference of its acceleration in m/s².
///
/// A gradient acts over the length of the train, so that its rate is a polygon. Where the slope
/// of the rate jumps by s, at a share f of a step h, the trapezoid errs by s h² f (1 - f) / 2,
/// and the second differences of the two steps are s h (1 - f) and s h f. Over f from 0 to 1
/// the mean square of the error is s² h⁴ / 120, and h²/80 of the sum of the squared second
/// differences.
pub fn kink_variance(second_difference_mps2: f64, step_s: f64) -> f64 {
    (step_s * second_difference_mps2).powi(2) / 80.0
}

/// A normalised innovation beyond which a speed is not believed.
const OUTLIER: f64 = INNOVATION.high;
/// A normalised innovation beyond which a speed counts less (Huber 1964).
const HUBER: f64 = 3.0;
/// After this many outliers in a row the measured speed is believed and the contradicting estimate is not.
const ROW_BELIEVED: u32 = 5;

/// Trust of a filter in a measured speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trust {
    /// Its innovation over the predicted standard deviation.
    pub normalised: f64,
    /// Weight of the measurement against a full one; 0 for an outlier, which is left out.
    pub weight: f64,
}

impl Trust {
    /// Judges a normalised innovation (Huber 1964).
    #[inline]
    pub fn from_normalised(normalised: f64) -> Self {
        let size = normalised.abs();
        let weight = match size > HUBER {
            true if size > OUTLIER => 0.0,
            true => HUBER / size,
            false => 1.0,
        };
        Trust { normalised, weight }
    }

    /// Returns whether the speed is believed as the filter's noise has it.
    #[inline]
    pub fn is_full(&self) -> bool {
        self.weight == 1.0
    }

    /// Returns whether the speed is not believed.
    #[inline]
    pub fn is_outlier(&self) -> bool {
        self.weight == 0.0
    }

    /// Minus the logarithm of its likelihood, up to that of the spread: Huber's, and bounded, so
    /// that no single speed outweighs all before it.
    #[inline]
    pub fn surprise(&self) -> f64 {
        let size = self.normalised.abs().min(OUTLIER);
        if size <= HUBER { 0.5 * size * size } else { HUBER * (size - 0.5 * HUBER) }
    }
}

/// Outliers one after the other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OutlierRow(u32);

impl OutlierRow {
    /// Takes in whether the newest measurement is an outlier; true when it ends a row so long that the
    /// measurements are right.
    #[inline]
    pub fn push(&mut self, is_outlier: bool) -> bool {
        self.0 = if is_outlier { self.0 + 1 } else { 0 };
        let is_believed = self.0 >= ROW_BELIEVED;
        if is_believed {
            self.0 = 0;
        }
        is_believed
    }

    /// Corrects a belief by a measured component as far as it is believed, after a row of outliers by
    /// the measurement alone; gives the innovation and the trust in it.
    ///
    /// # Errors
    ///
    /// When the predicted variance is no positive number.
    #[inline]
    pub fn correct<const N: usize>(
        &mut self,
        belief: &mut Gaussian<N>,
        component: usize,
        measured: f64,
        noise_variance: f64,
    ) -> Result<(Innovation, Trust), NotPositiveDefinite> {
        let innovation = belief.innovation(component, measured, noise_variance)?;
        let trust = Trust::from_normalised(innovation.normalised());
        let is_believed = self.push(trust.is_outlier());
        if trust.is_full() {
            belief.take(component, &innovation, noise_variance);
        } else if !trust.is_outlier() {
            belief.measure(component, measured, noise_variance / trust.weight)?;
        } else if is_believed {
            belief.replace(component, measured, noise_variance);
        }
        Ok((innovation, trust))
    }
}

/// Lowest and highest speed so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpeedRange(Option<(f64, f64)>);

impl SpeedRange {
    /// Goes on from the lowest and the highest speed in m/s driven before.
    pub fn resumed(speeds_mps: Option<(f64, f64)>) -> Self {
        SpeedRange(speeds_mps)
    }

    /// Takes in a speed in m/s.
    pub fn push(&mut self, speed_mps: f64) {
        let (low, high) = self.0.unwrap_or((speed_mps, speed_mps));
        self.0 = Some((low.min(speed_mps), high.max(speed_mps)));
    }

    /// Returns the lowest and highest, in m/s; `None` before the first.
    pub fn get(&self) -> Option<(f64, f64)> {
        self.0
    }

    /// Writes both; 0 before the first.
    pub fn write(&self, snapshot: &mut ParameterSnapshot) {
        (snapshot.speed_min_mps, snapshot.speed_max_mps) = self.0.unwrap_or((0.0, 0.0));
    }
}

/// Masses that differ by less than this share are the same.
const SAME_MASS_SHARE: f64 = 1e-4;

/// Returns true for a mass in kg that says no more than the one before.
pub fn is_same_mass(before_kg: f64, now_kg: f64) -> bool {
    (now_kg / before_kg - 1.0).abs() <= SAME_MASS_SHARE
}

/// Notices when passengers or freight may have changed the mass.
///
/// That is after a standstill of some length, after a gap as long, and in a new run. A run that
/// a clock set back has cut is one, too: nothing is known of the time between.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StopWatch {
    stop_min_ns: i64,
    last: Option<(i64, u32)>,
    standing_since_ns: Option<i64>,
    is_due: bool,
}

impl StopWatch {
    /// A stop counts from `stop_min_s`.
    pub fn new(stop_min_s: f64) -> Self {
        let stop_min_ns = (stop_min_s * 1e9) as i64;
        StopWatch { stop_min_ns, last: None, standing_since_ns: None, is_due: false }
    }

    /// Returns whether no sample has come yet.
    pub fn is_first(&self) -> bool {
        self.last.is_none()
    }

    /// Returns whether the train stands for so long that the mass may have changed.
    pub fn is_due(&self) -> bool {
        self.is_due
    }

    /// Takes one sample in; true at the first moving sample after the mass may have changed.
    pub fn departs(&mut self, time_ns: i64, segment: u32, speed_mps: f64) -> bool {
        if !speed_mps.is_finite() {
            return false;
        }
        if let Some((last_ns, last_segment)) = self.last
            && last_segment != segment
        {
            let gap_ns = time_ns.saturating_sub(last_ns);
            self.is_due |= gap_ns >= self.stop_min_ns || gap_ns <= 0;
        }
        self.last = Some((time_ns, segment));
        if speed_mps <= STANDING_MPS {
            let since_ns = *self.standing_since_ns.get_or_insert(time_ns);
            self.is_due |= time_ns.saturating_sub(since_ns) >= self.stop_min_ns;
            return false;
        }
        self.standing_since_ns = None;
        std::mem::take(&mut self.is_due)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kink_variance_is_the_mean_square_of_the_trapezoids_error_at_a_kink() {
        let (slope, step_s, positions) = (3.0, 0.2, 1000);
        let (mut squares, mut variance) = (0.0, 0.0);
        for k in 0..positions {
            let kink_s = step_s * (k as f64 + 0.5) / positions as f64;
            let rate = |time_s: f64| slope * (time_s - kink_s).max(0.0);
            let rates = [0.0, 0.0, rate(step_s), rate(2.0 * step_s), rate(3.0 * step_s)];
            let exact = 0.5 * slope * (step_s - kink_s).powi(2);
            squares += (0.5 * step_s * rate(step_s) - exact).powi(2);
            for at in 2..5 {
                let (before, now) = (rates[at - 1] - rates[at - 2], rates[at] - rates[at - 1]);
                variance += kink_variance(now - before, step_s);
            }
        }
        assert!((variance / squares - 1.0).abs() < 1e-3, "{variance} and {squares}");
    }
}

#[cfg(test)]
mod outlier_tests {
    use super::*;

    #[test]
    fn a_speed_counts_less_beyond_three_deviations_and_not_at_all_beyond_eight() {
        assert_eq!(Trust::from_normalised(-2.0).weight, 1.0);
        assert_eq!(Trust::from_normalised(6.0).weight, 0.5);
        assert!(
            Trust::from_normalised(8.1).is_outlier()
                && Trust::from_normalised(f64::INFINITY).is_outlier()
        );
        assert_eq!(
            Trust::from_normalised(100.0).surprise(),
            Trust::from_normalised(8.0).surprise()
        );
    }

    #[test]
    fn the_fifth_outlier_in_a_row_is_believed() {
        let mut row = OutlierRow::default();
        let outliers = [true, true, true, true, false, true, true, true, true, true, true];
        let believed = outliers.map(|is_outlier| row.push(is_outlier));
        assert_eq!(believed.iter().position(|it| *it), Some(9));
        assert!(!believed[10], "a new row begins");
    }
}

#[cfg(test)]
mod stop_watch_tests {
    use super::*;

    const SECOND_NS: i64 = 1_000_000_000;

    #[test]
    fn a_stop_is_reported_once_at_departure_and_a_short_one_never() {
        let mut stops = StopWatch::new(5.0);
        let mut departures = Vec::new();
        for second in 0..60 {
            let is_standing = (10..13).contains(&second) || (30..40).contains(&second);
            let speed_mps = if is_standing { 0.0 } else { 10.0 };
            if stops.departs(second * SECOND_NS, 1, speed_mps) {
                departures.push(second);
            }
        }
        assert_eq!(departures, [40]);
    }

    #[test]
    fn a_long_gap_and_a_clock_set_back_count_as_stops_and_a_short_gap_does_not() {
        let mut stops = StopWatch::new(5.0);
        assert!(!stops.departs(0, 1, 10.0));
        assert!(!stops.departs(3 * SECOND_NS, 2, 10.0), "three seconds");
        assert!(stops.departs(9 * SECOND_NS, 3, 10.0), "six seconds");
        assert!(stops.departs(SECOND_NS, 4, 10.0), "set back");
        assert!(!stops.departs(2 * SECOND_NS, 4, 10.0));
    }
}
