//! Basic resistance that depends on the outside temperature: w0 (1 + beta (T - reference)).

use dynocar_model::terms::extra::Covariate;
use dynocar_model::terms::{ModelEntry, ambient};
use dynocar_shared::vocabulary::EffectKind;

use super::{
    Candidate, Certainty, Hypothesis, Nature, On, Policy, Proposal, ReportContext, ReportedValues,
};
use crate::explain::evidence::{RunData, SampleForces};
use crate::explain::scan::Scan;
use crate::statistics::span;

/// Least difference in K between the mean temperatures of the runs.
const SPREAD_MIN_K: f64 = 4.0;

#[derive(Debug)]
struct Linear;

/// Mean outside temperature of a run in °C.
fn mean_degc(run: &RunData) -> Option<f64> {
    let (sum, count) = run
        .samples()
        .iter()
        .filter_map(|sample| sample.ambient_temperature_degc)
        .fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

/// Each run has one temperature, and also its load and wind, which may follow the temperatures by chance.
pub const POLICY: Policy = Policy { certainty: Certainty::WithNuisance, ..Policy::USUAL };

/// Proposes structures for the data at hand.
pub fn propose(scan: &Scan) -> Proposal {
    let means: Option<Vec<f64>> = scan.problem.runs.iter().map(mean_degc).collect();
    let Some(means) = means else {
        return Err("the outside temperature is not recorded in every run".into());
    };
    let spread_k = span(means.into_iter()).map_or(0.0, |[low, high]| high - low);
    if spread_k < SPREAD_MIN_K {
        return Err(format!("the runs' outside temperatures differ by {spread_k:.1} K only"));
    }
    Ok(vec![Candidate::new(Linear, vec![0.0])])
}

impl Hypothesis for Linear {
    fn nature(&self) -> Nature<'_> {
        Nature {
            least: Some(ambient::LEAST_PER_K),
            is_one_number_a_run: true,
            affine_in: Some(|value| value),
            ..Nature::new(EffectKind::AmbientTemperature, &ambient::PARAMETERS)
        }
    }

    fn apply(&self, parameters: &[f64], On { run, first, .. }: On, forces: &mut [SampleForces]) {
        for (force, degc) in forces.iter_mut().zip(run.known(Covariate::Temperature, first)) {
            ambient::act(parameters[0], ambient::REFERENCE_K, degc, &mut force.resistance);
        }
    }

    fn entries(&self, parameters: &[f64]) -> Option<Vec<ModelEntry>> {
        Some(vec![
            ModelEntry::Number(&ambient::W0_PER_K, parameters[0]),
            ModelEntry::Number(&ambient::REFERENCE, ambient::REFERENCE_K),
        ])
    }

    fn report(&self, context: &ReportContext) -> ReportedValues {
        let mut reported = ReportedValues::default();
        reported.push("w0_per_k", context.parameters[0], context.deviations[0]);
        reported.push("reference_k", ambient::REFERENCE_K, 0.0);
        reported
    }
}
