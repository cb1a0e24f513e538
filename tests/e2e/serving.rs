//! The daemon and controllers in separate processes.

mod accounting;
mod adoption;
mod clocks;
mod daemon;
mod ending;
mod faults;
mod golden;
mod hostile;
mod hosts;
mod identical;
mod implausible;
mod operator;
mod properties;
mod replay;
mod resources;
mod restart;
mod state;
mod supervision;
mod wake_model;
mod watch;
