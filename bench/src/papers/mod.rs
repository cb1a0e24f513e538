//! Accuracy over seeded runs: the papers' figures, their methods and ours beside the bound.

pub mod row;
pub mod statistics;
pub mod xia;
