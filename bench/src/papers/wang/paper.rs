//! The paper that the rows are about.

/// Its name in the table.
pub const PAPER: &str = "Wang 2022";
