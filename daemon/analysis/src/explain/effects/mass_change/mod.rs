//! Another mass than declared: between certain places in one direction, or in certain sections
//! of time of a run. Mass changes while the train stands.

mod masses;
mod parts;
mod search;

use super::Proposal;
use crate::explain::scan::Scan;
pub use search::everywhere;
use search::{all_sections, all_windows, grow};

/// Structures for the data at hand.
pub fn propose(scan: &Scan) -> Proposal {
    let mut candidates = Vec::new();
    let sections = all_sections(scan);
    if !sections.is_empty() {
        candidates.extend(grow(scan, &sections));
    }
    candidates.extend(grow(scan, &all_windows(scan)));
    candidates.extend(everywhere(scan));
    Ok(candidates)
}
