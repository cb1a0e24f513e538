//! The measurements run, take what the documents name, and give what is right; no time decides.

mod documents;
mod drive;
mod ending;
mod explained_brakes;
mod latency_and_load;
mod output;
mod scenarios;
