//! Air resistance in tunnels: c v² is larger for the part of the train inside.

use dynocar_shared::vocabulary::EffectKind;

use super::{Candidate, Effect, Hypothesis, Parameter, Proposal, ReportContext, Reported};
use crate::explain::answer::Place;
use crate::explain::evidence::{RunData, SampleForces};
use crate::explain::localise::{Inside, find};
use crate::explain::scan::Scan;

/// Single-track tunnels reach several times c; the bound is in N/kN per (m/s)².
const PARAMETERS: [Parameter; 1] = [Parameter::new("dc_n_per_kn_per_mps2", (0.0, 0.2), 1e-5)];

/// The kind.
pub struct TunnelDrag;

#[derive(Debug)]
struct Tunnels {
    /// `None`: the mapped ones; else where they were found.
    found_m: Option<(Vec<[f64; 2]>, Inside)>,
    intervals_m: Vec<[f64; 2]>,
    choice_cost: f64,
    map_error: f64,
}

impl Effect for TunnelDrag {
    fn kind(&self) -> EffectKind {
        EffectKind::TunnelDrag
    }

    fn propose(&self, scan: &Scan) -> Proposal {
        let inside_s = scan.seconds_where(|_, sample| sample.tunnel_share.is_some_and(|s| s > 0.0));
        let is_mapped = scan.track.is_some_and(|track| track.knows_tunnels());
        if is_mapped && inside_s < 10.0 {
            return Proposal::NotTestable("no mapped tunnel on the way".into());
        }
        if is_mapped {
            let intervals_m = scan.track.map_or_else(Vec::new, |track| {
                track.tunnels().iter().map(|tunnel| [tunnel.start_m, tunnel.end_m]).collect()
            });
            let mapped = Tunnels { found_m: None, intervals_m, choice_cost: 0.0, map_error: 0.0 };
            return Proposal::Candidates(vec![Candidate::new(mapped, vec![0.0])]);
        }
        if scan.track.is_none() {
            return Proposal::NotTestable("the line is not known".into());
        }
        let inside = Inside::Share { length_m: scan.train.length_m };
        let shape = |run: &RunData, i: usize| {
            let speed = run.smooth_mps[i];
            -scan.per_unit_resistance_mps2(&run.samples()[i]) * speed * speed
        };
        let Some(found) = find(scan, &shape, inside, true).filter(|found| found.runs.is_none())
        else {
            return Proposal::Candidates(Vec::new());
        };
        let hypothesis = Tunnels {
            found_m: Some((found.intervals_m.clone(), inside)),
            intervals_m: found.intervals_m,
            // A tunnel that nobody mapped is less likely than some resistance at a place.
            choice_cost: found.choice_cost + 4.0,
            map_error: found.map_error,
        };
        Proposal::Candidates(vec![Candidate::new(hypothesis, vec![found.estimate])])
    }
}

impl Hypothesis for Tunnels {
    fn kind(&self) -> EffectKind {
        EffectKind::TunnelDrag
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

    fn is_material(&self, parameters: &[f64], c: f64) -> bool {
        parameters[0] > 0.08 * c
    }

    fn apply(&self, parameters: &[f64], run: &RunData, forces: &mut [SampleForces]) {
        for (force, sample) in forces.iter_mut().zip(run.samples()) {
            let share = match &self.found_m {
                None => sample.tunnel_share.unwrap_or(0.0),
                Some((intervals_m, inside)) => inside.share(sample.position_m, intervals_m),
            };
            force.c_extra += share * parameters[0];
        }
    }

    fn place(&self) -> Place {
        Place::of_intervals(self.intervals_m.clone())
    }

    fn report(&self, context: &ReportContext) -> Reported {
        let (extra, extra_deviation) = (context.parameters[0], context.deviations[0]);
        let mut reported = Reported::default();
        let force_per_unit = 1.0 * context.weight_kn;
        reported.push("dc_n_per_mps2", extra * force_per_unit, extra_deviation * force_per_unit);
        let c = context.c;
        // A c that is not told from none makes no factor.
        if c > context.c_deviation {
            // Delta method for 1 + extra / c.
            let (by_extra, by_c) = (1.0 / c, -extra / (c * c));
            let variance = (by_extra * extra_deviation).powi(2)
                + (by_c * context.c_deviation).powi(2)
                + 2.0 * by_extra * by_c * context.c_covariance;
            reported.push("c_factor", 1.0 + extra / c, variance.max(0.0).sqrt());
        }
        reported
    }
}
