//! What the tables of a recording promise, and those of others.

mod dataset;
mod fields;
mod refused;
mod round_trip;
mod support;
