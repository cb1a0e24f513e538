//! The matrix of `dynocar explain`: every kind of effect and nulls over seeded simulations.
//!
//! - [`scenario`]: what is simulated
//! - [`case`]: one simulated dataset, explained in this process
//! - [`grade`]: the answer against the truth
//! - [`matrix`]: all kinds over all seeds, in numbers

pub mod case;
pub mod grade;
pub mod matrix;
pub mod scenario;
