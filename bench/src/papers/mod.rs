//! Accuracy over seeded runs: the papers' figures, their methods and ours compared with the bound.

pub mod bound;
pub mod braking;
pub mod braking_run;
pub mod braking_score;
pub mod braking_table;
pub mod jin;
pub mod literal_em;
pub mod liu;
pub mod promise;
pub mod row;
pub mod score;
pub mod seeds;
pub mod statistics;
pub mod table;
pub mod wang;
pub mod xia;
pub mod xie;

pub use promise::Verdict;
pub use row::Row;
pub use seeds::Seeds;

/// A paper with the measurement of its tables.
pub struct Source {
    /// Short name on the command line.
    pub name: &'static str,
    /// Measures every row over seeded runs.
    pub rows: fn(Seeds) -> Vec<Row>,
}

/// Every paper, by year.
pub fn sources() -> Vec<Source> {
    vec![
        Source { name: "xia", rows: xia::rows },
        Source { name: "liu", rows: liu::rows },
        Source { name: "xie", rows: xie::rows },
        Source { name: "jin", rows: jin::rows },
        Source { name: "wang", rows: wang::rows },
    ]
}
