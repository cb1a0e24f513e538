//! The measurements run, take what the documents name, and give what is right; no time decides.

mod commands;
mod drive;
mod explained_brakes;
mod latency_and_load;
mod scenarios;
