//! Every pipeline that answers resistance or mass, in a user's day: trains that stop, loads that are
//! weighed wrong or not at all, maps, wheels, forces and clocks that are a little off.
//!
//! - [`world`]: a train, its line, and the ordinary mistakes in what is declared of them
//! - [`drive`]: driving from stop to stop, and what the controller writes of it
//! - [`bound`]: how well both can be known at best
//! - [`score`]: what an answer was worth over a drive
//! - [`rows`]: the scenarios of the table
//! - [`table`]: all of it in numbers
//! - [`command`]: the command line

pub mod bound;
pub mod command;
pub mod drive;
pub mod rows;
pub mod score;
pub mod table;
pub mod world;
