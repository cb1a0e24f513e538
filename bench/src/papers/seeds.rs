//! Which runs are behind a figure.

use std::ops::Range;

/// Runs by their seeds, one after the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seeds {
    /// The first seed.
    pub first: u64,
    /// How many runs.
    pub count: usize,
}

impl Seeds {
    /// So many runs from seed 0 on.
    pub fn from_zero(count: usize) -> Self {
        Seeds { first: 0, count }
    }

    /// The seeds.
    pub fn range(self) -> Range<u64> {
        self.first..self.first + self.count as u64
    }

    /// The first of them, so many at most.
    #[must_use]
    pub fn at_most(self, count: usize) -> Self {
        Seeds { count: self.count.min(count), ..self }
    }

    /// So many seeds for each; other seeds than those of other first seeds.
    #[must_use]
    pub fn each(self, runs: usize) -> Self {
        Seeds { first: self.first * runs as u64, count: self.count * runs }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_that_follow_each_other_share_no_seed() {
        let (one, next) = (Seeds::from_zero(200), Seeds { first: 200, count: 200 });
        assert_eq!(one.range().end, next.range().start);
        assert_eq!(one.each(5).range().end, next.each(5).range().start);
        assert_eq!(next.at_most(20).range(), 200..220);
    }
}
