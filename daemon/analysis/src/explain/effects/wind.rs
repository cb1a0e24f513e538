//! Wind along the line: one wind for all runs, or one for each run.

use std::collections::BTreeMap;

use dynocar_model::terms::{Parameter, wind};
use dynocar_shared::vocabulary::EffectKind;

use super::{
    Candidate, Certainty, Everyday, Hypothesis, Nature, On, Policy, Proposal, ReportContext,
    ReportedValues,
};
use crate::explain::answer::ParameterValue;
use crate::explain::evidence::{CERTAIN_STDS, RunData, SampleForces};
use crate::explain::scan::Scan;

/// Greatest headwind that both directions share, as a multiple of the part that they do not share; it may also come
/// from the scatter of the winds.
const AHEAD_MAX: f64 = 3.0;

#[derive(Debug)]
struct Steady;

#[derive(Debug)]
struct ByRun {
    /// Run files with their directions; the parameters are wind towards direction -1.
    runs: Vec<(String, f64)>,
    parameters: Vec<Parameter>,
}

/// Winds differ from run to run, so a wind is never certain; on ordinary days it is part of the model without a name.
pub const POLICY: Policy = Policy {
    certainty: Certainty::Never,
    is_sought_with_nuisance: false,
    everyday: Some(Everyday { rank: 5, most: wind::EVERYDAY_MPS }),
    ..Policy::USUAL
};

/// Proposes structures for the data at hand.
pub fn propose(scan: &Scan) -> Proposal {
    let runs = &scan.problem.runs;
    if runs.iter().all(|run| run.direction == runs[0].direction) {
        return Err("all runs go in one direction, where wind looks like b and c".into());
    }
    let by_run = ByRun {
        runs: runs.iter().map(|run| (run.file.clone(), run.direction)).collect(),
        parameters: vec![wind::PARAMETER; runs.len()],
    };
    let mut candidates = vec![Candidate::new(Steady, vec![0.0])];
    if runs.len() >= 3 {
        candidates.push(Candidate::new(by_run, vec![0.0; runs.len()]));
    }
    Ok(candidates)
}

/// The wind to expect in a run that was not fitted: the mean of the others, as far as their scatter
/// shows one (James and Stein 1961).
fn of_another_run(winds_mps: &[f64]) -> f64 {
    let count = winds_mps.len() as f64;
    let mean = winds_mps.iter().sum::<f64>() / count;
    let scatter = winds_mps.iter().map(|wind| (wind - mean).powi(2)).sum::<f64>();
    let variance_of_mean = scatter / (count * (count - 1.0));
    mean * (1.0 - variance_of_mean / (mean * mean).max(f64::MIN_POSITIVE)).max(0.0)
}

fn blow(wind_plus_mps: f64, directions: &[f64], forces: &mut [SampleForces]) {
    for (force, direction) in forces.iter_mut().zip(directions) {
        wind::act(wind_plus_mps, *direction, &mut force.resistance);
    }
}

impl Hypothesis for Steady {
    fn nature(&self) -> Nature<'_> {
        Nature {
            keys: &[&wind::WIND_PLUS],
            least: Some(wind::LEAST_MPS),
            ..Nature::new(EffectKind::Wind, &[wind::PARAMETER])
        }
    }

    fn apply(&self, parameters: &[f64], On { run, first, .. }: On, forces: &mut [SampleForces]) {
        blow(parameters[0], &run.directions[first..], forces);
    }
}

impl ByRun {
    /// Returns the index of a run's own wind; `None` for a run that was not fitted, which has the mean of the winds.
    fn own(&self, run: &RunData) -> Option<usize> {
        self.runs.iter().position(|(file, _)| *file == run.file)
    }
}

