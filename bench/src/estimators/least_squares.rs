//! Recursive least squares in all its forms.

use std::rc::Rc;

use dynocar_core::filter::{Mils, Penalty, Rls};
use nalgebra::Vector3;

use super::measure::EstimatorCase;
use dynocar_tests::chance::Chance;

type Row = (Vector3<f64>, f64);

const ROWS: usize = 1000;
const TRUTH: Vector3<f64> = Vector3::new(1.2, 0.5, 0.9);
const START_VARIANCE: f64 = 1e4;
/// p of multi-innovation least squares.
const LENGTH: usize = 6;
/// lambda / N of the regularised form.
const PENALTY: f64 = 4e-4;
const FORGETTING: f64 = 0.9998;

/// Returns the resistance over speeds of 5 to 35 m/s in units of 20 m/s, as coasting shows it.
fn rows() -> Rc<[Row]> {
    let mut random = Chance::new(7);
    (0..ROWS)
        .map(|_| {
            let speed = 0.25 + 1.5 * random.uniform();
            let features = Vector3::new(1.0, speed, speed * speed);
            (features, features.dot(&TRUTH) + 0.3 * random.normal())
        })
        .collect()
}

/// Returns the cases of this module.
pub fn cases() -> Vec<EstimatorCase> {
    let rows = rows();
    let of = |name, run: fn(&[Row]) -> Vector3<f64>| {
        let rows = Rc::clone(&rows);
        EstimatorCase::new(name, ROWS, move || run(&rows))
    };
    vec![
        of("rls", |rows| rls(rows, 1.0)).aim(60.0),
        of("rls, directional forgetting", |rows| rls(rows, FORGETTING)),
        of("regularised rls", |rows| {
            let length = ROWS as u32;
            let lambda = Vector3::repeat(PENALTY * f64::from(length));
            mils::<1>(rows, Penalty { lambda, length, is_printed: true })
        }),
        of("mils, p = 6", |rows| mils::<LENGTH>(rows, Penalty::none())).aim(400.0),
    ]
}

fn rls(rows: &[Row], forgetting: f64) -> Vector3<f64> {
    let mut rls = Rls::new(Vector3::zeros(), &Vector3::repeat(START_VARIANCE), forgetting);
    for (features, observed) in rows {
        rls.update(features, *observed).expect("sound rows");
    }
    rls.belief.mean
}

fn mils<const L: usize>(rows: &[Row], penalty: Penalty<3>) -> Vector3<f64> {
    let start = Vector3::repeat(START_VARIANCE);
    let mut mils = Mils::<3, L>::new(Vector3::zeros(), &start, L, penalty);
    for (features, observed) in rows {
        mils.update(features, *observed).expect("sound rows");
    }
    *mils.estimate()
}
