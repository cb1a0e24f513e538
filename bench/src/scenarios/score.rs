//! What an answer was worth over a drive.

use dynocar_shared::{HALF_95, Parameter, ParameterSnapshot, Quantity};

use nalgebra::{Matrix4, Vector4};

use super::drive::Moment;

/// Deviations beyond which an answer is wrong.
const WRONG: f64 = 4.0;

/// One quantity of one pipeline over one drive.
#[derive(Clone, Debug, Default)]
pub struct Score {
    /// Cycles of the moving train, from the first use on where `usable` is counted.
    pub cycles: u64,
    /// Those in which the answer was called usable.
    pub usable: u64,
    /// Of those, the truth within the 95 % interval.
    pub covered: u64,
    /// Time in s until the first usable answer.
    pub first_s: Option<f64>,
    /// Changes of usable.
    pub changes: u64,
    /// Longest time in s that a usable answer was wrong.
    pub wrong_s: f64,
    wrong_now_s: f64,
    /// Sums of squares of the usable answers' errors and of their deviations, relative to the truth.
    pub error_square: f64,
    /// See `error_square`.
    pub deviation_square: f64,
    /// Sums of squares of errors and of least deviations at the instants where both are compared.
    at_instants: [f64; 2],
    was_usable: bool,
}

impl Score {
    /// Takes in a cycle of so many s.
    pub fn push(&mut self, time_s: f64, cycle_s: f64, answer: Option<ScoredAnswer>) {
        self.cycles += 1;
        let is_usable = answer.is_some();
        self.changes += u64::from(is_usable != self.was_usable);
        self.was_usable = is_usable;
        let Some(ScoredAnswer { error, deviation }) = answer else {
            self.wrong_now_s = 0.0;
            return;
        };
        self.usable += 1;
        self.first_s.get_or_insert(time_s);
        self.covered += u64::from(error.abs() <= HALF_95 * deviation);
        self.error_square += error * error;
        self.deviation_square += deviation * deviation;
        self.wrong_now_s =
            if error.abs() > WRONG * deviation { self.wrong_now_s + cycle_s } else { 0.0 };
        self.wrong_s = self.wrong_s.max(self.wrong_now_s);
    }

    /// Joins another drive's.
    pub fn join(&mut self, other: &Score) {
        self.cycles += other.cycles;
        self.usable += other.usable;
        self.covered += other.covered;
        self.changes += other.changes;
        self.wrong_s = self.wrong_s.max(other.wrong_s);
        self.error_square += other.error_square;
        self.deviation_square += other.deviation_square;
        for (sum, more) in self.at_instants.iter_mut().zip(other.at_instants) {
            *sum += more;
        }
    }

    /// Takes in a usable answer's error and the least deviation, both relative to the truth.
    pub fn compare(&mut self, error: f64, least: f64) {
        self.at_instants[0] += error * error;
        self.at_instants[1] += least * least;
    }

    /// Errors over the least deviations; `None` where they were never compared.
    pub fn over_bound(&self) -> Option<f64> {
        let [error, least] = self.at_instants;
        (least > 0.0).then(|| (error / least).sqrt())
    }
}

/// The least relative deviation of a quantity by the bound of the drive.
pub fn least_deviation(bound: &Matrix4<f64>, quantity: Quantity, moment: &Moment) -> f64 {
    let v = moment.speed_mps;
    let row = match quantity {
        Quantity::Resistance => Vector4::new(1.0, v, v * v, 0.0) / moment.w0_n_per_kn,
        _ => Vector4::new(0.0, 0.0, 0.0, 1.0),
    };
    row.dot(&(bound * row)).max(0.0).sqrt()
}

/// A usable answer: error and standard deviation, both relative to the truth.
#[derive(Clone, Copy, Debug)]
pub struct ScoredAnswer {
    /// Error over the truth.
    pub error: f64,
    /// Standard deviation over the truth.
    pub deviation: f64,
}

/// The resistance at the speed driven or the mass, if a snapshot may be used for it.
pub fn answer(
    snapshot: &ParameterSnapshot,
    quantity: Quantity,
    moment: &Moment,
) -> Option<ScoredAnswer> {
    if !snapshot.is_usable_for(quantity) {
        return None;
    }
    let (value, deviation, truth) = match quantity {
        Quantity::Resistance => {
            let at = snapshot.resistance_at(moment.speed_mps)?;
            (at.w0_n_per_kn, at.w0_std_n_per_kn, moment.w0_n_per_kn)
        }
        _ => {
            let mass_t = snapshot.value(Parameter::Mass)?;
            (mass_t, snapshot.std(Parameter::Mass)?, 1e-3 * moment.mass_kg)
        }
    };
    Some(ScoredAnswer { error: (value - truth) / truth, deviation: deviation / truth })
}
