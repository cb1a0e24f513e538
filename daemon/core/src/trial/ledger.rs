//! Errors of a model by day and by place, within bounded memory.

use std::collections::BTreeMap;

use dynocar_model::simulate::SpeedError;
use serde::{Deserialize, Serialize};

/// Days that are kept, the newest.
const DAYS_MAX: usize = 400;
/// Length of a place along the line in m.
pub const PLACE_M: f64 = 1000.0;
/// Places that are kept, the first that were passed.
const PLACES_MAX: usize = 2000;
const DAY_S: f64 = 86_400.0;

/// A sum of squares in (m/s)² and the samples behind it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sum {
    /// Sum of squares in (m/s)².
    pub squares: f64,
    /// Moving samples.
    pub samples: u64,
}

impl Sum {
    fn add(&mut self, error: SpeedError) {
        self.squares += error.sum_of_squares;
        self.samples += error.count as u64;
    }

    /// Root mean square in m/s; `None` without samples.
    pub fn rmse_mps(&self) -> Option<f64> {
        (self.samples > 0).then(|| (self.squares / self.samples as f64).sqrt())
    }
}

/// Where and when a model erred.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Ledger {
    /// All of it.
    pub all: Sum,
    /// By day, counted from 1970.
    pub days: BTreeMap<i64, Sum>,
    /// By place: chainage in units of [`PLACE_M`], rounded down.
    pub places: BTreeMap<i64, Sum>,
}

impl Ledger {
    /// Books the error over a window that ended at a time in s since 1970; `position_m` is the
    /// chainage of its middle, where it is known.
    pub fn book(&mut self, error: SpeedError, unix_s: f64, position_m: Option<f64>) {
        self.all.add(error);
        self.days.entry((unix_s / DAY_S).floor() as i64).or_default().add(error);
        while self.days.len() > DAYS_MAX {
            self.days.pop_first();
        }
        if let Some(position_m) = position_m {
            let place = (position_m / PLACE_M).floor() as i64;
            if self.places.len() < PLACES_MAX || self.places.contains_key(&place) {
                self.places.entry(place).or_default().add(error);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_and_places_stay_bounded_and_nothing_of_the_whole_is_lost() {
        let mut ledger = Ledger::default();
        for k in 0..5000 {
            let error = SpeedError { sum_of_squares: 2.0, count: 8 };
            ledger.book(error, f64::from(k) * DAY_S, Some(f64::from(k) * PLACE_M + 1.0));
        }
        assert_eq!((ledger.days.len(), ledger.places.len()), (DAYS_MAX, PLACES_MAX));
        assert_eq!(ledger.days.last_key_value().unwrap().0, &4999);
        assert_eq!((ledger.all.samples, ledger.all.rmse_mps()), (40_000, Some(0.5)));
    }
}
