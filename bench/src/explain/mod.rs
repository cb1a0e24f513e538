//! `dynocar explain` over seeded simulations of every kind of effect and of nulls.
//!
//! - [`scenario`]: what is simulated
//! - [`world`]: what is a little wrong besides it
//! - [`case`]: one simulated dataset, explained in this process
//! - [`grade`]: the answer against the truth
//! - [`attainable`]: what the true law leaves when its numbers are estimated
//! - [`parameters`]: its numbers against the true ones
//! - [`place`]: its places against the true ones
//! - [`family`]: which simulated datasets
//! - [`matrix`]: all kinds over all seeds, in numbers
//! - [`growth`]: time for 1, 4 and 16 times the data
//! - [`command`]: the command line

pub mod attainable;
pub mod case;
pub mod command;
pub mod family;
pub mod grade;
pub mod growth;
pub mod matrix;
pub mod parameters;
pub mod place;
pub mod scenario;
pub mod world;
