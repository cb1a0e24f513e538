//! Extra resistance at certain places, in all runs or some, on the part of the train there.

use std::sync::Arc;

use dynocar_model::terms::extra::Covariate;
use dynocar_model::terms::{Entry, Parameter, place};
use dynocar_shared::vocabulary::EffectKind;

use super::{Candidate, Effect, Hypothesis, Proposal, SharedHypothesis};
use crate::explain::answer::{Location, RunWindow};
use crate::explain::evidence::{RunData, SampleForces};
use crate::explain::places::{End, Inside, Intervals, find};
use crate::explain::scan::Scan;

/// The kind.
pub struct LocalResistance;

#[derive(Clone, Debug)]
struct Local {
    sections: Intervals,
    length_m: f64,
    /// Files of the runs; `None` for all.
    runs: Option<Vec<String>>,
    choice_cost: f64,
    map_error: f64,
    /// The only fit run, whose passage could as well be an interval of time.
    only: Option<Arc<Passage>>,
}

/// When a run is where.
#[derive(Debug)]
struct Passage {
    file: String,
    /// Time in s, in the recording's own count, and chainage in m.
    samples: Vec<(f64, f64)>,
}

impl Passage {
    fn of(run: &RunData) -> Self {
        let times_s = run.recording.time_s().iter().map(|time_s| run.offset_s + time_s);
        let samples = times_s.zip(run.samples());
        let samples = samples.filter_map(|(time_s, at)| Some((time_s, at.position_m?))).collect();
        Passage { file: run.file.clone(), samples }
    }

    /// The sections of time in which the train's centre is inside intervals in m.
    fn windows(&self, intervals_m: &[[f64; 2]]) -> Vec<RunWindow> {
        let window = |&[from_m, to_m]: &[f64; 2]| {
            let mut inside = self.samples.iter().filter(|(_, at_m)| (from_m..=to_m).contains(at_m));
            let (t_start_s, _) = *inside.next()?;
            let (t_end_s, _) = *inside.next_back()?;
            Some(RunWindow { run: self.file.clone(), t_start_s, t_end_s })
        };
        intervals_m.iter().filter_map(window).collect()
    }
}

impl Effect for LocalResistance {
    fn kind(&self) -> EffectKind {
        EffectKind::LocalResistance
    }

    fn propose(&self, scan: &Scan) -> Proposal {
        if scan.problem.distance_ratio.is_none() {
            return Proposal::NotTestable("positions are not measured".into());
        }
        let shape = |run: &RunData, i: usize| -scan.per_unit_resistance_mps2(&run.samples()[i]);
        let inside = Inside::Share { length_m: scan.train.length_m };
        let Some(found) = find(scan, &shape, inside, true) else {
            return Proposal::Candidates(Vec::new());
        };
        let only = match &scan.problem.runs[..] {
            [run] => Some(Arc::new(Passage::of(run))),
            _ => None,
        };
        let candidate = |runs: Option<Vec<String>>| {
            let hypothesis = Local {
                sections: found.sections(),
                length_m: scan.train.length_m,
                runs,
                choice_cost: found.choice_cost,
                map_error: found.map_error,
                only: only.clone(),
            };
            Candidate::new(hypothesis, vec![found.estimate])
        };
        let mut candidates = vec![candidate(found.files(scan))];
        if found.runs.is_some() {
            candidates.push(candidate(None));
        }
        Proposal::Candidates(candidates)
    }
}

impl Local {
    /// Does something with the resistance at each of some samples of a run, from number `first` on.
    fn each<T>(
        &self,
        n_per_kn: f64,
        run: &RunData,
        first: usize,
        of_samples: &mut [T],
        act: impl Fn(&mut T, f64),
    ) {
        if self.runs.as_ref().is_some_and(|runs| !runs.contains(&run.file)) {
            return;
        }
        let Ok(profile) = place::profile(&self.sections.intervals_m, n_per_kn) else { return };
        for (own, position_m) in of_samples.iter_mut().zip(run.known(Covariate::Chainage, first)) {
            if let Some(position_m) = position_m {
                act(own, profile.mean_around(position_m, self.length_m));
            }
        }
    }
}

impl Hypothesis for Local {
    fn kind(&self) -> EffectKind {
        EffectKind::LocalResistance
    }

    fn parameters(&self) -> &[Parameter] {
        &place::PARAMETERS
    }

    fn choice_cost(&self) -> f64 {
        self.choice_cost
    }

    fn shared_error(&self) -> f64 {
        self.map_error
    }

    fn only_resists(&self) -> bool {
        true
    }

    fn unit_n_per_kn(&self, _others: &[f64], run: &RunData, n_per_kn: &mut Vec<f64>) {
        n_per_kn.clear();
        n_per_kn.resize(run.samples().len(), 0.0);
        self.each(1.0, run, 0, n_per_kn, |own, extra_n_per_kn| *own = extra_n_per_kn);
    }

    fn apply(&self, parameters: &[f64], run: &RunData, first: usize, forces: &mut [SampleForces]) {
        self.each(parameters[0], run, first, forces, |force, extra_n_per_kn| {
            place::act(extra_n_per_kn, &mut force.resistance);
        });
    }

    fn entries(&self, parameters: &[f64]) -> Option<Vec<Entry>> {
        let row = |&[from_m, to_m]: &[f64; 2]| vec![from_m, to_m, parameters[0]];
        let rows = self.sections.intervals_m.iter().map(row).collect();
        self.runs.is_none().then(|| vec![Entry::Rows(place::LIST, rows)])
    }

    fn ends(&self) -> Vec<End> {
        self.sections.ends()
    }

    fn with_end(&self, end: &End, at: f64) -> Option<SharedHypothesis> {
        Some(Arc::new(Local { sections: self.sections.moved(end, at)?, ..self.clone() }))
    }

    fn chosen_runs(&self) -> Option<&[String]> {
        self.runs.as_deref()
    }

    fn with_runs(&self, runs: Vec<String>) -> Option<SharedHypothesis> {
        Some(Arc::new(Local { runs: Some(runs), ..self.clone() }))
    }

    fn twins(&self) -> &[EffectKind] {
        if self.only.is_some() { &[EffectKind::DraggingBrake] } else { &[] }
    }

    fn is_event(&self) -> bool {
        self.runs.is_some()
    }

    fn place(&self) -> Location {
        let intervals_m = &self.sections.intervals_m;
        let windows = self.only.as_ref().map(|only| only.windows(intervals_m));
        Location { runs: self.runs.clone(), windows, ..Location::of_intervals(intervals_m.clone()) }
    }
}
