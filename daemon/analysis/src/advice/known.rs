//! Knowledge of the resistance in a snapshot.

use dynocar_model::train::Davis;
use dynocar_shared::{Parameter, ParameterSnapshot};
use nalgebra::Matrix3;

/// Parameters that the pipeline answers: a, b, c and the mass.
pub const ANSWERED: [Parameter; 4] =
    [Parameter::DavisA, Parameter::DavisB, Parameter::DavisC, Parameter::Mass];

/// Coefficients and their covariance out of a snapshot that has all three.
pub fn davis_of(snapshot: &ParameterSnapshot) -> Option<(Davis, Matrix3<f64>)> {
    let [davis @ .., _] = ANSWERED;
    let [Some(a), Some(b), Some(c)] = davis.map(|it| snapshot.index_of(it)) else { return None };
    let places = [a, b, c];
    let [a, b, c] = places.map(|index| snapshot.values[index]);
    let covariance = Matrix3::from_fn(|i, j| snapshot.covariance_at(places[i], places[j]));
    Some((Davis { a, b, c }, covariance))
}
