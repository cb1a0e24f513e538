//! A brake force that the rail does not carry: achieved = min(reported, mu * weight), or a share
//! of the reported one, at certain places and in certain runs.

use std::sync::Arc;

use dynocar_model::force::ResolvedSample;
use dynocar_model::terms::{Parameter, adhesion};
use dynocar_shared::vocabulary::EffectKind;
use rayon::prelude::*;

use super::{Candidate, Effect, Hypothesis, Proposal, SharedHypothesis};
use crate::explain::answer::Location;
use crate::explain::evidence::{RunData, SampleForces};
use crate::explain::places::{End, Found, Inside, Intervals, best_of_runs, find};
use crate::explain::scan::{Scan, Tuple};

/// Caps that a search starts from, as share of the strongest braking seen.
const CAP_SHARES: [f64; 4] = [0.3, 0.5, 0.65, 0.8];
/// Braking for less than this in s says nothing.
const BRAKING_MIN_S: f64 = 20.0;

/// The kind.
pub struct LowAdhesion;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Form {
    Cap,
    Ratio,
}

#[derive(Clone, Debug)]
struct Slippery {
    form: Form,
    /// `None` for everywhere.
    sections: Option<Intervals>,
    /// Files of the runs; `None` for all.
    runs: Option<Vec<String>>,
    choice_cost: f64,
    map_error: f64,
}

fn weight_n(sample: &ResolvedSample) -> f64 {
    1000.0 * sample.weight_kn
}

/// Brake force over weight.
fn braking(sample: &ResolvedSample) -> f64 {
    sample.brake_force_n.unwrap_or(0.0) / weight_n(sample)
}

impl Effect for LowAdhesion {
    fn kind(&self) -> EffectKind {
        EffectKind::LowAdhesion
    }

    fn propose(&self, scan: &Scan) -> Proposal {
        let braking_s = scan.seconds_where(|_, sample| braking(sample) > 0.01);
        if braking_s < BRAKING_MIN_S {
            return Proposal::NotTestable("the runs hold hardly any braking".into());
        }
        let strongest = scan
            .problem
            .runs
            .iter()
            .flat_map(|run| run.bins.iter().map(|bin| braking(&run.samples()[bin.middle()])))
            .fold(0.0, f64::max);
        let mut candidates = Vec::new();
        let of_cap = |share: &f64| {
            let cap = share * strongest;
            let shape = |run: &RunData, i: usize| {
                let sample = &run.samples()[i];
                (braking(sample) - cap).max(0.0) * weight_n(sample) / sample.inertial_mass_kg
            };
            places(scan, &shape, Form::Cap, cap)
        };
        let of_caps: Vec<_> = CAP_SHARES.par_iter().map(of_cap).collect();
        candidates.extend(of_caps.into_iter().flatten());
        let shape = |run: &RunData, i: usize| {
            let sample = &run.samples()[i];
            sample.brake_force_n.unwrap_or(0.0) / sample.inertial_mass_kg
        };
        candidates.extend(places(scan, &shape, Form::Ratio, 0.0));
        candidates.sort_by(|one, other| other.0.total_cmp(&one.0));
        let best_cap = candidates.iter().position(|(_, form, _)| *form == Form::Cap);
        let best_ratio = candidates.iter().position(|(_, form, _)| *form == Form::Ratio);
        let mut chosen: Vec<usize> =
            [Some(0), best_cap, best_ratio].into_iter().flatten().collect();
        chosen.dedup();
        let picked = chosen.into_iter().filter_map(|k| candidates.get(k));
        Proposal::Candidates(picked.map(|(_, _, candidate)| candidate.clone()).collect())
    }
}

/// Structures for one shape: everywhere in all or some runs, and at places.
fn places(
    scan: &Scan,
    shape: &(dyn Fn(&RunData, usize) -> f64 + Sync),
    form: Form,
    cap: f64,
) -> Vec<(f64, Form, Candidate)> {
    let candidate = |found: &Found, sections: Option<Intervals>| {
        let runs = found.files(scan);
        let start = match form {
            Form::Cap => vec![cap.max(0.006)],
            Form::Ratio => vec![(1.0 - found.estimate).clamp(0.1, 0.99)],
        };
        let (choice_cost, map_error) = (found.choice_cost, found.map_error);
        let value = found.gain - choice_cost;
        let hypothesis = Slippery { form, sections, runs, choice_cost, map_error };
        (value, form, Candidate::new(hypothesis, start))
    };
    let mut candidates = Vec::new();
    let by_run: Vec<Tuple> =
        (0..scan.problem.runs.len()).map(|index| scan.run_tuple(index, shape)).collect();
    let everywhere = best_of_runs(scan, &by_run);
    if everywhere.gain > 0.0 {
        candidates.push(candidate(&everywhere, None));
    }
    if scan.problem.distance_ratio.is_some()
        && let Some(found) = find(scan, shape, Inside::Centre, true)
    {
        candidates.push(candidate(&found, Some(found.sections())));
        if found.runs.is_some() {
            let all = Found { runs: None, ..found };
            candidates.push(candidate(&all, Some(all.sections())));
        }
    }
    candidates
}

