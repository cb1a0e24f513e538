//! Extra resistance at certain places, in all runs or some, on the part of the train that is there.

use std::sync::Arc;

use dynocar_model::terms::extra::Covariate;
use dynocar_model::terms::{ModelEntry, place};
use dynocar_shared::vocabulary::EffectKind;

use super::{Candidate, Handling, Hypothesis, Nature, On, Policy, Proposal, SharedHypothesis};
use crate::explain::answer::{Location, RunWindow};
use crate::explain::evidence::{RunData, SampleForces};
use crate::explain::places::{Inside, Site, find};
use crate::explain::scan::Scan;

#[derive(Clone, Debug)]
struct Local {
    site: Site,
    length_m: f64,
    /// The only fit run, whose passage could as well be an interval of time.
    only: Option<Arc<Passage>>,
}

/// Time and chainage of a run's samples.
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

/// Pieces of the map's error look like such a place, and the remainder of a wrong wheel or gradient does.
pub const POLICY: Policy = Policy {
    is_one_of_many: true,
    is_left_by_moved_places: true,
    is_sought_with_nuisance: false,
    ..Policy::USUAL
};

/// Proposes structures for the data at hand.
pub fn propose(scan: &Scan) -> Proposal {
    if scan.problem.positions.distance_ratio.is_none() {
        return Err("positions are not measured".into());
    }
    let shape = |run: &RunData, i: usize| -scan.per_unit_resistance_mps2(&run.samples()[i]);
    let inside = Inside::Share { length_m: scan.train.length_m };
    let Some(found) = find(scan, &shape, inside) else {
        return Ok(Vec::new());
    };
    let only = match &scan.problem.runs[..] {
        [run] => Some(Arc::new(Passage::of(run))),
        _ => None,
    };
    let candidate = |site: Site| {
        let hypothesis = Local { site, length_m: scan.train.length_m, only: only.clone() };
        Candidate::new(hypothesis, vec![found.estimate])
    };
    let site = found.site(scan);
    let everywhere = site.runs.is_some().then(|| Site { runs: None, ..site.clone() });
    Ok([site].into_iter().chain(everywhere).map(candidate).collect())
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
        if !self.site.is_in(run) {
            return;
        }
        let Ok(profile) = place::profile(self.site.intervals_m(), n_per_kn) else { return };
        for (own, position_m) in of_samples.iter_mut().zip(run.known(Covariate::Chainage, first)) {
            if let Some(position_m) = position_m {
                act(own, profile.mean_around(position_m, self.length_m));
            }
        }
    }
}

impl Hypothesis for Local {
    fn nature(&self) -> Nature<'_> {
        Nature {
            choice_cost: self.site.choice_cost,
            shared_error: self.site.map_error,
            handling: Handling::Added,
            ..Nature::new(EffectKind::LocalResistance, &place::PARAMETERS)
        }
    }

    fn twins(&self, _parameters: &[f64]) -> &'static [EffectKind] {
        if self.only.is_some() { &[EffectKind::DraggingBrake] } else { &[] }
    }

    fn unit_n_per_kn(&self, _others: &[f64], run: &RunData, n_per_kn: &mut Vec<f64>) {
        n_per_kn.clear();
        n_per_kn.resize(run.samples().len(), 0.0);
        self.each(1.0, run, 0, n_per_kn, |own, extra_n_per_kn| *own = extra_n_per_kn);
    }

    fn apply(&self, parameters: &[f64], On { run, first, .. }: On, forces: &mut [SampleForces]) {
        self.each(parameters[0], run, first, forces, |force, extra_n_per_kn| {
            place::act(extra_n_per_kn, &mut force.resistance);
        });
    }

    fn entries(&self, parameters: &[f64]) -> Option<Vec<ModelEntry>> {
        let row = |&[from_m, to_m]: &[f64; 2]| vec![from_m, to_m, parameters[0]];
        let rows = self.site.intervals_m().iter().map(row).collect();
        self.site.runs.is_none().then(|| vec![ModelEntry::Rows(place::LIST, rows)])
    }

    fn site(&self) -> Option<&Site> {
        Some(&self.site)
    }

    fn at_site(&self, site: Site) -> Option<SharedHypothesis> {
        Some(Arc::new(Local { site, ..self.clone() }))
    }

    fn is_event(&self) -> bool {
        self.site.runs.is_some()
    }

    fn place(&self) -> Location {
        let windows = self.only.as_ref().map(|only| only.windows(self.site.intervals_m()));
        Location { windows, ..self.site.place() }
    }
}
