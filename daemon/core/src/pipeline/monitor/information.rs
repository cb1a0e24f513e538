//! The likelihood ratio of every suspect against the base model.
//!
//! The rows are condensed into their information matrix. Each suspect is an alternative of its own: the base model and
//! that one parameter, all others being 0. With the base's block factorised, `S = L_jj - w'w` and `s = h_j - w'u` (the
//! Schur complement and its right side) give the parameter `s / (S + 1/sigma²)` and twice the log-likelihood ratio `s²
//! / (S + 1/sigma²)`; `ln(1 + S sigma²)` is the price of a free parameter, so that the difference is twice the
//! logarithm of the Bayes factor.

use dynocar_model::train::TrainModel;
use nalgebra::{SMatrix, SVector};

use super::rows::{DesignRow, ParameterVector};
use super::{BASE, CURVE, DAY_WIND, LOAD, MonitorSettings, PARAMETERS, WARMING};
use crate::filter::NotPositiveDefinite;
use crate::pipeline::momentum::{
    BRAKE_SCALE, DataSettings, FORCE_DELAY, SPEED_SCALE_MPS, TRACTION_SCALE, scaled,
};
use crate::pipeline::settings::{SettingError, require};

/// One value for each parameter of the base model.
pub type BaseVector = SVector<f64, BASE>;
type BaseMatrix = SMatrix<f64, BASE, BASE>;
/// Parameters in addition to the base model.
const SUSPECTS: usize = PARAMETERS - BASE;
type SuspectVector = SVector<f64, SUSPECTS>;

/// All rows, condensed.
#[derive(Clone, Debug, PartialEq)]
pub struct MonitorInformation {
    matrix: SMatrix<f64, PARAMETERS, PARAMETERS>,
    side: ParameterVector,
    square_sum: f64,
    /// Rows taken in, the forgotten ones in part.
    pub count: f64,
    base_precision: BaseVector,
}

/// The solved base model, and the information about each suspect that remains beyond it.
#[derive(Clone, Debug)]
pub struct BaseSolution {
    /// L, the base's factor.
    factor: BaseMatrix,
    /// L⁻¹ of the right side.
    reduced: BaseVector,
    /// L⁻¹ of the suspects' columns, transposed.
    columns: SMatrix<f64, SUSPECTS, BASE>,
    /// Schur complements of the suspects.
    own: SuspectVector,
    /// Their right sides.
    rest: SuspectVector,
    prior_variance: BaseVector,
}

/// Estimates of the base model, and of a suspect jointly with it.
#[derive(Clone, Debug)]
pub struct Believed<'a> {
    /// All parameters.
    pub values: ParameterVector,
    base: &'a BaseSolution,
    /// The suspect's index next to the base model, and its variance.
    suspect: Option<(usize, f64)>,
}

/// A suspect with the base model refitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alternative {
    /// Its parameter.
    pub value: f64,
    /// Precision of it.
    pub precision: f64,
    /// Cost of the freedom of its size.
    pub cost: f64,
}

impl Alternative {
    /// Returns a parameter of so much information and right side, and a prior standard deviation.
    fn new(own: f64, rest: f64, prior_std: f64) -> Self {
        let prior = prior_std * prior_std;
        let precision = own + 1.0 / prior;
        Alternative { value: rest / precision, precision, cost: (own * prior).ln_1p() }
    }

    /// Twice the log-likelihood ratio against parameters of no more than a size.
    pub fn beyond(&self, size: f64) -> f64 {
        let beyond = (self.value.abs() - size).max(0.0);
        beyond * beyond * self.precision
    }
}

impl BaseSolution {
    /// Returns a parameter of the base model: value and variance.
    pub fn parameter(&self, index: usize) -> (f64, f64) {
        let unit = BaseVector::from_fn(|i, _| if i == index { 1.0 } else { 0.0 });
        let solved = self.forward(unit);
        (solved.dot(&self.reduced), solved.norm_squared())
    }

    /// Returns the standard deviation of a parameter of the base model before the rows.
    pub fn usual_std(&self, index: usize) -> f64 {
        self.prior_variance[index].sqrt()
    }

