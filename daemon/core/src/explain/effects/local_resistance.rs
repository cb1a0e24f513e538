//! Extra resistance at certain places, in all runs or some, on the part of the train there.

use dynocar_shared::vocabulary::EffectKind;

use super::{Candidate, Effect, Hypothesis, Parameter, Proposal};
use crate::explain::answer::Place;
use crate::explain::evidence::{RunData, SampleForces};
use crate::explain::localise::{Inside, find};
use crate::explain::scan::Scan;

const PARAMETERS: [Parameter; 1] = [Parameter::new("extra_n_per_kn", (0.0, 100.0), 0.02)];

/// The kind.
pub struct LocalResistance;

#[derive(Debug)]
struct Local {
    intervals_m: Vec<[f64; 2]>,
    inside: Inside,
    /// Files of the runs; `None` for all.
    runs: Option<Vec<String>>,
    choice_cost: f64,
    map_error: f64,
}

impl Effect for LocalResistance {
    fn kind(&self) -> EffectKind {
        EffectKind::LocalResistance
    }

    fn propose(&self, scan: &Scan) -> Proposal {
        if scan.problem.way_ratio.is_none() {
            return Proposal::NotTestable("positions are not measured".into());
        }
        let shape = |run: &RunData, i: usize| -scan.per_unit_resistance_mps2(&run.samples()[i]);
        let inside = Inside::Share { length_m: scan.train.length_m };
        let Some(found) = find(scan, &shape, inside, true) else {
            return Proposal::Candidates(Vec::new());
        };
        let candidate = |runs: Option<&Vec<usize>>| {
            let files = |runs: &Vec<usize>| -> Vec<String> {
                runs.iter().map(|&index| scan.problem.runs[index].file.clone()).collect()
            };
            let hypothesis = Local {
                intervals_m: found.intervals_m.clone(),
                inside,
                runs: runs.map(files),
                choice_cost: found.choice_cost,
                map_error: found.map_error,
            };
            Candidate::new(hypothesis, vec![found.estimate])
        };
        let mut candidates = vec![candidate(found.runs.as_ref())];
        if found.runs.is_some() {
            candidates.push(candidate(None));
        }
        Proposal::Candidates(candidates)
    }
}

impl Hypothesis for Local {
    fn kind(&self) -> EffectKind {
        EffectKind::LocalResistance
    }

    fn parameters(&self) -> &[Parameter] {
        &PARAMETERS
    }

    fn choice_cost(&self) -> f64 {
        self.choice_cost
    }

    fn shared_error(&self) -> f64 {
        self.map_error
    }

    fn apply(&self, parameters: &[f64], run: &RunData, forces: &mut [SampleForces]) {
        if self.runs.as_ref().is_some_and(|runs| !runs.contains(&run.file)) {
            return;
        }
        for (force, sample) in forces.iter_mut().zip(run.samples()) {
            force.extra_n_per_kn +=
                parameters[0] * self.inside.share(sample.position_m, &self.intervals_m);
        }
    }

    fn place(&self) -> Place {
        Place { runs: self.runs.clone(), ..Place::of_intervals(self.intervals_m.clone()) }
    }
}
