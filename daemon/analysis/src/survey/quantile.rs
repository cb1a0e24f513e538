//! The middle of values, and what lies below others.

/// The middle of some values, the upper one of two; `None` of none.
pub fn middle(values: &mut [f64]) -> Option<f64> {
    let index = values.len() / 2;
    match values {
        [] => None,
        values => Some(*values.select_nth_unstable_by(index, f64::total_cmp).1),
    }
}

/// The value below which a share of some values lies; 0 of none.
pub fn share_of(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let index = (share * sorted.len().saturating_sub(1) as f64) as usize;
    sorted.get(index).copied().unwrap_or(0.0)
}
