//! Liu 2018: Davis coefficients from coasting by least squares in all its recursions.
//!
//! The paper's data are not published; its figures stand beside ours on the scenario of
//! [`scenario`]. Errors are those of w0 over 40 to 72 km/h, where the runs coast, since a, b and
//! c are hardly told apart there.

pub mod bound;
pub mod methods;
pub mod scenario;

use std::sync::Arc;

use dynocar_core::pipeline::resistance::output_error::{
    DrivenRun, DrivenSpeed, OutputErrorSettings, fit_output_error,
};
use dynocar_core::pipeline::{EstimatorSettings, Pipeline};
use dynocar_core::train::{Davis, TrainModel};
use dynocar_shared::snapshot::packed_index;
use dynocar_shared::{PipelineKind, SampleField, TrainId, TrainSample};
use nalgebra::{Matrix3, Vector3};

use self::methods::Method;
use self::scenario::{COMPARED_KMH, Condition, Measured, ROTATING_MASS_FACTOR, STEP_S, davis};
use super::row::Row;
use super::seeds::Seeds;
use super::statistics::{mean, root_mean_square};

const PAPER: &str = "Liu 2018";

/// An estimate with its covariance, for speeds in m/s.
#[derive(Clone, Copy, Debug)]
struct Estimate {
    davis: Davis,
    covariance: Matrix3<f64>,
}

/// Errors, coverage and consistency of one method over the seeds.
#[derive(Clone, Debug, Default)]
struct Score {
    errors: Vec<f64>,
    held: Vec<f64>,
    nees: Vec<f64>,
}

impl Score {
    fn take(&mut self, estimate: &Estimate) {
        let errors = scenario::errors(&estimate.davis);
        for (kmh, error) in COMPARED_KMH.zip(&errors) {
            let speed_mps = f64::from(kmh) / 3.6;
            let powers = Vector3::new(1.0, speed_mps, speed_mps * speed_mps);
            let std = powers.dot(&(estimate.covariance * powers)).sqrt();
            self.held.push(f64::from(error.abs() < 1.96 * std));
        }
        self.errors.extend(errors);
        let truth = scenario::truth();
        let Davis { a, b, c } = estimate.davis;
        let error = Vector3::new(a - truth.a, b - truth.b, c - truth.c);
        if let Some(factor) = estimate.covariance.cholesky() {
            self.nees.push(error.dot(&factor.solve(&error)) / 3.0);
        }
    }
}

/// Rows for every method under every condition, over seeded runs.
pub fn rows(seeds: Seeds) -> Vec<Row> {
    let mut rows: Vec<Row> =
        Condition::ALL.into_iter().flat_map(|condition| accuracy(condition, seeds)).collect();
    rows.extend(table_1(seeds));
    rows
}

fn accuracy(condition: Condition, seeds: Seeds) -> Vec<Row> {
    let mut of_methods = vec![Vec::new(); Method::ALL.len()];
    let (mut ours, mut online) = (Score::default(), Score::default());
    let mut bounds = Vec::new();
    for seed in seeds.range() {
        let runs = scenario::measure(condition, seed);
        let segments = methods::segments(&runs);
        for (errors, method) in of_methods.iter_mut().zip(Method::ALL) {
            if let Some(theta_kmh) = method.estimate(&segments) {
                errors.extend(scenario::errors(&davis(theta_kmh)));
            }
        }
        if let Some(estimate) = output_error(&runs) {
            ours.take(&estimate);
        }
        online.take(&live(&runs));
        bounds.push(bound_of(condition, &runs));
    }
    let row = |quantity: String, method: Option<f64>, score: &Score| Row {
        paper: PAPER,
        table: "Table 1, section 4.2",
        quantity: format!("w0 over 40-72 km/h, {quantity}, {}", condition.name()),
        unit: "N/kN",
        published: None,
        paper_method: method,
        baseline: Some(root_mean_square(&of_methods[0])),
        ours: Some(root_mean_square(&score.errors)),
        bound: Some(root_mean_square(&bounds)),
        seeds: seeds.count,
        coverage: Some(mean(&score.held)),
        nees: Some(mean(&score.nees)),
        nees_freedom: Some(3.0 * score.nees.len() as f64),
    };
    let mut rows: Vec<Row> = Method::ALL
        .iter()
        .zip(&of_methods)
        .map(|(method, errors)| row(method.name(), Some(root_mean_square(errors)), &ours))
        .collect();
    rows.push(row("online: resistance_kalman".into(), None, &online));
    rows
}

/// The bound for the samples that a seed kept.
fn bound_of(condition: Condition, runs: &[Vec<Measured>]) -> f64 {
    let kept: Vec<Vec<bool>> = runs
        .iter()
        .map(|run| {
            let last = run.last().map_or(0.0, |sample| sample.time_s);
            let mut kept = vec![false; (last / STEP_S).round() as usize + 1];
            for sample in run {
                kept[(sample.time_s / STEP_S).round() as usize] = true;
            }
            kept
        })
        .collect();
    let is_kept = |run: usize, index: usize| kept[run].get(index).copied().unwrap_or(false);
    bound::root_mean_variance(&bound::covariance(condition, is_kept))
}

