//! Places along the line, times and runs where an effect acts, with their uncertainty.
//!
//! - [`Inside`]: the share of a train that is at a place
//! - [`find`]: the intervals and runs in which a force of a given shape explains most
//! - [`Site`], [`IntervalEnd`]: the intervals and runs of an effect, the ends that were estimated, and where else these
//!   could be
//! - [`settle`]: moves every end to the median of its posterior, with its interval, and gives every run the probability
//!   that the effect acts in it

mod localise;
mod runs;
mod settle;
mod site;

pub use localise::{ErrorScale, MAP, MAP_ERROR_PERMILLE, SURVEYED, UNSURVEYED, find, span_m};
pub use runs::{FoundIntervals, best_of_runs};
pub use settle::settle;
pub use site::{Axis, Inside, IntervalEnd, Intervals, Reach, Site};
