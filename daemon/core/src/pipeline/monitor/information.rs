//! The likelihood ratio of every suspect against the base model.
//!
//! The rows are condensed into their information matrix. Each suspect is an alternative of its
//! own: the base model and that one parameter, all others being 0. With the base's block
//! factorised, `S = L_jj - w'w` and `s = h_j - w'u` (the Schur complement and its right side)
//! give the parameter `s / (S + 1/sigma²)` and twice the log-likelihood ratio
//! `s² / (S + 1/sigma²)`; `ln(1 + S sigma²)` is what the freedom of its size costs, so that the
//! difference is twice the logarithm of the Bayes factor.

use nalgebra::{Cholesky, Const, SMatrix, SVector};

use super::rows::{Parameters, Row};
use super::suspects::{BASE, PARAMETERS};
use crate::filter::NotPositiveDefinite;

/// One value for each parameter of the base model.
pub type BaseVector = SVector<f64, BASE>;
type BaseMatrix = SMatrix<f64, BASE, BASE>;

/// Base parameters and a suspect.
pub const JOINT: usize = BASE + 1;

/// All rows, condensed.
#[derive(Clone, Debug, PartialEq)]
pub struct Information {
    matrix: SMatrix<f64, PARAMETERS, PARAMETERS>,
    side: Parameters,
    square_sum: f64,
    count: f64,
    base_precision: BaseVector,
}

/// The base model solved.
#[derive(Clone, Debug)]
pub struct BaseSolution {
    factor: Cholesky<f64, Const<BASE>>,
    /// L⁻¹ of the right side.
    reduced: BaseVector,
}

/// A suspect with the base model refitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alternative {
    /// Its parameter.
    pub value: f64,
    /// Precision of it.
    pub precision: f64,
    /// What the freedom of its size costs.
    pub cost: f64,
}

impl Alternative {
    /// Twice the log-likelihood ratio against parameters of no more than a size.
    pub fn beyond(&self, size: f64) -> f64 {
        let beyond = (self.value.abs() - size).max(0.0);
        beyond * beyond * self.precision
    }
}

impl BaseSolution {
    /// A parameter of the base model: value and variance.
    pub fn parameter(&self, place: usize) -> (f64, f64) {
        let unit = BaseVector::from_fn(|i, _| if i == place { 1.0 } else { 0.0 });
        let solved = self.factor.l_dirty().solve_lower_triangular(&unit).unwrap_or(unit);
        (solved.dot(&self.reduced), solved.norm_squared())
    }
}

