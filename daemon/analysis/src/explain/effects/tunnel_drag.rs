//! Air resistance in tunnels: c v² is larger for the part of the train inside.
//!
//! A map without a tunnel does not prove that there is no tunnel: besides the mapped tunnels, the search looks for
//! places where c v² is larger. Trains that pass a place at different speeds distinguish a tunnel from a constant
//! resistance there.

use std::sync::Arc;

use dynocar_model::terms::extra::Covariate;
use dynocar_model::terms::{ModelEntry, place, tunnel};
use dynocar_model::track::Track;
use dynocar_shared::vocabulary::EffectKind;

use super::{
    Candidate, Hypothesis, Nature, On, Policy, Proposal, ReportContext, ReportedValues,
    SharedHypothesis,
};
use crate::explain::answer::Location;
use crate::explain::evidence::{RunData, SampleForces};
use crate::explain::places::{Inside, Site, find};
use crate::explain::scan::Scan;

/// Least time in s of motion inside mapped tunnels.
const MAPPED_MIN_S: f64 = 10.0;
/// Additional price of an unmapped tunnel, which is less likely than some other resistance at a place.
const UNMAPPED_COST: f64 = 4.0;

#[derive(Clone, Debug)]
struct Tunnels {
    /// Where they were found; without sections the mapped ones.
    site: Site,
    length_m: f64,
    mapped_m: Vec<[f64; 2]>,
}

/// Mapped tunnels are one number of the line; the place of an unmapped one was chosen, and the remainder of a wrong
/// wheel or gradient looks like it.
pub const POLICY: Policy = Policy { is_left_by_moved_places: true, ..Policy::USUAL };

/// Proposes structures for the data at hand.
pub fn propose(scan: &Scan) -> Proposal {
    let length_m = scan.train.length_m;
    let Some(track) = scan.track else {
        return Err("the line is not known".into());
    };
    let mut candidates: Vec<Candidate> = whole(scan).into_iter().collect();
    let inside = Inside::Share { length_m };
    let shape = |run: &RunData, i: usize| {
        let speed = run.smooth_mps[i];
        -scan.per_unit_resistance_mps2(&run.samples()[i]) * speed * speed
    };
    let Some(found) = find(scan, &shape, inside).filter(|found| found.runs.is_none()) else {
        return Ok(candidates);
    };
    let hypothesis = Tunnels {
        site: Site { choice_cost: found.choice_cost + UNMAPPED_COST, ..found.site(scan) },
        length_m,
        mapped_m: mapped_m(track),
    };
    candidates.push(Candidate::new(hypothesis, vec![found.estimate]));
    Ok(candidates)
}

/// The kind as one number of the whole train or line.
pub fn whole(scan: &Scan) -> Option<Candidate> {
    let inside_s = scan.seconds_where(|_, sample| sample.tunnel_share.is_some_and(|s| s > 0.0));
    let mapped = Tunnels {
        site: Site::default(),
        length_m: scan.train.length_m,
        mapped_m: mapped_m(scan.track?),
    };
    (inside_s > MAPPED_MIN_S).then(|| Candidate::new(mapped, vec![0.0]))
}

/// Chainages in m of the mapped tunnels.
fn mapped_m(track: &Track) -> Vec<[f64; 2]> {
    track.tunnels().iter().map(|tunnel| [tunnel.start_m, tunnel.end_m]).collect()
}

impl Hypothesis for Tunnels {
    fn nature(&self) -> Nature<'_> {
        Nature {
            choice_cost: self.site.choice_cost,
            shared_error: self.site.map_error,
            affine_in: Some(|value| value),
            ..Nature::new(EffectKind::TunnelDrag, &tunnel::PARAMETERS)
        }
    }

    fn is_material(&self, parameters: &[f64], c: f64) -> bool {
        parameters[0] > tunnel::LEAST_SHARE_OF_C * c
    }

    fn apply(&self, parameters: &[f64], On { run, first, .. }: On, forces: &mut [SampleForces]) {
        let found = self.site.sections.as_ref();
        let found = found.map(|found| place::profile(&found.intervals_m, 1.0));
        let places = run.known(Covariate::Chainage, first).zip(&run.tunnel_share[first..]);
        for (force, (position_m, &mapped)) in forces.iter_mut().zip(places) {
            let share = match &found {
                None => mapped,
                Some(profile) => profile
                    .as_ref()
                    .ok()
                    .zip(position_m)
                    .map_or(0.0, |(profile, at_m)| profile.mean_around(at_m, self.length_m)),
            };
            tunnel::act(parameters[0], Some(share), &mut force.resistance);
            tunnel::enter(Some(share.max(mapped)), &mut force.resistance);
        }
    }

    fn entries(&self, parameters: &[f64]) -> Option<Vec<ModelEntry>> {
        let mut entries = vec![ModelEntry::Number(&tunnel::DC, parameters[0])];
        if let Some(found) = &self.site.sections {
            // The files know one greater c for all tunnels.
            if !self.mapped_m.is_empty() {
                return None;
            }
            let rows = found.intervals_m.iter().map(|interval_m| interval_m.to_vec()).collect();
            entries.push(ModelEntry::Rows("tunnels", rows));
        }
        Some(entries)
    }

    fn site(&self) -> Option<&Site> {
        Some(&self.site)
    }

    fn at_site(&self, site: Site) -> Option<SharedHypothesis> {
        Some(Arc::new(Tunnels { site, ..self.clone() }))
    }

    fn place(&self) -> Location {
        if self.site.sections.is_some() {
            return self.site.place();
        }
        Location::of_intervals(self.mapped_m.clone())
    }

    fn report(&self, context: &ReportContext) -> ReportedValues {
        let (extra, extra_deviation) = (context.parameters[0], context.deviations[0]);
        let mut reported = ReportedValues::default();
        let force_per_unit = 1.0 * context.weight_kn;
        reported.push("dc_n_per_mps2", extra * force_per_unit, extra_deviation * force_per_unit);
        let c = context.c;
        // A c that is not distinguishable from none makes no factor.
        if c > context.c_deviation {
            // Delta method for 1 + extra / c.
            let (by_extra, by_c) = (1.0 / c, -extra / (c * c));
            let variance = (by_extra * extra_deviation).powi(2)
                + (by_c * context.c_deviation).powi(2)
                + 2.0 * by_extra * by_c * context.c_covariance();
            reported.push("c_factor", 1.0 + extra / c, variance.max(0.0).sqrt());
        }
        reported
    }
}
