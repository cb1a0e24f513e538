//! Accuracy over seeded runs: the papers' figures, their methods and ours beside the bound.

pub mod bound;
pub mod braking;
pub mod liu;
pub mod row;
pub mod statistics;
pub mod table;
pub mod wang;

pub use row::Row;

/// A paper with the measurement of its tables.
pub struct Source {
    /// Short name on the command line.
    pub name: &'static str,
    /// Measures every row over so many seeded runs.
    pub rows: fn(usize) -> Vec<Row>,
}

/// Every paper, by year.
pub fn sources() -> Vec<Source> {
    vec![Source { name: "wang", rows: wang::rows }]
}
