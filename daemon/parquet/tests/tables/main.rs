//! Tests of the tables of a recording, ours and those of other tools.

mod dataset;
mod fields;
mod refused;
mod round_trip;
mod support;