    /// Returns a parameter of the base model that may be unusual, by a standard deviation beyond the usual one: its
    /// estimate if it is unusual, and twice the log-likelihood ratio of that against a usual value, with the price of
    /// the freedom.
    pub fn unusual(&self, index: usize, more_std: f64) -> (Alternative, (f64, f64)) {
        let (value, variance) = self.parameter(index);
        let usual = self.prior_variance[index];
        let own = (1.0 / variance - 1.0 / usual).max(0.0);
        let side = value / variance;
        let prior = usual + more_std * more_std;
        let precision = own + 1.0 / prior;
        let cost = (own * prior).ln_1p();
        let ratio = side * side * (1.0 / precision - variance).max(0.0);
        let given_other = (ratio, cost - (own * usual).ln_1p());
        (Alternative { value: side / precision, precision, cost }, given_other)
    }

    /// L⁻¹ of a column.
    fn forward(&self, mut column: BaseVector) -> BaseVector {
        for k in 0..BASE {
            column[k] /= self.factor[(k, k)];
            let solved = column[k];
            for below in k + 1..BASE {
                column[below] -= self.factor[(below, k)] * solved;
            }
        }
        column
    }

    /// L⁻ᵀ of a column.
    fn backward(&self, mut column: BaseVector) -> BaseVector {
        for k in (0..BASE).rev() {
            for below in k + 1..BASE {
                column[k] -= self.factor[(below, k)] * column[below];
            }
            column[k] /= self.factor[(k, k)];
        }
        column
    }

    /// Returns a suspect given the base model.
    pub fn alternative(&self, parameter: usize, prior_std: f64) -> Alternative {
        let index = parameter - BASE;
        Alternative::new(self.own[index], self.rest[index], prior_std)
    }

    /// Returns the estimates with a suspect, of a prior standard deviation, or without one.
    pub fn believed(&self, suspect: Option<(usize, f64)>) -> Believed<'_> {
        let mut values = ParameterVector::zeros();
        let mut reduced = self.reduced;
        let suspect = suspect.map(|(parameter, prior_std)| {
            let Alternative { value, precision, .. } = self.alternative(parameter, prior_std);
            values[parameter] = value;
            reduced.axpy(-value, &self.columns.row(parameter - BASE).transpose(), 1.0);
            (parameter - BASE, 1.0 / precision)
        });
        values.fixed_rows_mut::<BASE>(0).copy_from(&self.backward(reduced));
        Believed { values, base: self, suspect }
    }
}

impl Believed<'_> {
    /// Returns the variance of a sum of parameters that the rows leave.
    pub fn variance_of(&self, weights: &ParameterVector) -> f64 {
        let reduced = self.base.forward(weights.fixed_rows::<BASE>(0).into_owned());
        let by_suspect = self.suspect.map_or(0.0, |(index, variance)| {
            let weight =
                weights[BASE + index] - self.base.columns.row(index).transpose().dot(&reduced);
            weight * weight * variance
        });
        reduced.norm_squared() + by_suspect
    }
}

impl MonitorInformation {
    /// No rows, and a prior standard deviation of each base parameter.
    pub fn new(base_std: &BaseVector) -> Self {
        MonitorInformation {
            matrix: SMatrix::zeros(),
            side: ParameterVector::zeros(),
            square_sum: 0.0,
            count: 0.0,
            base_precision: base_std.map(|std| 1.0 / (std * std)),
        }
    }

