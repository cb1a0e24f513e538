//! A step function of the chainage with its integral.

/// Why a list of steps is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ProfileError {
    /// The list is empty.
    #[error("expected at least one entry, got none")]
    Empty,
    /// A number is not finite.
    #[error("entry {index}: expected finite numbers, got {chainage_m} m and {value}")]
    NotFinite {
        /// Number of the entry, from 1.
        index: usize,
        /// Its chainage in m.
        chainage_m: f64,
        /// Its value.
        value: f64,
    },
    /// The chainage does not grow.
    #[error(
        "entry {index}: expected a chainage above the one before ({before_m} m), got {chainage_m} m"
    )]
    NotIncreasing {
        /// Number of the entry, from 1.
        index: usize,
        /// Chainage in m of the entry before it.
        before_m: f64,
        /// Its chainage in m.
        chainage_m: f64,
    },
}

/// A function of the chainage that holds each entry's value until the next entry; the first
/// value also holds before it.
///
/// A table of equal buckets leads from a chainage to its entry without a search, so that a
/// look-up costs the same for ten entries and for ten thousand.
#[derive(Clone, Debug, PartialEq)]
pub struct StepProfile {
    starts_m: Vec<f64>,
    values: Vec<f64>,
    /// Integral of the function from the first entry to each entry.
    cumulative: Vec<f64>,
    /// The entry that holds at each bucket's start.
    buckets: Vec<u32>,
    buckets_per_m: f64,
}

impl StepProfile {
    /// Returns a profile from (chainage in m, value) entries of strictly increasing chainage.
    ///
    /// # Errors
    ///
    /// See [`ProfileError`].
    pub fn new(entries: &[(f64, f64)]) -> Result<Self, ProfileError> {
        if entries.is_empty() {
            return Err(ProfileError::Empty);
        }
        for (i, &(chainage_m, value)) in entries.iter().enumerate() {
            if !(chainage_m.is_finite() && value.is_finite()) {
                return Err(ProfileError::NotFinite { index: i + 1, chainage_m, value });
            }
            if i > 0 && chainage_m <= entries[i - 1].0 {
                let before_m = entries[i - 1].0;
                return Err(ProfileError::NotIncreasing { index: i + 1, before_m, chainage_m });
            }
        }
        let starts_m: Vec<f64> = entries.iter().map(|entry| entry.0).collect();
        let values: Vec<f64> = entries.iter().map(|entry| entry.1).collect();
        let mut cumulative = vec![0.0; entries.len()];
        for i in 1..entries.len() {
            cumulative[i] = cumulative[i - 1] + values[i - 1] * (starts_m[i] - starts_m[i - 1]);
        }
        let span_m = starts_m[starts_m.len() - 1] - starts_m[0];
        let bucket_count = 4 * entries.len();
        let buckets_per_m = if span_m > 0.0 { bucket_count as f64 / span_m } else { 0.0 };
        let mut entry = 0;
        let buckets = (0..bucket_count)
            .map(|bucket| {
                let chainage_m = starts_m[0] + bucket as f64 / buckets_per_m.max(f64::MIN_POSITIVE);
                while starts_m.get(entry + 1).is_some_and(|&start| start <= chainage_m) {
                    entry += 1;
                }
                entry as u32
            })
            .collect();
        Ok(StepProfile { starts_m, values, cumulative, buckets, buckets_per_m })
    }

    #[inline]
    fn entry_at(&self, chainage_m: f64) -> usize {
        let offset = (chainage_m - self.starts_m[0]) * self.buckets_per_m;
        // A negative or NaN offset saturates to bucket 0.
        let bucket = (offset as usize).min(self.buckets.len() - 1);
        let mut entry = self.buckets[bucket] as usize;
        while entry + 1 < self.starts_m.len() && self.starts_m[entry + 1] <= chainage_m {
            entry += 1;
        }
        // Rounding may have put the bucket's start just past the chainage.
        while entry > 0 && self.starts_m[entry] > chainage_m {
            entry -= 1;
        }
        entry
    }

    /// Returns the value at a chainage in m.
    pub fn value_at(&self, chainage_m: f64) -> f64 {
        self.values[self.entry_at(chainage_m)]
    }

    /// Integral of the function from the first entry to a chainage in m.
    pub fn integral_to(&self, chainage_m: f64) -> f64 {
        self.integral_within(self.entry_at(chainage_m), chainage_m)
    }

    /// Returns the same to a chainage in m of an entry.
    fn integral_within(&self, entry: usize, chainage_m: f64) -> f64 {
        self.cumulative[entry] + self.values[entry] * (chainage_m - self.starts_m[entry])
    }

    /// Returns the mean of the function over a train of `length_m` around its centre; the value at the
    /// centre for a train without length.
    pub fn mean_around(&self, centre_m: f64, length_m: f64) -> f64 {
        if length_m <= 0.0 {
            return self.value_at(centre_m);
        }
        let (rear, front) = (centre_m - 0.5 * length_m, centre_m + 0.5 * length_m);
        let rear_entry = self.entry_at(rear);
        let reaches = |&next_m: &f64| next_m <= front;
        if !self.starts_m.get(rear_entry + 1).is_some_and(reaches) {
            return self.values[rear_entry];
        }
        let front_entry = self.entry_at(front);
        (self.integral_within(front_entry, front) - self.integral_within(rear_entry, rear))
            / length_m
    }

