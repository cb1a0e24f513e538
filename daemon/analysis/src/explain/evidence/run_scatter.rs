//! Differences from run to run that are no effect: the scale of the force sensors, the resistance and the wind of the
//! day, and the delay of the forces' time stamps.
//!
//! Each run has a factor of its own on the control force and one on the basic resistance, both near 1, a headwind of
//! its own, and a small delay. The standard deviations of factors and headwinds are estimated from the runs. All are
//! integrated out of every fit, so that the scatter between the runs decides about effects that all runs share, and a
//! few hundredths of a second between force and speed do not distort the resistance.

use std::sync::Arc;

use dynocar_model::terms::{masses, wind};
use dynocar_model::train::Davis;
use nalgebra::{SMatrix, SVector};

use super::integral::integrate_bins;
use super::noise::{Noise, RunScatter};
use super::run_data::RunData;
use super::whitener::{BinWhitener, robust_weight};

/// A run's own deviations: of the factors on the control force and on the basic resistance from
/// 1, the headwind in m/s, and the delay of the force in s.
pub const DEVIATIONS: usize = 4;
/// The deviations of a run, and their covariance or its inverse.
pub type RunFactors = SVector<f64, DEVIATIONS>;
pub type FactorMatrix = SMatrix<f64, DEVIATIONS, DEVIATIONS>;

/// Columns of the deviations.
pub type DeviationColumns = [Vec<f64>; DEVIATIONS];

/// Standard deviation in s of a run's own delay of the forces: stamps, filters and holds of a
/// recorder.
const DELAY_S: f64 = 0.02;

/// Weight of the prior of the scatter between runs, as a number of runs.
pub const PRIOR_RUNS: f64 = 4.0;
/// The same of loads and winds that are fitted jointly with a finished model: the runs show these themselves.
const PRIOR_RUNS_BESIDE: f64 = 0.5;

impl RunScatter {
    /// Beyond these a factor is an effect and no scatter.
    pub(super) const MOST: RunScatter =
        RunScatter { force: 0.008, resistance: 0.03, wind_mps: 0.01 };
    /// Upper limit of the scatter by weighed loads and winds of ordinary days.
    pub(super) const MOST_BESIDE: RunScatter =
        RunScatter { force: 0.05, resistance: 0.05, wind_mps: 2.5 };

    fn precision(self) -> FactorMatrix {
        let deviations = RunFactors::new(self.force, self.resistance, self.wind_mps, DELAY_S);
        FactorMatrix::from_diagonal(&deviations.map(|deviation| deviation.powi(-2)))
    }

    /// The scatter under which the factors of the runs are likeliest (one step of expectation
    /// maximisation), shrunk towards the usual one and no more than the most.
    pub fn updated(factors: &[(RunFactors, FactorMatrix)], most: RunScatter) -> Self {
        let (usual, count) = (RunScatter::USUAL, factors.len() as f64);
        let mean_square = |k: usize, (usual, prior_runs): (f64, f64), most: f64| {
            let seen: f64 = factors.iter().map(|(u, m)| u[k] * u[k] + m[(k, k)]).sum();
            ((seen + prior_runs * usual * usual) / (count + prior_runs)).sqrt().min(most)
        };
        let (load, wind) = if most == RunScatter::MOST_BESIDE {
            ((masses::WEIGHED_STD, PRIOR_RUNS_BESIDE), (usual.wind_mps, PRIOR_RUNS_BESIDE))
        } else {
            ((usual.force, PRIOR_RUNS), (usual.wind_mps, PRIOR_RUNS))
        };
        RunScatter {
            force: mean_square(0, load, most.force),
            resistance: mean_square(1, (usual.resistance, PRIOR_RUNS), most.resistance),
            wind_mps: mean_square(2, wind, most.wind_mps),
        }
    }
}

/// Speeds in m/s at the bins that a factor of 2 instead of 1 would add (control force, basic
/// resistance), and a delay of the control force by 1 s, to first order.
pub fn scatter_columns(run: &RunData, davis: Davis) -> DeviationColumns {
    let samples = run.samples();
    let mut columns = DeviationColumns::default();
    let force =
        |i: usize| samples[i].control_force_n().unwrap_or(0.0) / samples[i].inertial_mass_kg;
    let [by_force, by_resistance, by_wind, by_delay] = &mut columns;
    let resistance = |i: usize| {
        let per_unit = samples[i].weight_kn / samples[i].inertial_mass_kg;
        -per_unit * davis.w0_n_per_kn(run.smooth_mps[i])
    };
    let wind = |i: usize| {
        let per_unit = samples[i].weight_kn / samples[i].inertial_mass_kg;
        let tunnel_share = samples[i].tunnel_share.unwrap_or(0.0);
        -per_unit * wind::slope_n_per_kn(davis.c, run.smooth_mps[i], tunnel_share)
    };
    let by = [by_force, by_resistance, by_wind];
    integrate_bins(run, |i| [force(i), resistance(i), wind(i)], by);
    // The integral of the force's slope is the force.
    let mut segment = usize::MAX;
    let mut at_start = 0.0;
    for bin in &run.bins {
        if bin.segment != segment {
            (segment, at_start) = (bin.segment, force(bin.first));
        }
        let mean = (bin.first..bin.end).map(force).sum::<f64>() / (bin.end - bin.first) as f64;
        by_delay.push(at_start - mean);
    }
    columns
}

/// Coefficients with a run's own resistance and headwind, as outside tunnels.
pub fn of_day(Davis { a, b, c }: Davis, own: &RunFactors) -> Davis {
    let [_, resistance, wind_mps, _] = (*own).into();
    let factor = 1.0 + resistance;
    let by_wind = wind_mps * wind::slope_n_per_kn(c, 1.0, 0.0);
    Davis { a: factor * a, b: factor * b + by_wind, c: factor * c }
}

