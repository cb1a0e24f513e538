//! Liu 2018: the recursions, and the coasting segments that they run on.

pub(crate) mod coasting;
pub(crate) mod solver;
