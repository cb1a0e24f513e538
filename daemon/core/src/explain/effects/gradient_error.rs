//! A declared gradient that is wrong by a smooth function of the chainage: the same in every
//! passage, with opposite forces in the two directions.
//!
//! The function is linear between nodes. Before the data it is a Gaussian process whose
//! correlation falls exponentially along the line, so that the nodes are a linear Gaussian block
//! of the fit; the exponential makes their information tridiagonal (Rasmussen and Williams 2006,
//! appendix B: the Ornstein-Uhlenbeck process).

use dynocar_shared::vocabulary::EffectKind;
use nalgebra::DMatrix;

use super::{Candidate, Effect, Entry, Hypothesis, Parameter, Proposal, ReportContext, Reported};
use crate::explain::answer::ParameterValue;
use crate::explain::evidence::{RunData, SampleForces};
use crate::explain::places::{MAP_ERROR_PERMILLE, span_m};
use crate::explain::scan::Scan;
use crate::terms::gradient;
use crate::track::LinearProfile;

/// Nodes are at least this far apart in m.
const NODES_APART_MIN_M: f64 = 500.0;
/// Nodes at least and at most.
const NODES: (f64, f64) = (4.0, 28.0);
/// What is tied to the line shows in so many runs.
const RUNS_MIN: usize = 2;

/// The kind.
pub struct GradientError;

#[derive(Debug)]
struct Profile {
    nodes_m: Vec<f64>,
    parameters: Vec<Parameter>,
    information: DMatrix<f64>,
    is_one_way: bool,
}

impl Effect for GradientError {
    fn kind(&self) -> EffectKind {
        EffectKind::GradientError
    }

    fn propose(&self, scan: &Scan) -> Proposal {
        let runs = &scan.problem.runs;
        let span_m = span_m(scan).filter(|_| scan.problem.way_ratio.is_some());
        let Some([low_m, high_m]) = span_m.filter(|[low, high]| high > low) else {
            return Proposal::NotTestable("positions are not measured".into());
        };
        if runs.len() < RUNS_MIN {
            return Proposal::NotTestable("one passage does not tell what stays".into());
        }
        let is_one_way = runs.iter().all(|run| run.direction == runs[0].direction);
        let count = ((high_m - low_m) / NODES_APART_MIN_M + 1.0).floor().clamp(NODES.0, NODES.1);
        let apart_m = (high_m - low_m) / (count - 1.0);
        let nodes_m: Vec<f64> = (0..count as usize).map(|k| low_m + apart_m * k as f64).collect();
        let profile = Profile {
            parameters: vec![gradient::ERROR_PARAMETER; nodes_m.len()],
            information: prior_information(nodes_m.len(), apart_m),
            nodes_m,
            is_one_way,
        };
        let start = vec![0.0; profile.nodes_m.len()];
        Proposal::Candidates(vec![Candidate::new(profile, start)])
    }
}

/// Inverse covariance of an Ornstein-Uhlenbeck process at equally distant nodes.
fn prior_information(count: usize, apart_m: f64) -> DMatrix<f64> {
    let rho = (-apart_m / gradient::ERROR_LENGTH_M).exp();
    let scale = (gradient::ERROR_PRIOR_PERMILLE.powi(2) * (1.0 - rho * rho)).recip();
    DMatrix::from_fn(count, count, |i, j| match i.abs_diff(j) {
        0 if i == 0 || i + 1 == count => scale,
        0 => scale * (1.0 + rho * rho),
        1 => -scale * rho,
        _ => 0.0,
    })
}

fn rms(values: &[f64]) -> f64 {
    let squares: f64 = values.iter().map(|value| value * value).sum();
    (squares / values.len() as f64).sqrt()
}

impl Profile {
    fn at_nodes(&self, values: &[f64]) -> Vec<[f64; 2]> {
        self.nodes_m.iter().zip(values).map(|(&node_m, &value)| [node_m, value]).collect()
    }
}

impl Hypothesis for Profile {
    fn kind(&self) -> EffectKind {
        EffectKind::GradientError
    }

    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    fn size(&self, parameters: &[f64]) -> f64 {
        rms(parameters)
    }

    fn prior_information(&self) -> Option<&DMatrix<f64>> {
        Some(&self.information)
    }

    fn twins(&self) -> &[EffectKind] {
        if self.is_one_way { &[EffectKind::LocalResistance] } else { &[] }
    }

    fn shared_error(&self) -> f64 {
        MAP_ERROR_PERMILLE
    }

    fn is_material(&self, parameters: &[f64], _c: f64) -> bool {
        rms(parameters) > gradient::ERROR_LEAST_PERMILLE
    }

    fn touches(&self, parameter: usize, run: &RunData) -> bool {
        let last = self.nodes_m.len() - 1;
        let from_m = if parameter == 0 { f64::MIN } else { self.nodes_m[parameter - 1] };
        let to_m = if parameter == last { f64::MAX } else { self.nodes_m[parameter + 1] };
        let passes = |at_m: f64| (from_m..=to_m).contains(&at_m);
        run.samples().iter().any(|sample| sample.position_m.is_some_and(passes))
    }

    fn apply(&self, parameters: &[f64], run: &RunData, forces: &mut [SampleForces]) {
        let entries = self.nodes_m.iter().copied().zip(parameters.iter().copied()).collect();
        let Ok(error) = LinearProfile::new(entries) else { return };
        for (force, sample) in forces.iter_mut().zip(run.samples()) {
            if let Some(position_m) = sample.position_m {
                let at = (position_m, sample.direction);
                gradient::err(&error, at, &mut force.gradient_permille);
            }
        }
    }

    fn entries(&self, parameters: &[f64]) -> Option<Vec<Entry>> {
        let rows = self.at_nodes(parameters).iter().map(|row| row.to_vec()).collect();
        Some(vec![Entry::List(gradient::ERROR, rows)])
    }

    fn report(&self, context: &ReportContext) -> Reported {
        let (values, deviations) = (context.parameters, context.deviations);
        let mut reported = Reported::default();
        let own = rms(values);
        let by_node = values.iter().zip(deviations).map(|(value, std)| (value * std).powi(2));
        let std = by_node.sum::<f64>().sqrt() / (own * values.len() as f64).max(1e-12);
        reported.push("rms_permille", own, std);
        let profile = |list: &[f64]| ParameterValue::Profile(self.at_nodes(list));
        reported.values.insert("profile".into(), profile(values));
        reported.deviations.insert("profile".into(), profile(deviations));
        reported
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_prior_is_the_inverse_of_an_exponential_covariance() {
        let (count, apart_m) = (6, 700.0);
        let covariance = DMatrix::from_fn(count, count, |i, j| {
            let away_m = apart_m * i.abs_diff(j) as f64;
            gradient::ERROR_PRIOR_PERMILLE.powi(2) * (-away_m / gradient::ERROR_LENGTH_M).exp()
        });
        let product = prior_information(count, apart_m) * covariance;
        assert!((product - DMatrix::identity(count, count)).norm() < 1e-9);
    }
}
