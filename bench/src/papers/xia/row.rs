//! The lines of the comparison with this paper.

use crate::papers::row::Row;
use crate::papers::seeds::Seeds;

/// A line of this paper without any figure yet.
pub fn row(table: &'static str, quantity: String, unit: &'static str, seeds: Seeds) -> Row {
    Row::new("Xia 2023", table, quantity, unit, seeds)
}
