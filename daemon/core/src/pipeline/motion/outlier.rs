//! How far a measured speed is believed.

/// A normalised innovation beyond which a speed is not believed.
const OUTLIER: f64 = 8.0;
/// A normalised innovation beyond which a speed counts less (Huber 1964).
const HUBER: f64 = 3.0;
/// After so many outliers in a row the measured speed is believed and what contradicts it is not.
const ROW_BELIEVED: u32 = 5;

/// What a filter makes of a measured speed.
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
    pub fn of(normalised: f64) -> Self {
        let size = normalised.abs();
        let weight = match size > HUBER {
            true if size > OUTLIER => 0.0,
            true => HUBER / size,
            false => 1.0,
        };
        Trust { normalised, weight }
    }

    /// True when the speed is believed as the filter's noise has it.
    #[inline]
    pub fn is_full(&self) -> bool {
        self.weight == 1.0
    }

    /// True when the speed is not believed.
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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_speed_counts_less_beyond_three_deviations_and_not_at_all_beyond_eight() {
        assert_eq!(Trust::of(-2.0).weight, 1.0);
        assert_eq!(Trust::of(6.0).weight, 0.5);
        assert!(Trust::of(8.1).is_outlier() && Trust::of(f64::INFINITY).is_outlier());
        assert_eq!(Trust::of(100.0).surprise(), Trust::of(8.0).surprise());
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
