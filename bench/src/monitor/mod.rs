//! The residual monitor over seeded simulations: how soon it names what begins to act, how long it
//! names what does not, and how seldom it names something while nothing does.
//!
//! - [`acting`]: when an effect acts, from the true motion
//! - [`watch`]: one simulated dataset, fed sample by sample
//! - [`matrix`]: all kinds over all seeds, in numbers
//! - [`command`]: the command line

pub mod acting;
pub mod command;
pub mod matrix;
pub mod watch;
