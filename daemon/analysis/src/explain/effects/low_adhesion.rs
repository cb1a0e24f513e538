//! A brake force that the rail does not transmit: achieved = min(reported, mu * weight), or a share of the reported
//! one, at certain places and in certain runs.

use std::sync::Arc;

use dynocar_model::force::ResolvedSample;
use dynocar_model::terms::adhesion;
use dynocar_shared::vocabulary::EffectKind;

use super::{Candidate, Certainty, Hypothesis, Nature, On, Policy, Proposal, SharedHypothesis};
use crate::explain::evidence::{RunData, SampleForces};
use crate::explain::places::{FoundIntervals, Inside, Site, best_of_runs, find};
use crate::explain::scan::{Scan, Tuple};
use crate::parallel;
use crate::statistics::greatest_first;

/// Caps from which a search starts, as shares of the strongest braking in the runs.
const CAP_SHARES: [f64; 4] = [0.3, 0.5, 0.65, 0.8];
/// Least time in s of braking that shows adhesion.
const BRAKING_MIN_S: f64 = 20.0;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Form {
    Cap,
    Ratio,
}

#[derive(Clone, Debug)]
struct Slippery {
    form: Form,
    site: Site,
}

fn weight_n(sample: &ResolvedSample) -> f64 {
    1000.0 * sample.weight_kn
}

/// Brake force over weight.
fn braking(sample: &ResolvedSample) -> f64 {
    sample.brake_force_n.unwrap_or(0.0) / weight_n(sample)
}

/// Rails differ from run to run, so it is never certain.
pub const POLICY: Policy = Policy {
    certainty: Certainty::Never,
    is_sought_with_nuisance: false,
    is_passing: true,
    ..Policy::USUAL
};

/// Proposes structures for the data at hand.
pub fn propose(scan: &Scan) -> Proposal {
    let braking_s = scan.seconds_where(|_, sample| braking(sample) > 0.01);
    if braking_s < BRAKING_MIN_S {
        return Err("the runs hold hardly any braking".into());
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
    candidates.extend(parallel::of_each(&CAP_SHARES, of_cap).into_iter().flatten());
    let shape = |run: &RunData, i: usize| {
        let sample = &run.samples()[i];
        sample.brake_force_n.unwrap_or(0.0) / sample.inertial_mass_kg
    };
    candidates.extend(places(scan, &shape, Form::Ratio, 0.0));
    greatest_first(&mut candidates, |it| it.0);
    let best_cap = candidates.iter().position(|(_, form, _)| *form == Form::Cap);
    let best_ratio = candidates.iter().position(|(_, form, _)| *form == Form::Ratio);
    let mut chosen: Vec<usize> = [Some(0), best_cap, best_ratio].into_iter().flatten().collect();
    chosen.dedup();
    let picked = chosen.into_iter().filter_map(|k| candidates.get(k));
    Ok(picked.map(|(_, _, candidate)| candidate.clone()).collect())
}

/// Structures for one shape: everywhere in all or some runs, and at places.
fn places(
    scan: &Scan,
    shape: &(dyn Fn(&RunData, usize) -> f64 + Sync),
    form: Form,
    cap: f64,
) -> Vec<(f64, Form, Candidate)> {
    let candidate = |found: &FoundIntervals| {
        let start = match form {
            Form::Cap => vec![cap.max(0.006)],
            Form::Ratio => vec![(1.0 - found.estimate).clamp(0.1, 0.99)],
        };
        let hypothesis = Slippery { form, site: found.site(scan) };
        (found.gain - found.choice_cost, form, Candidate::new(hypothesis, start))
    };
    let mut candidates = Vec::new();
    let by_run: Vec<Tuple> =
        (0..scan.problem.runs.len()).map(|index| scan.run_tuple(index, shape)).collect();
    let everywhere = best_of_runs(scan, &by_run);
    // A share everywhere in every run is the brake's.
    if everywhere.gain > 0.0 && (form == Form::Cap || everywhere.runs.is_some()) {
        candidates.push(candidate(&everywhere));
    }
    if scan.problem.positions.distance_ratio.is_some()
        && let Some(found) = find(scan, shape, Inside::Centre)
    {
        candidates.push(candidate(&found));
        if found.runs.is_some() {
            candidates.push(candidate(&FoundIntervals { runs: None, ..found }));
        }
    }
    candidates
}

impl Hypothesis for Slippery {
    fn nature(&self) -> Nature<'_> {
        let is_ratio = self.form == Form::Ratio;
        let parameters = if is_ratio { &adhesion::RATIO } else { &adhesion::CAP };
        Nature {
            choice_cost: self.site.choice_cost,
            // A cap is no factor on a shape, and a map's error is small compared with a brake force.
            shared_error: if is_ratio { self.site.map_error } else { 0.0 },
            affine_in: is_ratio.then_some(|ratio| ratio),
            ..Nature::new(EffectKind::LowAdhesion, parameters)
        }
    }

    fn is_material(&self, parameters: &[f64], _c: f64) -> bool {
        self.form == Form::Cap || parameters[0] < adhesion::RATIO_LEAST
    }

    fn apply(&self, parameters: &[f64], On { run, first, .. }: On, forces: &mut [SampleForces]) {
        if !self.site.is_in(run) {
            return;
        }
        for (force, sample) in forces.iter_mut().zip(&run.samples()[first..]) {
            let is_there = self.site.sections.as_ref().is_none_or(|sections| {
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

    fn site(&self) -> Option<&Site> {
        Some(&self.site)
    }

    fn at_site(&self, site: Site) -> Option<SharedHypothesis> {
        Some(Arc::new(Slippery { site, ..self.clone() }))
    }
}
