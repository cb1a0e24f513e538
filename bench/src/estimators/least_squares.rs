//! Recursive least squares in all its forms.

use std::sync::Arc;

use dynocar_core::filter::random::Random;
use dynocar_core::filter::{Forgetting, Mils, Penalty, Rls};
use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, Vector3};

use super::measure::{Agreement, Case, Contender};

type Row = (Vector3<f64>, f64);
type Rows = Arc<[Row]>;

const ROWS: usize = 1000;
const TRUTH: Vector3<f64> = Vector3::new(1.2, 0.5, 0.9);
const START_VARIANCE: f64 = 1e4;
/// p of multi-innovation least squares.
const LENGTH: usize = 6;
/// lambda / N of the regularised forms.
const PENALTY: f64 = 4e-4;
const FORGETTING: f64 = 0.9998;
/// The recursions are the same in exact arithmetic.
const SAME: Agreement = Agreement::Relative(1e-6);

/// Resistance over speeds of 5 to 35 m/s in units of 20 m/s, as coasting shows it.
fn rows() -> Rows {
    let mut random = Random::new(7);
    (0..ROWS)
        .map(|_| {
            let speed = 0.25 + 1.5 * random.uniform();
            let features = Vector3::new(1.0, speed, speed * speed);
            (features, features.dot(&TRUTH) + 0.3 * random.normal())
        })
        .collect()
}

/// The cases of this module.
pub fn cases() -> Vec<Case> {
    let rows = rows();
    let of = |name: &str, run: fn(&[Row]) -> Vector3<f64>| {
        Contender::new(name, ROWS, &rows, move |rows| run(rows).as_slice().to_vec())
    };
    let length = ROWS as u32;
    let lambda = Vector3::repeat(PENALTY * f64::from(length));
    let penalty = Penalty { lambda, length, is_printed: true };
    let penalised = Contender::new("ours", ROWS, &rows, move |rows| {
        ours_mils::<1>(rows, 1, penalty).as_slice().to_vec()
    });
    vec![
        Case::new("rls", SAME, of("ours", |rows| ours_rls(rows, Forgetting::None)))
            .aim(60.0)
            .peer(of("textbook, static", textbook_rls))
            .peer(of("textbook, Joseph form", joseph_rls))
            .peer(of("textbook, dynamic", dynamic_rls)),
        Case::new(
            "rls, directional forgetting",
            SAME,
            of("ours", |rows| ours_rls(rows, Forgetting::Directional(FORGETTING))),
        )
        .peer(of("textbook, static", textbook_directional)),
        Case::new("regularised rls", SAME, penalised)
            .peer(of("textbook, static", textbook_regularised)),
        Case::new(
            "mils, p = 6",
            SAME,
            of("ours", |rows| ours_mils::<LENGTH>(rows, LENGTH, Penalty::none())),
        )
        .aim(400.0)
        .peer(of("textbook, static", textbook_mils))
        .peer(of("textbook, dynamic", dynamic_mils)),
    ]
}

fn ours_rls(rows: &[Row], forgetting: Forgetting) -> Vector3<f64> {
    let mut rls = Rls::new(Vector3::zeros(), &Vector3::repeat(START_VARIANCE), forgetting);
    for (features, observed) in rows {
        rls.update(features, *observed).expect("sound rows");
    }
    *rls.estimate()
}

fn ours_mils<const L: usize>(rows: &[Row], length: usize, penalty: Penalty<3>) -> Vector3<f64> {
    let start = Vector3::repeat(START_VARIANCE);
    let mut mils = Mils::<3, L>::new(Vector3::zeros(), &start, length, penalty);
    for (features, observed) in rows {
        mils.update(features, *observed).expect("sound rows");
    }
    *mils.estimate()
}

/// A recursion of the textbook over all rows: each changes the estimate and its P.
fn recursion(
    rows: &[Row],
    mut step: impl FnMut(&mut Vector3<f64>, &mut Matrix3<f64>, &Vector3<f64>, f64),
) -> Vector3<f64> {
    let (mut theta, mut p) = (Vector3::zeros(), Matrix3::identity() * START_VARIANCE);
    for (features, observed) in rows {
        step(&mut theta, &mut p, features, *observed);
    }
    theta
}

/// The gain of a row.
fn gain(p: &Matrix3<f64>, features: &Vector3<f64>) -> Vector3<f64> {
    p * features / (1.0 + (features.transpose() * p * features)[0])
}

