//! Accuracy over seeded runs: the papers' figures, their methods and ours beside the bound.

pub mod bound;
pub mod braking;
pub mod row;
pub mod statistics;
