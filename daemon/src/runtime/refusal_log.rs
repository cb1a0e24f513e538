//! Which refused samples of a train the log names, and when.
//!
//! The first are named at once, those that follow together and not too often. What is refused as it
//! should be, wheel slide and the estimators' own outliers, is only counted.

use std::time::{Duration, Instant};

use dynocar_core::remedy::of_refusal;
use dynocar_shared::RejectionReason;
use dynocar_shared::snapshot::REJECTION_REASONS;

use crate::operator::refusals;

/// How long what follows is gathered.
const GATHER: Duration = Duration::from_secs(60);

/// The refused samples of one train as the log knows them.
#[derive(Clone, Debug, Default)]
pub struct RefusalLog {
    /// Counts when the log last named them.
    named: [u32; REJECTION_REASONS],
    last: Option<Instant>,
}

impl RefusalLog {
    /// Looks at the counts; gives those to be named now, the most frequent first.
    pub fn look(
        &mut self,
        counts: &[u32; REJECTION_REASONS],
        now: Instant,
    ) -> Vec<(RejectionReason, u32)> {
        if self.last.is_some_and(|last| now.duration_since(last) < GATHER) {
            return Vec::new();
        }
        let new = std::array::from_fn(|index| counts[index].saturating_sub(self.named[index]));
        let mut all = refusals(&new);
        all.retain(|(reason, _)| of_refusal(*reason).is_some());
        if !all.is_empty() {
            (self.named, self.last) = (*counts, Some(now));
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_refusal_is_named_at_once_and_the_next_together() {
        let start = Instant::now();
        let mut log = RefusalLog::default();
        let mut counts = [0; REJECTION_REASONS];
        assert!(log.look(&counts, start).is_empty());
        counts[RejectionReason::WheelSlide as usize] = 9;
        assert!(log.look(&counts, start).is_empty(), "as it should be");
        let mut named = Vec::new();
        for second in 0..130 {
            counts[RejectionReason::SpeedJump as usize] += 1;
            counts[RejectionReason::Frozen as usize] += u32::from(second == 70);
            let now = start + Duration::from_secs(second);
            named.extend(log.look(&counts, now).into_iter().map(|it| (second, it.0, it.1)));
        }
        assert_eq!(
            named,
            [
                (0, RejectionReason::SpeedJump, 1),
                (60, RejectionReason::SpeedJump, 60),
                (120, RejectionReason::SpeedJump, 60),
                (120, RejectionReason::Frozen, 1),
            ]
        );
    }
}
