//! Wang 2022: staged learning of resistance and mass, traction energy.
//!
//! - [`line`], [`shuttle`], [`driver`], [`disturbance`], [`sensor`]: the scenario, from line to
//!   samples
//! - [`bound`]: what no estimator can beat
//! - [`resistance_rows`], [`mass_rows`], [`energy_rows`]: the comparison

pub mod bound;
pub mod disturbance;
pub mod driver;
pub mod energy_rows;
pub mod line;
pub mod mass_rows;
pub mod resistance_rows;
pub mod sensor;
pub mod shuttle;

use super::row::Row;

const PAPER: &str = "Wang 2022";

/// Every row of the paper over a number of seeded runs.
pub fn rows(seeds: usize) -> Vec<Row> {
    let mut rows = resistance_rows::rows(seeds);
    rows.extend(mass_rows::rows(seeds));
    rows.extend(energy_rows::rows(seeds));
    rows
}
