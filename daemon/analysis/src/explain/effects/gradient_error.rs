//! A declared gradient that is wrong by a function of the chainage. The error is the same in every passage and acts
//! with opposite signs in the two directions; directions with alignments of their own each have an error of their own.
//!
//! The function is linear between nodes. Its prior is a Gaussian process whose correlation falls exponentially along
//! the line, so that the nodes are a linear Gaussian block of the fit; the exponential makes their information
//! tridiagonal (Rasmussen and Williams 2006, appendix B: the Ornstein-Uhlenbeck process). The size of the error and the
//! length over which it changes are those of a map's errors or, where a level line is declared, of a line that nobody
//! surveyed; the evidence of the two decides.

use dynocar_model::terms::extra::Covariate;
use dynocar_model::terms::{ModelEntry, Parameter, gradient};
use dynocar_model::track::{self, LinearProfile};
use dynocar_shared::vocabulary::EffectKind;
use nalgebra::DMatrix;

use super::unknown::leaves_a_force;
use super::{
    Candidate, Handling, Hypothesis, Nature, On, Policy, Proposal, ReportContext, ReportedValues,
};
use crate::explain::answer::ParameterValue;
use crate::explain::evidence::{RunData, SampleForces};
use crate::explain::places::{ErrorScale, MAP, UNSURVEYED};
use crate::explain::places::{MAP_ERROR_PERMILLE, span_m};
use crate::explain::scan::Scan;
use crate::statistics::rms;

/// Number of nodes in the length over which the error changes.
const NODES_A_LENGTH: f64 = 3.0;
/// Least and greatest number of nodes.
const NODES_MIN: f64 = 4.0;
const NODES_MAX: f64 = 160.0;
/// Least number of runs in which an effect tied to the line shows.
const RUNS_MIN: usize = 2;

#[derive(Debug)]
struct Profile {
    nodes_m: Vec<f64>,
    /// Every node's, or those of growing and then those of falling chainage.
    parameters: Vec<Parameter>,
    information: DMatrix<f64>,
    is_one_way: bool,
    choice_cost: f64,
}

/// An error of the map, whose usual errors are in the model there. A wind along the line acts as the mean of such an
/// error does, whose other nodes would then explain the usual errors, too.
pub const POLICY: Policy =
    Policy { is_sought_with_nuisance: false, gives_way_to: &[EffectKind::Wind], ..Policy::USUAL };

/// Proposes structures for the data at hand.
pub fn propose(scan: &Scan) -> Proposal {
    let runs = &scan.problem.runs;
    let span_m = span_m(scan).filter(|_| scan.problem.positions.distance_ratio.is_some());
    let Some(span_m) = span_m.filter(|[low, high]| high > low) else {
        return Err("positions are not measured".into());
    };
    if runs.len() < RUNS_MIN {
        return Err("one passage does not show what stays".into());
    }
    let is_one_way = runs.iter().all(|run| run.direction == runs[0].direction);
    let mut profiles = vec![Profile::new(span_m, MAP, 1, is_one_way)];
    let is_level = scan.track.is_none_or(|track| track.is_level());
    if is_level && leaves_a_force(scan) {
        let towards = |direction| runs.iter().filter(|run| run.direction == direction).count();
        let may_part = towards(1.0).min(towards(-1.0)) >= RUNS_MIN;
        let directions = if may_part { 1..=2 } else { 1..=1 };
        for scale in UNSURVEYED {
            let of = |directions| Profile::new(span_m, scale, directions, false);
            profiles.extend(directions.clone().map(of).filter(|it| it.apart_m() <= scale.length_m));
        }
    }
    let choice_cost = 2.0 * (profiles.len() as f64).ln();
    let candidate = |mut profile: Profile| {
        profile.choice_cost = choice_cost;
        let start = vec![0.0; profile.parameters.len()];
        Candidate::new(profile, start)
    };
    Ok(profiles.into_iter().map(candidate).collect())
}

/// Returns the map's own small error, starting at zero: no effect, but an error that is in the finished model.
pub fn map_error(span_m: [f64; 2], scale: ErrorScale) -> Candidate {
    let profile = Profile::new(span_m, scale, 1, false);
    let start = vec![0.0; profile.parameters.len()];
    Candidate::new(profile, start)
}

/// Inverse covariance of an Ornstein-Uhlenbeck process at `count` equally distant nodes, for each
/// of one or two directions.
fn prior_information(
    count: usize,
    directions: usize,
    apart_m: f64,
    ErrorScale { permille, length_m }: ErrorScale,
) -> DMatrix<f64> {
    let rho = (-apart_m / length_m).exp();
    let scale = (permille.powi(2) * (1.0 - rho * rho)).recip();
    DMatrix::from_fn(directions * count, directions * count, |i, j| match i.abs_diff(j) {
        _ if i / count != j / count => 0.0,
        0 if i % count == 0 || (i + 1) % count == 0 => scale,
        0 => scale * (1.0 + rho * rho),
        1 => -scale * rho,
        _ => 0.0,
    })
}

impl Profile {
    fn new(
        [low_m, high_m]: [f64; 2],
        scale: ErrorScale,
        directions: usize,
        is_one_way: bool,
    ) -> Self {
        let nodes = (high_m - low_m) * NODES_A_LENGTH / scale.length_m + 1.0;
        let count = nodes.floor().clamp(NODES_MIN, NODES_MAX);
        let apart_m = (high_m - low_m) / (count - 1.0);
        let nodes_m: Vec<f64> = (0..count as usize).map(|k| low_m + apart_m * k as f64).collect();
        Profile {
            parameters: vec![gradient::ERROR_PARAMETER; directions * nodes_m.len()],
            information: prior_information(nodes_m.len(), directions, apart_m, scale),
            nodes_m,
            is_one_way,
            choice_cost: 0.0,
        }
    }