    /// Takes in a row and forgets a little of the others.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn push(&mut self, row: &DesignRow, kept: f64) {
        self.matrix.ger(row.weight, &row.features, &row.features, kept);
        self.side.axpy(row.weight * row.observed, &row.features, kept);
        self.square_sum = kept * self.square_sum + row.weight * row.observed * row.observed;
        self.count = kept * self.count + 1.0;
    }

    /// Declares that a parameter has another value from now on, with a standard deviation of the difference: the
    /// information of the rows so far is integrated over that difference.
    pub fn loosen(&mut self, parameter: usize, std: f64) {
        let column: ParameterVector = self.matrix.column(parameter).into_owned();
        let pivot = column[parameter] + 1.0 / (std * std);
        let share = self.side[parameter] / pivot;
        self.matrix.ger(-1.0 / pivot, &column, &column, 1.0);
        self.side.axpy(-share, &column, 1.0);
        self.square_sum -= share * share * pivot;
    }

    /// Frees a parameter's place for other rows: either the parameter was 0 all along, or, with a prior standard
    /// deviation, the rows estimate it and it is integrated out.
    pub fn retire(&mut self, parameter: usize, prior_std: Option<f64>) {
        if let Some(std) = prior_std {
            self.loosen(parameter, std);
        }
        self.matrix.row_mut(parameter).fill(0.0);
        self.matrix.column_mut(parameter).fill(0.0);
        self.side[parameter] = 0.0;
    }

    /// Solves the base model.
    ///
    /// # Errors
    ///
    /// When its information matrix is not positive definite.
    pub fn base(&self) -> Result<BaseSolution, NotPositiveDefinite> {
        let mut matrix: BaseMatrix = self.matrix.fixed_view::<BASE, BASE>(0, 0).into_owned();
        for i in 0..BASE {
            matrix[(i, i)] += self.base_precision[i];
        }
        let factor = matrix.cholesky().ok_or(NotPositiveDefinite)?.unpack();
        let mut columns: SMatrix<f64, SUSPECTS, BASE> =
            self.matrix.fixed_view::<SUSPECTS, BASE>(BASE, 0).into_owned();
        let mut reduced: BaseVector = self.side.fixed_rows::<BASE>(0).into_owned();
        let mut own = SuspectVector::from_fn(|i, _| self.matrix[(BASE + i, BASE + i)]);
        let mut rest: SuspectVector = self.side.fixed_rows::<SUSPECTS>(BASE).into_owned();
        for k in 0..BASE {
            for before in 0..k {
                let share = -factor[(k, before)];
                reduced[k] += share * reduced[before];
                let (done, mut left) = columns.columns_range_pair_mut(before, k);
                left.axpy(share, &done, 1.0);
            }
            reduced[k] /= factor[(k, k)];
            let mut column = columns.column_mut(k);
            column /= factor[(k, k)];
            own.zip_apply(&column, |own, column| *own -= column * column);
            rest.axpy(-reduced[k], &column, 1.0);
        }
        own.apply(|own| *own = own.max(0.0));
        let prior_variance = self.base_precision.map(|precision| 1.0 / precision);
        Ok(BaseSolution { factor, reduced, columns, own, rest, prior_variance })
    }

    /// Returns a suspect given the base model and another suspect, both as free as their priors let them be.
    pub fn beyond_another(
        &self,
        base: &BaseSolution,
        (other, other_std): (usize, f64),
        (parameter, prior_std): (usize, f64),
    ) -> Alternative {
        let (taken, own) = (other - BASE, parameter - BASE);
        let pivot = base.own[taken] + 1.0 / (other_std * other_std);
        let common = base.columns.row(own).dot(&base.columns.row(taken));
        let share = (self.matrix[(parameter, other)] - common) / pivot;
        let left = (base.own[own] - share * share * pivot).max(0.0);
        Alternative::new(left, base.rest[own] - share * base.rest[taken], prior_std)
    }

    /// Returns the mean square of the residuals of the rows under the base model and a suspect of such a ratio.
    pub fn mean_square(&self, base: &BaseSolution, ratio: f64, prior_rows: f64) -> f64 {
        let rest = (self.square_sum - base.reduced.norm_squared() - ratio).max(0.0);
        (rest + prior_rows) / (self.count + prior_rows)
    }
}

/// Standard deviation of a curve constant of which nothing is declared, in 1000 N/kN m.
const CURVE_STD_MIN: f64 = 0.02;

