//! Texts for an operator, wherever they stand: in the log, in `dynocar health`, on the screen of `dynocar watch`
//! and in a recording's events.
//!
//! - [`suspicion`]: the effect that the model may lack, with its force and what else it could be
//!
//! The remedy is in [`dynocar_core::remedy`] and [`dynocar_shared::vocabulary::KINDS`].

pub mod suspicion;

use dynocar_shared::snapshot::REJECTION_REASONS;
use dynocar_shared::{PipelineKind, RejectionReason};

/// Returns the name of a pipeline that no configuration names: its number there and its kind.
pub fn pipeline_name(index: u32, kind: Option<PipelineKind>) -> String {
    format!("{index}_{}", kind.map_or("unknown", PipelineKind::name))
}

/// A duration as people say it.
pub fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 10.0 => format!("{s:.1} s"),
        s if s < 120.0 => format!("{s:.0} s"),
        s if s < 7200.0 => format!("{:.0} min", s / 60.0),
        s if s < 172_800.0 => format!("{:.0} h", s / 3600.0),
        s => format!("{:.0} days", s / 86_400.0),
    }
}

/// Why samples were refused and how many, the most frequent first.
pub fn refusals(counts: &[u32; REJECTION_REASONS]) -> Vec<(RejectionReason, u32)> {
    let of = |&reason: &RejectionReason| (reason, counts[reason as usize]);
    let mut all: Vec<_> = RejectionReason::ALL.iter().map(of).filter(|it| it.1 > 0).collect();
    all.sort_by_key(|it| std::cmp::Reverse(it.1));
    all
}

/// The same in words: `speed_jump 104, outlier 2`.
pub fn refused_words(refused: &[(RejectionReason, u32)]) -> String {
    let words: Vec<_> = refused.iter().map(|(reason, count)| format!("{reason} {count}")).collect();
    words.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_said_as_people_say_them() {
        let all = [0.04, 45.0, 600.0, 9000.0, 864_000.0].map(duration);
        assert_eq!(all, ["0.0 s", "45 s", "10 min", "2 h", "10 days"]);
    }

    #[test]
    fn the_most_frequent_refusal_comes_first() {
        let mut counts = [0; REJECTION_REASONS];
        counts[RejectionReason::Outlier as usize] = 2;
        counts[RejectionReason::SpeedJump as usize] = 104;
        assert_eq!(refused_words(&refusals(&counts)), "speed_jump 104, outlier 2");
        assert_eq!(refused_words(&[]), "");
    }
}
