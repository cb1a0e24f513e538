//! The measurements run, take what the documents name, and give the right answer; no time decides.

mod commands;
mod drive;
mod explained_brakes;
mod latency_and_load;
mod scenarios;
