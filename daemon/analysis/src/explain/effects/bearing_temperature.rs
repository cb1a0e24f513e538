//! Cold bearings, whose resistance falls as they warm up.

use dynocar_model::terms::extra::Covariate;
use dynocar_model::terms::{Resistance, bearings};
use dynocar_shared::vocabulary::EffectKind;

use super::{Candidate, DeclaredFigure, Handling, Hypothesis, Nature, On, Policy, Proposal};
use crate::explain::evidence::{RunData, SampleForces};
use crate::explain::scan::Scan;

#[derive(Debug)]
struct Warming;

/// It estimates a figure that is usually a little wrong.
pub const POLICY: Policy = Policy { frees: &[DeclaredFigure::Warming], ..Policy::USUAL };

/// Proposes structures for the data at hand.
pub fn propose(scan: &Scan) -> Proposal {
    let longest_s = scan.problem.runs.iter().map(RunData::duration_s).fold(0.0, f64::max);
    if longest_s < 240.0 {
        return Err("runs are too short for bearings to warm up".into());
    }
    let best = [80.0, 160.0, 300.0, 600.0, 1200.0]
        .into_iter()
        .map(|tau_s| {
            let tuple = scan.tuple(|run, i| {
                let sample = &run.samples()[i];
                let mut cold = Resistance::BASIC;
                bearings::act(1.0, tau_s, sample.since_cold_s, &mut cold);
                -cold.bearing_n_per_kn * scan.per_unit_resistance_mps2(sample)
            });
            let (gain, estimate) = scan.gain(&tuple);
            (if estimate > 0.0 { gain } else { 0.0 }, estimate, tau_s)
        })
        .max_by(|one, other| one.0.total_cmp(&other.0));
    let Some((_, delta, tau_s)) = best else { return Ok(Vec::new()) };
    Ok(vec![Candidate::new(Warming, vec![delta.clamp(0.05, 10.0), tau_s])])
}

impl Hypothesis for Warming {
    fn nature(&self) -> Nature<'_> {
        Nature {
            keys: &[&bearings::DELTA_A, &bearings::TAU],
            handling: Handling::Added,
            ..Nature::new(EffectKind::BearingTemperature, &bearings::PARAMETERS)
        }
    }

    fn unit_n_per_kn(&self, others: &[f64], run: &RunData, n_per_kn: &mut Vec<f64>) {
        n_per_kn.clear();
        let since_cold_s = run.covariate(Covariate::TimeSinceStart);
        n_per_kn.extend(since_cold_s.iter().map(|&since_cold_s| {
            let mut resistance = Resistance::BASIC;
            bearings::act(1.0, others[0], since_cold_s, &mut resistance);
            resistance.bearing_n_per_kn
        }));
    }

    fn apply(&self, parameters: &[f64], On { run, first, .. }: On, forces: &mut [SampleForces]) {
        let since_cold_s = &run.covariate(Covariate::TimeSinceStart)[first..];
        for (force, &since_cold_s) in forces.iter_mut().zip(since_cold_s) {
            bearings::act(parameters[0], parameters[1], since_cold_s, &mut force.resistance);
        }
    }
}
