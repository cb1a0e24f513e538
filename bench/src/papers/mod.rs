//! Accuracy over seeded runs: the papers' figures, their methods and ours beside the bound.

pub mod liu;
pub mod row;
pub mod statistics;