    fn apart_m(&self) -> f64 {
        self.nodes_m[1] - self.nodes_m[0]
    }

    fn at_nodes(&self, values: &[f64]) -> Vec<[f64; 2]> {
        self.nodes_m.iter().zip(values).map(|(&node_m, &value)| [node_m, value]).collect()
    }

    /// The lists of both directions, or of growing and of falling chainage, by their names.
    fn lists<'a>(
        &self,
        names: [&'static str; 2],
        values: &'a [f64],
    ) -> impl Iterator<Item = (&'static str, &'a [f64])> {
        names.into_iter().zip(values.chunks(self.nodes_m.len()))
    }

    fn error(&self, values: &[f64]) -> Option<track::GradientError> {
        let mut directions = values.chunks(self.nodes_m.len()).map(|values| {
            LinearProfile::new(self.nodes_m.iter().copied().zip(values.iter().copied()).collect())
        });
        let profile = directions.next()?.ok()?;
        let falling = directions.next().transpose().ok()?;
        Some(track::GradientError { profile, falling })
    }
}

impl Hypothesis for Profile {
    fn nature(&self) -> Nature<'_> {
        Nature {
            least: Some(gradient::ERROR_LEAST_PERMILLE),
            prior: Some(&self.information),
            choice_cost: self.choice_cost,
            shared_error: MAP_ERROR_PERMILLE,
            handling: Handling::Gradient,
            ..Nature::new(EffectKind::GradientError, &self.parameters)
        }
    }

    fn twins(&self, _parameters: &[f64]) -> &'static [EffectKind] {
        if self.is_one_way { &[EffectKind::LocalResistance] } else { &[] }
    }

    fn size(&self, parameters: &[f64]) -> f64 {
        rms(parameters)
    }

    fn touches(&self, parameter: usize, run: &RunData) -> bool {
        let (nodes, last) = (self.nodes_m.len(), self.nodes_m.len() - 1);
        if self.parameters.len() > nodes && (parameter < nodes) != (run.direction > 0.0) {
            return false;
        }
        let node = parameter % nodes;
        let from_m = if node == 0 { f64::MIN } else { self.nodes_m[node - 1] };
        let to_m = if node == last { f64::MAX } else { self.nodes_m[node + 1] };
        run.span_m.is_some_and(|[low, high]| low <= to_m && from_m <= high)
    }

    fn apply(&self, parameters: &[f64], On { run, first, .. }: On, forces: &mut [SampleForces]) {
        let Some(error) = self.error(parameters) else { return };
        let places = run.known(Covariate::Chainage, first).zip(&run.directions[first..]);
        for (force, (position_m, direction)) in forces.iter_mut().zip(places) {
            if let Some(position_m) = position_m {
                let at = (position_m, *direction);
                gradient::err(&error, at, &mut force.gradient_permille);
            }
        }
    }

    fn gradient_permille(&self, parameter: usize, run: &RunData, permille: &mut Vec<f64>) {
        let nodes = self.nodes_m.len();
        let (has_two_directions, is_growing) = (self.parameters.len() > nodes, parameter < nodes);
        let (at_m, last_m) = (self.nodes_m[parameter % nodes], self.nodes_m[nodes - 1]);
        let apart_m = self.apart_m();
        let share = |position_m: f64| {
            // The first and the last value hold beyond them.
            let inside_m = position_m.clamp(self.nodes_m[0], last_m);
            (1.0 - (inside_m - at_m).abs() / apart_m).max(0.0)
        };
        permille.clear();
        let places = run.known(Covariate::Chainage, 0).zip(&run.directions);
        permille.extend(places.map(|(position_m, direction)| match position_m {
            Some(_) if has_two_directions && is_growing != (*direction > 0.0) => 0.0,
            Some(position_m) => direction * share(position_m),
            None => 0.0,
        }));
    }

    fn entries(&self, parameters: &[f64]) -> Option<Vec<ModelEntry>> {
        let entry = |(name, values): (&'static str, &[f64])| {
            ModelEntry::List(name, self.at_nodes(values).iter().map(|row| row.to_vec()).collect())
        };
        let names = [gradient::ERROR, gradient::ERROR_FALLING];
        Some(self.lists(names, parameters).map(entry).collect())
    }

    fn report(&self, context: &ReportContext) -> ReportedValues {
        let (values, deviations) = (context.parameters, context.deviations);
        let mut reported = ReportedValues::default();
        let own = rms(values);
        let by_node = values.iter().zip(deviations).map(|(value, std)| (value * std).powi(2));
        let std = by_node.sum::<f64>().sqrt() / (own * values.len() as f64).max(1e-12);
        reported.push("rms_permille", own, std);
        let names = ["profile", "profile_falling"];
        let profile = |list: &[f64]| ParameterValue::Profile(self.at_nodes(list));
        for ((name, values), (_, deviations)) in
            self.lists(names, values).zip(self.lists(names, deviations))
        {
            reported.values.insert(name.into(), profile(values));
            reported.deviations.insert(name.into(), profile(deviations));
        }
        reported
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_prior_is_the_inverse_of_an_exponential_covariance_for_each_way() {
        let (count, apart_m, scale) = (6, 700.0, MAP);
        let covariance = DMatrix::from_fn(2 * count, 2 * count, |i, j| {
            let away_m = apart_m * i.abs_diff(j) as f64;
            let is_one_way = i / count == j / count;
            let correlation = (-away_m / scale.length_m).exp();
            if is_one_way { scale.permille.powi(2) * correlation } else { 0.0 }
        });
        let product = prior_information(count, 2, apart_m, scale) * covariance;
        assert!((product - DMatrix::identity(2 * count, 2 * count)).norm() < 1e-9);
    }
}
