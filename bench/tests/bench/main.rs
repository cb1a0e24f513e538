//! The measurements run, take the arguments that the documents name, and give the right answer; no test depends on
//! elapsed time.

mod commands;
mod drive;
mod explained_brakes;
mod latency_and_load;
mod scenarios;
