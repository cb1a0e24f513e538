//! When passengers or freight may have changed the mass.

use super::STANDING_MPS;

/// Masses that differ by less than this share are the same.
const SAME_MASS_SHARE: f64 = 1e-4;

/// True for a mass in kg that says no more than the one before.
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

    /// True before the first sample.
    pub fn is_first(&self) -> bool {
        self.last.is_none()
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
