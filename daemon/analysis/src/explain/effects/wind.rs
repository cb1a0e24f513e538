//! Wind along the line. One wind for all runs, or one for each run.

use std::collections::BTreeMap;

use dynocar_core::force::ResolvedSample;
use dynocar_core::terms::{Entry, Parameter, wind};
use dynocar_shared::vocabulary::EffectKind;

use super::{Candidate, Effect, Hypothesis, Proposal, ReportContext, Reported};
use crate::explain::answer::ParameterValue;
use crate::explain::evidence::{RunData, SampleForces};
use crate::explain::scan::Scan;

/// A headwind that both directions share is at most so many times what they do not share.
const AHEAD_MAX: f64 = 3.0;

/// The kind.
pub struct Wind;

#[derive(Debug)]
struct Steady {
    parameters: [Parameter; 1],
}

#[derive(Debug)]
struct ByRun {
    /// Run files with their directions; the parameters are wind towards direction -1.
    runs: Vec<(String, f64)>,
    parameters: Vec<Parameter>,
}

impl Effect for Wind {
    fn kind(&self) -> EffectKind {
        EffectKind::Wind
    }

    fn propose(&self, scan: &Scan) -> Proposal {
        let runs = &scan.problem.runs;
        if runs.iter().all(|run| run.direction == runs[0].direction) {
            return Proposal::NotTestable(
                "all runs go in one direction, where wind looks like b and c".into(),
            );
        }
        let by_run = ByRun {
            runs: runs.iter().map(|run| (run.file.clone(), run.direction)).collect(),
            parameters: vec![wind::PARAMETER; runs.len()],
        };
        let mut candidates =
            vec![Candidate::new(Steady { parameters: [wind::PARAMETER] }, vec![0.0])];
        if runs.len() >= 3 {
            candidates.push(Candidate::new(by_run, vec![0.0; runs.len()]));
        }
        Proposal::Candidates(candidates)
    }

    fn whole(&self, scan: &Scan) -> Option<Candidate> {
        self.propose(scan).first()
    }
}

fn blow(wind_plus_mps: f64, samples: &[ResolvedSample], forces: &mut [SampleForces]) {
    for (force, sample) in forces.iter_mut().zip(samples) {
        wind::act(wind_plus_mps, sample.direction, &mut force.resistance);
    }
}

impl Hypothesis for Steady {
    fn kind(&self) -> EffectKind {
        EffectKind::Wind
    }

    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    fn is_material(&self, parameters: &[f64], _c: f64) -> bool {
        parameters[0].abs() > wind::LEAST_MPS
    }

    fn apply(&self, parameters: &[f64], run: &RunData, first: usize, forces: &mut [SampleForces]) {
        blow(parameters[0], &run.samples()[first..], forces);
    }

    fn entries(&self, parameters: &[f64]) -> Option<Vec<Entry>> {
        Some(vec![Entry::Number(&wind::WIND_PLUS, parameters[0])])
    }
}

impl Hypothesis for ByRun {
    fn kind(&self) -> EffectKind {
        EffectKind::Wind
    }

    fn parameters(&self) -> &[Parameter] {
        &self.parameters
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
        let may_be = along.abs().max(scatter).max(wind::LEAST_MPS);
        (ahead.abs() > AHEAD_MAX * may_be).then_some(
            "it would blow against every run alike, whichever way that goes: something of the train",
        )
    }

    fn touches(&self, parameter: usize, run: &RunData) -> bool {
        self.runs[parameter].0 == run.file
    }

    fn apply(&self, parameters: &[f64], run: &RunData, first: usize, forces: &mut [SampleForces]) {
        let own = self.runs.iter().position(|(file, _)| *file == run.file);
        let mean = parameters.iter().sum::<f64>() / parameters.len() as f64;
        blow(own.map_or(mean, |index| parameters[index]), &run.samples()[first..], forces);
    }

    fn report(&self, context: &ReportContext) -> Reported {
        let count = context.parameters.len() as f64;
        let mean = context.parameters.iter().sum::<f64>() / count;
        let scatter: f64 = context.parameters.iter().map(|wind| (wind - mean).powi(2)).sum();
        let mut reported = Reported::default();
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
