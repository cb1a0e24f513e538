//! Since when a brake may drag: onsets side by side, dense lately and sparse long ago.

use super::suspects::ONSETS;

/// Blocks between new onsets.
const SPACING: u32 = 3;

/// Ages of the onsets in blocks; `None` for a free place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Onsets {
    ages: [Option<u32>; ONSETS],
    since_newest: u32,
}

impl Onsets {
    /// No onset yet; the next block opens one.
    pub fn new() -> Self {
        Onsets { ages: [None; ONSETS], since_newest: SPACING }
    }

    /// Age of an onset in blocks.
    pub fn age(&self, index: usize) -> Option<u32> {
        self.ages[index]
    }

    /// The train starts from a stop: the next block opens an onset, which brakes may have dragged
    /// since.
    pub fn start_leg(&mut self) {
        self.since_newest = SPACING;
    }

    /// One block later.
    pub fn advance(&mut self) {
        self.since_newest += 1;
        for age in self.ages.iter_mut().flatten() {
            *age = age.saturating_add(1);
        }
    }

    /// When it is time for a new onset, the place that it takes; that place may have held
    /// another, and `keep` never goes.
    pub fn open(&mut self, keep: Option<usize>) -> Option<usize> {
        if self.since_newest < SPACING {
            return None;
        }
        self.since_newest = 0;
        let free = self.ages.iter().position(Option::is_none);
        let index = free.unwrap_or_else(|| self.most_redundant(keep));
        self.ages[index] = Some(0);
        Some(index)
    }

    /// The onset between the two neighbours that lie closest together by the ratio of ages.
    fn most_redundant(&self, keep: Option<usize>) -> usize {
        let ratio = |index: usize| {
            let age = self.ages[index].unwrap_or(0);
            let all = || self.ages.iter().flatten().copied();
            let younger = all().filter(|&other| other < age).max()?;
            let older = all().filter(|&other| other > age).min()?;
            Some(f64::from(younger + SPACING) / f64::from(older + SPACING))
        };
        let mut best = (f64::NEG_INFINITY, 0);
        for index in (0..ONSETS).filter(|&index| Some(index) != keep) {
            if let Some(ratio) = ratio(index)
                && ratio > best.0
            {
                best = (ratio, index);
            }
        }
        best.1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn old_onsets_thin_out_and_the_first_and_a_kept_one_stay() {
        let mut onsets = Onsets::new();
        let mut kept = None;
        for block in 0..300 {
            let opened = onsets.open(kept);
            if block == 90 {
                kept = opened;
            }
            onsets.advance();
        }
        let mut ages: Vec<u32> = (0..ONSETS).filter_map(|index| onsets.age(index)).collect();
        ages.sort_unstable();
        assert_eq!(ages.len(), ONSETS);
        assert_eq!(*ages.last().unwrap(), 300);
        assert_eq!(onsets.age(kept.unwrap()), Some(210));
        assert!(ages[3] <= 12, "dense lately: {ages:?}");
        assert!(ages[6] <= 90, "sparse long ago: {ages:?}");
    }
}
