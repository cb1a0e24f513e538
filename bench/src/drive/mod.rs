//! What a controller gains: an automatic driver with declared parameters, with the daemon's answers, and
//! with the true ones.
//!
//! - [`knowledge`]: what a driver holds for true of its train, and what the train can do
//! - [`leg`]: the line from stop to stop as the map has it
//! - [`answers`]: from the daemon's answers to what the driver drives by, and whether they were right
//! - [`braking`]: the braking curve to the stopping point
//! - [`plan`]: the speed profile for the timetable with the least energy
//! - [`driver`]: tracking the plan and the braking curve
//! - [`mod@line`]: brakes, rails, wind, tunnels, curves and loads beside the world of ordinary mistakes
//! - [`train`]: the train, whose truth nobody knows
//! - [`journey`]: a train and its driver from stop to stop
//! - [`link`]: channels to a daemon of its own, in lock-step
//! - [`run`]: all trains of a service with one kind of parameters
//! - [`score`], `records`, [`picture`]: what it comes to
//! - [`command`]: the command line

pub mod answers;
pub mod braking;
pub mod command;
pub mod driver;
pub mod journey;
pub mod knowledge;
pub mod leg;
pub mod line;
pub mod link;
pub mod picture;
pub mod plan;
mod records;
pub mod run;
pub mod score;
pub mod train;
