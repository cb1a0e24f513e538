//! Accuracy over seeded runs: the papers' figures, their methods and ours beside the bound.

pub mod bound;
pub mod braking;
pub mod braking_run;
pub mod braking_score;
pub mod braking_table;
pub mod jin;
pub mod literal_em;
pub mod row;
pub mod statistics;
pub mod xie;