/// Returns the base model of a train before the rows: the declared a, b, c, scaled, as base parameters, and the
/// standard deviations of their errors.
///
/// # Errors
///
/// When the scale of the forces is given at two places.
pub fn usual(
    settings: &MonitorSettings,
    train: &TrainModel,
) -> Result<(BaseVector, BaseVector), SettingError> {
    let force_scale_std = settings.data.force_scale_std;
    require(
        force_scale_std == DataSettings::default().force_scale_std,
        "data.force_scale_std",
        force_scale_std,
        "no value here: force_std_percent says it",
    )?;
    let declared = train.resistance;
    let coefficients = scaled(&declared);
    let mut declared_base = BaseVector::zeros();
    let mut base_std = BaseVector::zeros();
    for i in 0..coefficients.len() {
        declared_base[i] = coefficients[i];
        let least = 0.01 * declared.w0_n_per_kn(10.0).max(0.1);
        base_std[i] = (settings.davis_std_share * coefficients[i].abs()).max(least);
    }
    base_std[TRACTION_SCALE] = 0.01 * settings.force_std_percent;
    base_std[BRAKE_SCALE] = 0.01 * settings.force_std_percent;
    base_std[FORCE_DELAY] = settings.data.force_delay_std_s;
    // A load that nobody weighs counts from the middle of tare and full.
    let loads = train.load_range().map_or(0.0, |(middle_kg, std_kg)| std_kg / middle_kg);
    base_std[LOAD] = (0.01 * settings.mass_std_percent).max(loads);
    base_std[DAY_WIND] = settings.wind_std_mps;
    let curve = settings.curve_constant_std * 1e-3 * train.curve_constant_n_per_kn_m;
    base_std[CURVE] = curve.max(CURVE_STD_MIN);
    let over_a = declared.w0_n_per_kn(SPEED_SCALE_MPS) / declared.a.max(0.1);
    base_std[WARMING] = settings.warming_std * over_a;
    Ok((declared_base, base_std))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::momentum::TRACTION_SCALE;

    #[test]
    fn what_another_suspect_explains_is_not_found_next_to_it_and_what_it_does_not_is() {
        let [one, two] = [BASE, BASE + 1];
        let mut information = MonitorInformation::new(&BaseVector::repeat(1.0));
        for row in 0..400 {
            let at = |period: f64| (f64::from(row) / period).sin();
            let mut features = ParameterVector::zeros();
            (features[0], features[one], features[two]) = (at(3.0), at(5.0), at(5.0) + at(7.0));
            let observed = 2.0 * features[one] + 0.7 * at(9.0);
            information.push(&DesignRow { features, observed, weight: 1.0 }, 1.0);
        }
        let base = information.base().unwrap();
        let alone = base.alternative(two, 1.0);
        let given_other = information.beyond_another(&base, (one, 1.0), (two, 1.0));
        assert!(alone.beyond(0.0) > 100.0, "{alone:?}");
        assert!(given_other.beyond(0.0) < 0.05 * alone.beyond(0.0), "{given_other:?}");
        // The same by solving both at once.
        let matrix = nalgebra::Matrix3::from_fn(|i, j| {
            let place = [0, one, two];
            information.matrix[(place[i], place[j])] + if i == j { 1.0 } else { 0.0 }
        });
        let side = nalgebra::Vector3::from_fn(|i, _| information.side[[0, one, two][i]]);
        let both = matrix.try_inverse().unwrap() * side;
        assert!((both[2] - given_other.value).abs() < 1e-9, "{both} {given_other:?}");
    }

    #[test]
    fn a_scale_that_is_another_in_each_run_keeps_its_value_and_is_no_surer_than_runs_differ() {
        let mut information = MonitorInformation::new(&BaseVector::repeat(1.0));
        let mut features = ParameterVector::zeros();
        features[TRACTION_SCALE] = 1e4;
        information.push(&DesignRow { features, observed: 0.02 * 1e4, weight: 1.0 }, 1.0);
        let scale = |it: &MonitorInformation| it.base().unwrap().parameter(TRACTION_SCALE);
        assert!(scale(&information).1.sqrt() < 2e-4);
        information.loosen(TRACTION_SCALE, 0.003);
        let (value, variance) = scale(&information);
        assert!((value - 0.02).abs() < 1e-6, "{value}");
        assert!((variance.sqrt() - 0.003).abs() < 1e-5, "{variance}");
    }
}
