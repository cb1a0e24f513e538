//! Another mass than declared: between certain places in one direction, or in certain sections
//! of time of a run. Mass changes while the train stands.

mod masses;
mod parts;
mod search;

use dynocar_shared::vocabulary::EffectKind;

use super::{Candidate, Effect, Proposal};
use crate::explain::scan::Scan;
use search::{all_sections, all_windows, everywhere, grow};

/// The kind.
pub struct MassChange;

impl Effect for MassChange {
    fn kind(&self) -> EffectKind {
        EffectKind::MassChange
    }

    fn propose(&self, scan: &Scan) -> Proposal {
        let mut candidates = Vec::new();
        let sections = all_sections(scan);
        if !sections.is_empty() {
            candidates.extend(grow(scan, &sections));
        }
        candidates.extend(grow(scan, &all_windows(scan)));
        candidates.extend(self.whole(scan));
        Proposal::Candidates(candidates)
    }

    fn whole(&self, scan: &Scan) -> Option<Candidate> {
        everywhere(scan)
    }
}
