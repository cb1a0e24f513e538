//! The middle of values.

/// The middle of some values, the upper one of two; `None` of none.
pub fn middle(values: &mut [f64]) -> Option<f64> {
    let index = values.len() / 2;
    match values {
        [] => None,
        values => Some(*values.select_nth_unstable_by(index, f64::total_cmp).1),
    }
}
