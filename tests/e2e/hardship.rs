//! Bad samples, mutated bytes, power cuts and months of them, without a daemon of its own.

mod bad_samples;
mod day;
mod fuzzing;
mod months;
mod power_cut;
mod power_cut_recordings;
