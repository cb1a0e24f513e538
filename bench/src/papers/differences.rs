//! Derivatives of what a scenario's own motion gives, apart from those that the estimators use.

/// Derivatives of every element of a list with respect to each parameter, by central differences of these widths.
pub fn jacobian<const N: usize>(
    widths: [f64; N],
    at: impl Fn([f64; N]) -> Vec<f64>,
) -> Vec<[f64; N]> {
    let mut rows = Vec::new();
    for (column, width) in widths.into_iter().enumerate() {
        let mut change = [0.0; N];
        change[column] = width;
        let (plus, minus) = (at(change), at(change.map(|width| -width)));
        rows.resize(plus.len().max(rows.len()), [0.0; N]);
        for (row, (plus, minus)) in rows.iter_mut().zip(plus.iter().zip(minus)) {
            row[column] = (plus - minus) / (2.0 * width);
        }
    }
    rows
}