/// What a row leaves of the covariance.
fn kept(gain: &Vector3<f64>, features: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::identity() - gain * features.transpose()
}

fn textbook_rls(rows: &[Row]) -> Vector3<f64> {
    recursion(rows, |theta, p, features, observed| {
        let gain = gain(p, features);
        *theta += gain * (observed - features.dot(theta));
        *p = kept(&gain, features) * *p;
    })
}

/// As robust as ours: P = (I - K x') P (I - K x')' + K K'.
fn joseph_rls(rows: &[Row]) -> Vector3<f64> {
    recursion(rows, |theta, p, features, observed| {
        let gain = gain(p, features);
        *theta += gain * (observed - features.dot(theta));
        let keep = kept(&gain, features);
        *p = keep * *p * keep.transpose() + gain * gain.transpose();
    })
}

fn textbook_directional(rows: &[Row]) -> Vector3<f64> {
    recursion(rows, |theta, p, features, observed| {
        let information = p.try_inverse().expect("positive definite");
        let held = (features.transpose() * information * features)[0];
        *p += features * features.transpose() * ((1.0 - FORGETTING) / (FORGETTING * held));
        let gain = gain(p, features);
        *theta += gain * (observed - features.dot(theta));
        *p = kept(&gain, features) * *p;
    })
}

fn dynamic_rls(rows: &[Row]) -> Vector3<f64> {
    let mut theta = DVector::zeros(3);
    let mut p = DMatrix::identity(3, 3) * START_VARIANCE;
    for (features, observed) in rows {
        let features = DVector::from_column_slice(features.as_slice());
        let gain = &p * &features / (1.0 + (features.transpose() * &p * &features)[(0, 0)]);
        theta += &gain * (observed - features.dot(&theta));
        p = (DMatrix::identity(3, 3) - &gain * features.transpose()) * p;
    }
    Vector3::from_column_slice(theta.as_slice())
}

/// Liu 2018, eq. 12-16: the penalty by a matrix inverse.
fn textbook_regularised(rows: &[Row]) -> Vector3<f64> {
    recursion(rows, |theta, p, features, observed| {
        let inner = Matrix3::identity() + *p * PENALTY;
        let q = *p * inner.try_inverse().expect("positive definite");
        let gain = gain(&q, features);
        *p = kept(&gain, features) * q;
        *theta += gain * (observed - features.dot(theta)) - *p * *theta * PENALTY;
    })
}

/// K = P Φ (I + Φ' P Φ)⁻¹ over the newest p rows; a missing row is one of zeros.
fn textbook_mils(rows: &[Row]) -> Vector3<f64> {
    let mut theta = Vector3::zeros();
    let mut p = Matrix3::identity() * START_VARIANCE;
    let mut stacked = SMatrix::<f64, 3, LENGTH>::zeros();
    let mut observations = SVector::<f64, LENGTH>::zeros();
    for (index, (features, observed)) in rows.iter().enumerate() {
        stacked.set_column(index % LENGTH, features);
        observations[index % LENGTH] = *observed;
        let inner = SMatrix::<f64, LENGTH, LENGTH>::identity() + stacked.transpose() * p * stacked;
        let gain = p * stacked * inner.try_inverse().expect("positive definite");
        theta += gain * (observations - stacked.transpose() * theta);
        p = (Matrix3::identity() - gain * stacked.transpose()) * p;
    }
    theta
}

fn dynamic_mils(rows: &[Row]) -> Vector3<f64> {
    let mut theta = DVector::zeros(3);
    let mut p = DMatrix::identity(3, 3) * START_VARIANCE;
    for index in 0..rows.len() {
        let newest = &rows[(index + 1).saturating_sub(LENGTH)..=index];
        let stacked = DMatrix::from_fn(3, newest.len(), |i, j| newest[j].0[i]);
        let observations = DVector::from_fn(newest.len(), |j, _| newest[j].1);
        let inner =
            DMatrix::identity(newest.len(), newest.len()) + stacked.transpose() * &p * &stacked;
        let gain = &p * &stacked * inner.try_inverse().expect("positive definite");
        theta += &gain * (observations - stacked.transpose() * &theta);
        p = (DMatrix::identity(3, 3) - &gain * stacked.transpose()) * p;
    }
    Vector3::from_column_slice(theta.as_slice())
}
