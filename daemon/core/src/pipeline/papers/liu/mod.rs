//! Liu 2018: the recursions, and the coasting segments that they run on.

pub(in crate::pipeline) mod coasting;
pub(in crate::pipeline) mod solver;