impl Slippery {
    /// At all places, in all runs.
    fn is_everywhere(&self) -> bool {
        self.sections.is_none() && self.runs.is_none()
    }
}

impl Hypothesis for Slippery {
    fn kind(&self) -> EffectKind {
        EffectKind::LowAdhesion
    }

    fn parameters(&self) -> &[Parameter] {
        match self.form {
            Form::Cap => &adhesion::CAP,
            Form::Ratio => &adhesion::RATIO,
        }
    }

    fn choice_cost(&self) -> f64 {
        self.choice_cost
    }

    fn shared_error(&self) -> f64 {
        match self.form {
            // A cap is no factor on a shape, and a map's error is small beside a brake force.
            Form::Cap => 0.0,
            Form::Ratio => self.map_error,
        }
    }

    fn is_material(&self, parameters: &[f64], _c: f64) -> bool {
        // Everywhere in every run it is what the declared brake force is good for.
        let usual = 1.0 - adhesion::DECLARED_BRAKE_STD;
        let least = if self.is_everywhere() { usual } else { adhesion::RATIO_LEAST };
        self.form == Form::Cap || parameters[0] < least
    }

    fn affine_in(&self) -> Option<fn(f64) -> f64> {
        (self.form == Form::Ratio).then_some(|ratio| ratio)
    }

    fn apply(&self, parameters: &[f64], run: &RunData, first: usize, forces: &mut [SampleForces]) {
        if self.runs.as_ref().is_some_and(|runs| !runs.contains(&run.file)) {
            return;
        }
        for (force, sample) in forces.iter_mut().zip(&run.samples()[first..]) {
            let is_there = self.sections.as_ref().is_none_or(|sections| {
                Inside::Centre.share(sample.position_m, &sections.intervals_m) > 0.0
            });
            if is_there {
                force.brake_n = match self.form {
                    Form::Cap => {
                        let weight_n = weight_n(sample) * force.mass_factor;
                        adhesion::carried_n(force.brake_n, parameters[0], weight_n)
                    }
                    Form::Ratio => force.brake_n * parameters[0],
                };
            }
        }
    }

    fn ends(&self) -> Vec<End> {
        self.sections.as_ref().map_or_else(Vec::new, Intervals::ends)
    }

    fn with_end(&self, end: &End, at: f64) -> Option<SharedHypothesis> {
        let sections = Some(self.sections.as_ref()?.moved(end, at)?);
        Some(Arc::new(Slippery { sections, ..self.clone() }))
    }

    fn chosen_runs(&self) -> Option<&[String]> {
        self.runs.as_deref()
    }

    fn with_runs(&self, runs: Vec<String>) -> Option<SharedHypothesis> {
        Some(Arc::new(Slippery { runs: Some(runs), ..self.clone() }))
    }

    /// Brakes weaker by one share everywhere, in every run and however gently they are applied, look like a mass
    /// once the traction's scale changes as much: two coincidences for one cause.
    fn may_stand_for_others(&self) -> bool {
        self.form == Form::Cap || !self.is_everywhere()
    }

    fn place(&self) -> Location {
        let intervals_m = self.sections.as_ref().map(|sections| sections.intervals_m.clone());
        Location { runs: self.runs.clone(), intervals_m, ..Location::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_little_weaker_everywhere_is_the_declared_brake_and_in_some_runs_is_not() {
        let of = |runs: Option<Vec<String>>| Slippery {
            form: Form::Ratio,
            sections: None,
            runs,
            choice_cost: 0.0,
            map_error: 0.0,
        };
        assert!(!of(None).is_material(&[0.96], 0.0));
        assert!(of(None).is_material(&[0.94], 0.0));
        assert!(of(Some(vec!["runs/01.csv".into()])).is_material(&[0.96], 0.0));
    }
}
