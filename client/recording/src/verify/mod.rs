//! Every recorded snapshot computed again, from the recorded samples by the recorded configuration,
//! with the code of the daemon's own pipelines.
//!
//! A pipeline is a function of its samples from the daemon's start on. A snapshot's `sequence` counts
//! them, so that it says whether the recording holds them all.

mod configurations;
mod overlay;
mod pipelines;
mod report;

pub use configurations::{ConfigurationProblem, Configurations};
pub use overlay::{QuantityAnswer, overlay};
pub use pipelines::{Difference, Outcome, Verified, verify};
pub use report::{overlay_text, text};

/// Fields of a snapshot that are stamps of the daemon's clock and are not computed from samples.
pub const STAMPS: [&str; 3] = ["epoch", "published_ns", "vouched_ns"];