    /// Returns the entries (chainage in m, value).
    pub fn entries(&self) -> impl ExactSizeIterator<Item = (f64, f64)> + '_ {
        self.starts_m.iter().copied().zip(self.values.iter().copied())
    }
}

/// Returns the value at a place on the straight lines between points (place, value) in order, and that of the
/// nearest end beyond; 0 without points.
pub fn along_line(points: &[(f64, f64)], at: f64) -> f64 {
    let after = points.partition_point(|point| point.0 <= at);
    match (after.checked_sub(1).map(|before| points[before]), points.get(after)) {
        (Some((from, low)), Some(&(to, high))) => low + (high - low) * (at - from) / (to - from),
        (Some((_, value)), None) | (None, Some(&(_, value))) => value,
        (None, None) => 0.0,
    }
}

/// A function of the chainage that is linear between its entries and holds beyond them.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearProfile {
    entries: Vec<(f64, f64)>,
}

impl LinearProfile {
    /// Returns a profile through (chainage in m, value) entries of strictly increasing chainage.
    ///
    /// # Errors
    ///
    /// See [`ProfileError`].
    pub fn new(entries: Vec<(f64, f64)>) -> Result<Self, ProfileError> {
        StepProfile::new(&entries)?;
        Ok(LinearProfile { entries })
    }

    /// Returns the value at a chainage in m.
    #[inline]
    pub fn at(&self, chainage_m: f64) -> f64 {
        along_line(&self.entries, chainage_m)
    }

    /// Returns the entries.
    pub fn entries(&self) -> &[(f64, f64)] {
        &self.entries
    }
}

/// Error of a declared gradient in ‰ along growing chainage.
#[derive(Clone, Debug, PartialEq)]
pub struct GradientError {
    /// For both directions, or for growing chainage.
    pub profile: LinearProfile,
    /// For falling chainage, where it is another way.
    pub falling: Option<LinearProfile>,
}

impl GradientError {
    /// Returns the error in ‰ at a chainage, climbing positive as the chainage grows, for a train in a direction of
    /// travel, +1 or -1.
    #[inline]
    pub fn at(&self, position_m: f64, direction: f64) -> f64 {
        match &self.falling {
            Some(falling) if direction < 0.0 => falling.at(position_m),
            _ => self.profile.at(position_m),
        }
    }
}

/// A value between two chainages in m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntervalValue {
    /// Chainage in m where it starts.
    pub start_m: f64,
    /// Chainage in m where it ends.
    pub end_m: f64,
    /// The value between them.
    pub value: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_single_entry_is_a_constant() {
        let profile = StepProfile::new(&[(10.0, 3.0)]).unwrap();
        assert_eq!(profile.value_at(-1e9), 3.0);
        assert_eq!(profile.mean_around(1e9, 100.0), 3.0);
    }

    #[test]
    fn disorder_is_named_by_entry() {
        let error = StepProfile::new(&[(0.0, 1.0), (5.0, 2.0), (5.0, 3.0)]).unwrap_err();
        assert_eq!(
            error.to_string(),
            "entry 3: expected a chainage above the one before (5 m), got 5 m"
        );
        assert_eq!(StepProfile::new(&[]), Err(ProfileError::Empty));
    }

    proptest! {
        #[test]
        fn buckets_find_the_same_entry_as_a_search(
            gaps in prop::collection::vec(0.001f64..5000.0, 1..200),
            at in -0.5f64..1.5,
        ) {
            let mut chainage = -300.0;
            let mut entries = Vec::new();
            for (i, gap) in gaps.iter().enumerate() {
                entries.push((chainage, i as f64));
                chainage += gap;
            }
            let profile = StepProfile::new(&entries).unwrap();
            let probe = -300.0 + at * (chainage + 300.0);
            let expected = entries.iter().rev().find(|entry| entry.0 <= probe).unwrap_or(&entries[0]);
            prop_assert_eq!(profile.value_at(probe), expected.1);
        }

        #[test]
        fn the_mean_equals_a_fine_sum(
            values in prop::collection::vec(-20.0f64..20.0, 2..30),
            centre in -100.0f64..3000.0,
            length in 1.0f64..900.0,
        ) {
            let entries: Vec<_> = values.iter().enumerate().map(|(i, &v)| (i as f64 * 97.0, v)).collect();
            let profile = StepProfile::new(&entries).unwrap();
            let steps = 20_000;
            let sum: f64 = (0..steps)
                .map(|k| profile.value_at(centre + length * ((k as f64 + 0.5) / steps as f64 - 0.5)))
                .sum();
            prop_assert!((profile.mean_around(centre, length) - sum / steps as f64).abs() < 0.05);
        }
    }
}