impl Information {
    /// No rows, and a prior standard deviation of each base parameter.
    pub fn new(base_std: &BaseVector) -> Self {
        Information {
            matrix: SMatrix::zeros(),
            side: Parameters::zeros(),
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
    pub fn push(&mut self, row: &Row, kept: f64) {
        self.matrix.ger(row.weight, &row.features, &row.features, kept);
        self.side.axpy(row.weight * row.observed, &row.features, kept);
        self.square_sum = kept * self.square_sum + row.weight * row.observed * row.observed;
        self.count = kept * self.count + 1.0;
    }

    /// Rows taken in, the forgotten ones in part.
    pub fn count(&self) -> f64 {
        self.count
    }

    /// A parameter is another from now on, by a standard deviation: what the rows so far say of it
    /// is integrated over the difference.
    pub fn loosen(&mut self, parameter: usize, std: f64) {
        let column: Parameters = self.matrix.column(parameter).into_owned();
        let pivot = column[parameter] + 1.0 / (std * std);
        let share = self.side[parameter] / pivot;
        self.matrix.ger(-1.0 / pivot, &column, &column, 1.0);
        self.side.axpy(-share, &column, 1.0);
        self.square_sum -= share * share * pivot;
    }

    /// Frees a parameter's place for other rows: either it was 0 all along, or, with a prior
    /// standard deviation, it was what the rows say and is integrated out.
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
        let factor = matrix.cholesky().ok_or(NotPositiveDefinite)?;
        let side: BaseVector = self.side.fixed_rows::<BASE>(0).into_owned();
        let reduced = factor.l_dirty().solve_lower_triangular(&side).ok_or(NotPositiveDefinite)?;
        Ok(BaseSolution { reduced, factor })
    }

    /// A suspect beside the base model.
    pub fn alternative(
        &self,
        base: &BaseSolution,
        parameter: usize,
        prior_std: f64,
    ) -> Alternative {
        let none = Alternative { value: 0.0, precision: 0.0, cost: 0.0 };
        let column: BaseVector = self.matrix.fixed_view::<BASE, 1>(0, parameter).into_owned();
        let Some(reduced) = base.factor.l_dirty().solve_lower_triangular(&column) else {
            return none;
        };
        let own = (self.matrix[(parameter, parameter)] - reduced.norm_squared()).max(0.0);
        let rest = self.side[parameter] - reduced.dot(&base.reduced);
        let precision = own + 1.0 / (prior_std * prior_std);
        Alternative {
            value: rest / precision,
            precision,
            cost: (own * prior_std * prior_std).ln_1p(),
        }
    }

    /// A suspect beside the base model and another suspect, both as free as their priors let them be.
    pub fn beyond_another(
        &self,
        base: &BaseSolution,
        (other, other_std): (usize, f64),
        (parameter, prior_std): (usize, f64),
    ) -> Alternative {
        let none = Alternative { value: 0.0, precision: 0.0, cost: 0.0 };
        let reduced = |place: usize| {
            let column: BaseVector = self.matrix.fixed_view::<BASE, 1>(0, place).into_owned();
            base.factor.l_dirty().solve_lower_triangular(&column)
        };
        let (Some(taken), Some(own)) = (reduced(other), reduced(parameter)) else { return none };
        let pivot = (self.matrix[(other, other)] - taken.norm_squared()).max(0.0)
            + 1.0 / (other_std * other_std);
        let share = (self.matrix[(parameter, other)] - own.dot(&taken)) / pivot;
        let left =
            (self.matrix[(parameter, parameter)] - own.norm_squared() - share * share * pivot)
                .max(0.0);
        let rest = self.side[parameter]
            - own.dot(&base.reduced)
            - share * (self.side[other] - taken.dot(&base.reduced));
        let precision = left + 1.0 / (prior_std * prior_std);
        let cost = (left * prior_std * prior_std).ln_1p();
        Alternative { value: rest / precision, precision, cost }
    }

    /// A suspect that the base model holds in part, with that part: against the base model alone, a
    /// small scale is free, so that a scale of any size would have little to speak for it.
    pub fn together(&self, base: (usize, f64), suspect: (usize, f64)) -> Alternative {
        let none = Alternative { value: 0.0, precision: 0.0, cost: 0.0 };
        let ((place, base_std), (parameter, prior_std)) = (base, suspect);
        let Ok((values, covariance)) = self.joint(parameter, prior_std) else { return none };
        // The suspect's column is the base model's with the other sign.
        let value = values[BASE] - values[place];
        let variance =
            covariance[(BASE, BASE)] + covariance[(place, place)] - 2.0 * covariance[(BASE, place)];
        let prior = prior_std * prior_std + base_std * base_std;
        if !(variance > 0.0 && variance <= prior) {
            return none;
        }
        Alternative { value, precision: 1.0 / variance, cost: (prior / variance).ln() }
    }

    /// Mean square of what base model and a suspect of such a ratio leave of the rows.
    pub fn mean_square(&self, base: &BaseSolution, ratio: f64, prior_rows: f64) -> f64 {
        let rest = (self.square_sum - base.reduced.norm_squared() - ratio).max(0.0);
        (rest + prior_rows) / (self.count + prior_rows)
    }

    /// Base parameters and one suspect together: values and covariance.
    ///
    /// # Errors
    ///
    /// When their information matrix is not positive definite.
    pub fn joint(
        &self,
        parameter: usize,
        prior_std: f64,
    ) -> Result<(SVector<f64, JOINT>, SMatrix<f64, JOINT, JOINT>), NotPositiveDefinite> {
        let place = |i: usize| if i < BASE { i } else { parameter };
        let mut matrix =
            SMatrix::<f64, JOINT, JOINT>::from_fn(|i, j| self.matrix[(place(i), place(j))]);
        for i in 0..BASE {
            matrix[(i, i)] += self.base_precision[i];
        }
        matrix[(BASE, BASE)] += 1.0 / (prior_std * prior_std);
        let side = SVector::<f64, JOINT>::from_fn(|i, _| self.side[place(i)]);
        let factor = matrix.cholesky().ok_or(NotPositiveDefinite)?;
        Ok((factor.solve(&side), factor.inverse()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::resistance::regression::TRACTION_SCALE;

    #[test]
    fn what_another_suspect_explains_is_not_found_beside_it_and_what_it_does_not_is() {
        let [one, two] = [BASE, BASE + 1];
        let mut information = Information::new(&BaseVector::repeat(1.0));
        for row in 0..400 {
            let at = |period: f64| (f64::from(row) / period).sin();
            let mut features = Parameters::zeros();
            (features[0], features[one], features[two]) = (at(3.0), at(5.0), at(5.0) + at(7.0));
            let observed = 2.0 * features[one] + 0.7 * at(9.0);
            information.push(&Row { features, observed, weight: 1.0 }, 1.0);
        }
        let base = information.base().unwrap();
        let alone = information.alternative(&base, two, 1.0);
        let beside = information.beyond_another(&base, (one, 1.0), (two, 1.0));
        assert!(alone.beyond(0.0) > 100.0, "{alone:?}");
        assert!(beside.beyond(0.0) < 0.05 * alone.beyond(0.0), "{beside:?}");
        // The same by solving both at once.
        let matrix = nalgebra::Matrix3::from_fn(|i, j| {
            let place = [0, one, two];
            information.matrix[(place[i], place[j])] + if i == j { 1.0 } else { 0.0 }
        });
        let side = nalgebra::Vector3::from_fn(|i, _| information.side[[0, one, two][i]]);
        let both = matrix.try_inverse().unwrap() * side;
        assert!((both[2] - beside.value).abs() < 1e-9, "{both} {beside:?}");
    }

    #[test]
    fn a_scale_that_is_another_in_each_run_keeps_its_value_and_is_no_surer_than_runs_differ() {
        let mut information = Information::new(&BaseVector::repeat(1.0));
        let mut features = Parameters::zeros();
        features[TRACTION_SCALE] = 1e4;
        information.push(&Row { features, observed: 0.02 * 1e4, weight: 1.0 }, 1.0);
        let scale = |it: &Information| it.base().unwrap().parameter(TRACTION_SCALE);
        assert!(scale(&information).1.sqrt() < 2e-4);
        information.loosen(TRACTION_SCALE, 0.003);
        let (value, variance) = scale(&information);
        assert!((value - 0.02).abs() < 1e-6, "{value}");
        assert!((variance.sqrt() - 0.003).abs() < 1e-5, "{variance}");
    }
}