/// Returns all columns of each bin, in order.
fn rows([c0, c1, c2, c3]: &DeviationColumns) -> impl Iterator<Item = [f64; DEVIATIONS]> {
    c0.iter().zip(c1).zip(c2).zip(c3).map(|(((c0, c1), c2), c3)| [*c0, *c1, *c2, *c3])
}

/// Returns a series less the share that deviations explain by their columns.
pub fn remove(columns: &DeviationColumns, series: &[f64], deviations: &RunFactors) -> Vec<f64> {
    let [d0, d1, d2, d3] = (*deviations).into();
    let rows = series.iter().zip(rows(columns));
    rows.map(|(value, [c0, c1, c2, c3])| value - (d0 * c0 + d1 * c1 + d2 * c2 + d3 * c3)).collect()
}

/// Removes the runs' own factors from whitened series of one run.
#[derive(Clone, Debug)]
pub struct ScatterFilter {
    columns: Arc<DeviationColumns>,
    precision: FactorMatrix,
}

/// The filter with the weights of the innovations.
#[derive(Clone, Debug)]
pub struct WeightedFilter {
    columns: Arc<DeviationColumns>,
    weights: Arc<[f64]>,
    /// Covariance of the factors after the run.
    pub covariance: FactorMatrix,
    /// Logarithm of the determinant that the factors add.
    pub log_determinant: f64,
}

impl ScatterFilter {
    /// The filter of a run from its columns under a noise.
    pub fn new(columns: &DeviationColumns, whitener: &BinWhitener, scatter: RunScatter) -> Self {
        let mut whitened = columns.clone();
        whitener.whiten_all(&mut whitened);
        ScatterFilter { columns: whitened.into(), precision: scatter.precision() }
    }

    /// The filter with given weights of the innovations.
    pub fn weighted(&self, weights: Vec<f64>) -> WeightedFilter {
        let mut products = [[0.0; DEVIATIONS]; DEVIATIONS];
        for (row, weight) in rows(&self.columns).zip(&weights) {
            for i in 0..DEVIATIONS {
                for j in 0..=i {
                    products[i][j] += weight * row[i] * row[j];
                }
            }
        }
        let mut information = self.precision;
        for i in 0..DEVIATIONS {
            for j in 0..=i {
                let sum = self.precision[(i, j)] + products[i][j];
                (information[(i, j)], information[(j, i)]) = (sum, sum);
            }
        }
        // A sum of a positive definite and a positive semidefinite matrix.
        let covariance = information.try_inverse().unwrap_or_else(FactorMatrix::zeros);
        let log_determinant = (information.determinant() / self.precision.determinant()).ln();
        let (columns, weights) = (self.columns.clone(), weights.into());
        WeightedFilter { columns, weights, covariance, log_determinant }
    }

    /// Cost of the factors themselves.
    pub fn prior_cost(&self, factors: &RunFactors) -> f64 {
        factors.dot(&(self.precision * factors))
    }
}

impl WeightedFilter {
    /// The factors, less 1, and the delay that fit a whitened series best.
    pub fn factors(&self, series: &[f64]) -> RunFactors {
        let mut products = RunFactors::zeros();
        for ((row, value), weight) in rows(&self.columns).zip(series).zip(&self.weights[..]) {
            for k in 0..DEVIATIONS {
                products[k] += weight * row[k] * value;
            }
        }
        self.covariance * products
    }

    /// Returns the explained part of the square of a series, given its weighted products with the columns.
    pub fn explained(&self, products: [f64; DEVIATIONS]) -> f64 {
        let products = RunFactors::from(products);
        products.dot(&(self.covariance * products))
    }

    /// The whitened columns of the factors.
    pub fn columns(&self) -> &DeviationColumns {
        &self.columns
    }

    /// Returns a series less the share that the factors explain.
    pub fn remove(&self, series: &[f64], factors: &RunFactors) -> Vec<f64> {
        remove(&self.columns, series, factors)
    }

    /// Weights of the innovations.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }
}

/// The filters of one run under a noise.
#[derive(Clone)]
pub(super) struct RunFilters {
    pub whitener: BinWhitener,
    pub scatter: ScatterFilter,
}

/// Those of all runs.
pub(super) type SharedFilters = Arc<[RunFilters]>;

/// Innovations of one run, with the filter, the factors and the cost that follow from them.
pub(super) struct Whitened {
    pub innovations: Vec<f64>,
    pub filter: WeightedFilter,
    pub factors: RunFactors,
    pub cost: f64,
}

impl RunFilters {
    /// Those of a run from the columns of its own factors.
    pub fn new(run: &RunData, columns: &DeviationColumns, noise: Noise) -> Self {
        let whitener = BinWhitener::new(run, noise);
        let scatter = ScatterFilter::new(columns, &whitener, noise.scatter);
        RunFilters { whitener, scatter }
    }

    /// Robust innovations of a series of bin differences.
    pub fn whitened(&self, residual: &[f64], scratch: &mut Vec<f64>) -> Whitened {
        self.whitener.whiten(residual, scratch);
        let weights = |series: &[f64]| series.iter().map(|&nu| robust_weight(nu)).collect();
        let rough = self.scatter.weighted(weights(scratch));
        let less = rough.remove(scratch, &rough.factors(scratch));
        let filter = self.scatter.weighted(weights(&less));
        let factors = filter.factors(scratch);
        let innovations = filter.remove(scratch, &factors);
        let cost = self.whitener.minus_two_log_likelihood(&innovations)
            + self.scatter.prior_cost(&factors)
            + filter.log_determinant;
        Whitened { innovations, filter, factors, cost }
    }
}
