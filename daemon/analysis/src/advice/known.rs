//! What a snapshot knows of the resistance.

use dynocar_shared::ParameterSnapshot;
use nalgebra::Matrix3;

use dynocar_core::train::Davis;

use super::rehearsal::ANSWERED;

/// Coefficients and their covariance out of a snapshot that has all three.
pub fn davis_of(snapshot: &ParameterSnapshot) -> Option<(Davis, Matrix3<f64>)> {
    let [davis @ .., _] = ANSWERED;
    let [Some(a), Some(b), Some(c)] = davis.map(|it| snapshot.index_of(it)) else { return None };
    let places = [a, b, c];
    let [a, b, c] = places.map(|place| snapshot.values[place]);
    let covariance = Matrix3::from_fn(|i, j| snapshot.covariance_at(places[i], places[j]));
    Some((Davis { a, b, c }, covariance))
}