/// Our fit of whole runs: output error with Student's t.
fn output_error(runs: &[Vec<Measured>]) -> Option<Estimate> {
    let samples: Vec<Vec<DrivenSpeed>> = runs
        .iter()
        .map(|run| {
            run.iter()
                .map(|sample| DrivenSpeed {
                    time_s: sample.time_s,
                    speed_mps: sample.speed_kmh / 3.6,
                    driving_n_per_kn: 0.0,
                })
                .collect()
        })
        .collect();
    let runs: Vec<DrivenRun> = samples
        .iter()
        .map(|samples| DrivenRun { samples, rotating_mass_factor: ROTATING_MASS_FACTOR })
        .collect();
    let settings = OutputErrorSettings::default();
    let fit = fit_output_error(&runs, &settings).ok()?;
    Some(Estimate { davis: fit.davis, covariance: fit.covariance })
}

/// The live pipeline over the same samples, with its default settings.
fn live(runs: &[Vec<Measured>]) -> Estimate {
    let train = Arc::new(TrainModel {
        name: "Liu 2018".into(),
        mass_kg: 200_000.0,
        length_m: 120.0,
        cars: 6,
        rotating_mass_factor: ROTATING_MASS_FACTOR,
        // Declared wrongly, as in practice.
        resistance: Davis { a: 1.5, b: 0.03, c: 0.012 },
        curve_constant_n_per_kn_m: 0.0,
        tunnel_constant_n_per_kn_m: 0.0,
        traction: None,
        brake: None,
        brake_gear: Default::default(),
        corrections: Default::default(),
    });
    let settings = EstimatorSettings::default_of(PipelineKind::ResistanceKalman)
        .expect("the kind can be built");
    let estimator = settings.build(&train).expect("default settings are in range");
    let mut pipeline = Pipeline::new(TrainId(1), 0, train, None, estimator);
    let mut sequence = 0;
    for (run, samples) in runs.iter().enumerate() {
        for measured in samples {
            sequence += 1;
            let mut sample = TrainSample::empty(TrainId(1))
                .with(SampleField::Speed, measured.speed_kmh / 3.6)
                .with(SampleField::TractionForce, 0.0)
                .with(SampleField::BrakeForce, 0.0)
                .with(SampleField::Gradient, 0.0);
            sample.time_ns = (measured.time_s * 1e9).round() as i64;
            (sample.sequence, sample.run) = (sequence, run as u32);
            pipeline.process(&sample);
        }
    }
    let snapshot = pipeline.snapshot();
    let values = snapshot.values;
    Estimate {
        davis: Davis { a: values[0], b: values[1], c: values[2] },
        covariance: Matrix3::from_fn(|i, j| snapshot.covariance[packed_index(i, j)]),
    }
}

/// Table 1's last column: the variance of the segments' residuals. The paper's are of its own
/// recorded data, so that only the order of the methods compares.
fn table_1(seeds: Seeds) -> Vec<Row> {
    let published = [
        (Method::LeastSquares, 0.5632),
        (Method::Rls, 0.5632),
        (Method::Mils(2), 0.5623),
        (Method::Mils(4), 0.5618),
        (Method::Mils(6), 0.5613),
    ];
    published
        .into_iter()
        .map(|(method, published)| {
            let (mut variances, mut ours) = (Vec::new(), Vec::new());
            for seed in seeds.range() {
                let runs = scenario::measure(Condition::Clean, seed);
                let segments = methods::segments(&runs);
                let variance = |theta_kmh| methods::residual_variance(&segments, theta_kmh);
                variances.extend(method.estimate(&segments).map(variance));
                ours.extend(output_error(&runs).map(|estimate| {
                    let Davis { a, b, c } = estimate.davis;
                    variance([a, b / 3.6, c / (3.6 * 3.6)])
                }));
            }
            Row {
                paper: PAPER,
                table: "Table 1",
                quantity: format!("variance of the segments' residuals, {}", method.name()),
                unit: "(N/kN)^2",
                published: Some(published),
                paper_method: Some(mean(&variances)),
                baseline: None,
                ours: Some(mean(&ours)),
                bound: None,
                seeds: seeds.count,
                coverage: None,
                nees: None,
                nees_freedom: None,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_few_seeds_show_the_order_of_the_methods_and_nearness_to_the_bound() {
        let rows = rows(Seeds::from_zero(12));
        assert_eq!(rows.len(), 4 * (Method::ALL.len() + 1) + 5);
        for row in rows.iter().filter(|row| row.unit == "N/kN") {
            let (ours, bound) = (row.ours.unwrap(), row.bound.unwrap());
            // 12 seeds scatter by a quarter around their expectation.
            assert!(ours < 1.9 * bound, "{}: {ours} against {bound}", row.quantity);
            assert!(ours < 0.3 * row.baseline.unwrap(), "{}", row.quantity);
        }
    }
}