impl Hypothesis for ByRun {
    fn nature(&self) -> Nature<'_> {
        Nature::new(EffectKind::Wind, &self.parameters)
    }

    fn is_material(&self, parameters: &[f64], _c: f64) -> bool {
        parameters.iter().any(|mps| mps.abs() > wind::LEAST_MPS)
    }

    fn contradiction(&self, parameters: &[f64]) -> Option<&'static str> {
        let winds =
            || self.runs.iter().zip(parameters).map(|((_, direction), wind)| (*direction, *wind));
        let mean = |direction: f64| {
            let own: Vec<f64> = winds().filter(|it| it.0 == direction).map(|it| it.1).collect();
            (own.iter().sum::<f64>() / own.len() as f64, own.len() as f64)
        };
        let ((plus, plus_runs), (minus, minus_runs)) = (mean(1.0), mean(-1.0));
        let (along, ahead) = (0.5 * (plus + minus), 0.5 * (plus - minus));
        let away =
            |(direction, wind): (f64, f64)| wind - if direction > 0.0 { plus } else { minus };
        let freedom = (plus_runs + minus_runs - 2.0).max(1.0);
        let scatter = (winds().map(|it| away(it).powi(2)).sum::<f64>() / freedom).sqrt();
        let by_chance = CERTAIN_STDS * scatter / (plus_runs + minus_runs).sqrt();
        let may_be = (AHEAD_MAX * along.abs().max(wind::LEAST_MPS)).max(by_chance);
        (ahead.abs() > may_be).then_some(
            "it would blow against every run alike, whichever way that goes: something of the train",
        )
    }

    fn touches(&self, parameter: usize, run: &RunData) -> bool {
        let own = self.own(run);
        own.is_none_or(|own| own == parameter)
    }

    fn apply(&self, parameters: &[f64], On { run, first, .. }: On, forces: &mut [SampleForces]) {
        let wind_plus_mps =
            self.own(run).map_or_else(|| of_another_run(parameters), |own| parameters[own]);
        blow(wind_plus_mps, &run.directions[first..], forces);
    }

    fn report(&self, context: &ReportContext) -> ReportedValues {
        let count = context.parameters.len() as f64;
        let mean = context.parameters.iter().sum::<f64>() / count;
        let scatter: f64 = context.parameters.iter().map(|wind| (wind - mean).powi(2)).sum();
        let mut reported = ReportedValues::default();
        let std = context.few_runs_factor * (scatter / (count * (count - 1.0))).sqrt();
        reported.push("wind_plus_mps", mean, std);
        let by_run = |values: &[f64], signed: bool| -> BTreeMap<String, f64> {
            let signed = |direction: f64| if signed { direction } else { 1.0 };
            let runs = self.runs.iter().zip(values);
            runs.map(|((file, direction), value)| (file.clone(), signed(*direction) * value))
                .collect()
        };
        let values = ParameterValue::ByRun(by_run(context.parameters, true));
        let deviations = ParameterValue::ByRun(by_run(context.deviations, false));
        reported.values.insert("headwind_mps".into(), values);
        reported.deviations.insert("headwind_mps".into(), deviations);
        reported
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn by_run(winds: &[(f64, f64)]) -> (ByRun, Vec<f64>) {
        let runs = winds.iter().map(|(direction, _)| (String::new(), *direction)).collect();
        let parameters = vec![wind::PARAMETER; winds.len()];
        (
            ByRun { runs, parameters },
            winds.iter().map(|(direction, ahead)| direction * ahead).collect(),
        )
    }

    #[test]
    fn a_headwind_whichever_way_a_train_goes_is_no_wind() {
        // Headwinds in m/s of six runs, three in each direction.
        let towards = [1.0, -1.0, 1.0, -1.0, 1.0, -1.0];
        let winds = |ahead: [f64; 6]| {
            let (wind, parameters) =
                by_run(&std::array::from_fn::<_, 6, _>(|k| (towards[k], ahead[k])));
            wind.contradiction(&parameters).is_none()
        };
        assert!(!winds([-11.6, -11.6, -13.1, -10.3, -11.0, -9.7]));
        assert!(!winds([4.3, 8.5, 4.9, 3.4, 3.4, 5.6]), "more than scatter makes");
        assert!(winds([5.0, -5.2, 4.7, -5.1, 5.4, -4.9]), "one wind, ahead and behind");
        assert!(winds([3.0, -1.0, 4.0, -2.0, 0.5, 2.5]), "another each day");
    }

    #[test]
    fn a_run_that_was_not_fitted_has_the_wind_that_the_others_share() {
        assert!((of_another_run(&[5.0, 5.2, 4.8]) - 5.0).abs() < 0.01);
        assert_eq!(of_another_run(&[2.0, -2.1, 1.9, -1.8]), 0.0);
        assert_eq!(of_another_run(&[0.0, 0.0, 0.0]), 0.0);
    }
}
