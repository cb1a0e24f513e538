//! Curve resistance k/R in N/kN with another constant k than declared (Röckl, Schmidt; usually declared as 600).

use dynocar_model::force::ResolvedSample;
use dynocar_model::terms::curve;
use dynocar_shared::vocabulary::EffectKind;

use super::{Candidate, DeclaredFigure, Handling, Hypothesis, Nature, On, Policy, Proposal};
use crate::explain::answer::Location;
use crate::explain::evidence::{RunData, SampleForces};
use crate::explain::scan::Scan;

#[derive(Debug)]
struct Curves {
    declared_k: f64,
    intervals_m: Vec<[f64; 2]>,
}

/// It estimates a figure that is usually a little wrong.
pub const POLICY: Policy = Policy { frees: &[DeclaredFigure::Curves], ..Policy::USUAL };

/// Proposes structures for the data at hand.
pub fn propose(scan: &Scan) -> Proposal {
    let in_curve_s = scan
        .seconds_where(|_, sample| sample.curvature_per_m.is_some_and(|curvature| curvature > 0.0));
    if in_curve_s < 20.0 {
        return Err("no curves known on the way".into());
    }
    let declared_k = scan.train.curve_constant_n_per_kn_m;
    let intervals_m = scan.track.map_or_else(Vec::new, |track| {
        track.curves().iter().map(|curve| [curve.start_m, curve.end_m]).collect()
    });
    Ok(vec![Candidate::new(Curves { declared_k, intervals_m }, vec![declared_k])])
}

impl Hypothesis for Curves {
    fn nature(&self) -> Nature<'_> {
        Nature {
            keys: &[&curve::CONSTANT],
            none: self.declared_k,
            least: Some(curve::LEAST_N_PER_KN_M),
            handling: Handling::Added,
            ..Nature::new(EffectKind::CurveResistance, &curve::PARAMETERS)
        }
    }

    fn unit_n_per_kn(&self, _others: &[f64], run: &RunData, n_per_kn: &mut Vec<f64>) {
        n_per_kn.clear();
        let of_one = |sample: &ResolvedSample| sample.curvature_per_m.unwrap_or(0.0);
        n_per_kn.extend(run.samples().iter().map(of_one));
    }

    fn apply(&self, parameters: &[f64], On { run, first, .. }: On, forces: &mut [SampleForces]) {
        for (force, sample) in forces.iter_mut().zip(&run.samples()[first..]) {
            curve::act(parameters[0], sample.curvature_per_m, &mut force.resistance);
        }
    }

    fn place(&self) -> Location {
        Location::of_intervals(self.intervals_m.clone())
    }
}
