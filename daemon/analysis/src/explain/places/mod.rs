//! Where along the line, when, and in which runs something acts, and how surely that is known.
//!
//! - [`Inside`]: how much of a train is at a place
//! - [`find`]: the intervals and runs in which a force of some shape explains most
//! - [`Site`], [`IntervalEnd`]: where and in which runs that is, ends that were estimated, and where else they could be
//! - [`settle`]: every end at the middle of what the data allow, with its interval, and for every
//!   run how likely it takes part

mod localise;
mod runs;
mod settle;
mod site;

pub use localise::{ErrorScale, MAP, MAP_ERROR_PERMILLE, SURVEYED, UNSURVEYED, find, span_m};
pub use runs::{FoundIntervals, best_of_runs};
pub use settle::settle;
pub use site::{Axis, Inside, IntervalEnd, Intervals, Reach, Site};
