//! Commands over recorded runs as a user runs them.

mod check;
mod identify;
mod plots;
