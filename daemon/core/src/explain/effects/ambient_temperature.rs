//! Basic resistance that follows the outside temperature: w0 (1 + beta (T - reference)).

use dynocar_shared::vocabulary::EffectKind;

use super::{Candidate, Effect, Hypothesis, Parameter, Proposal, ReportContext, Reported};
use crate::explain::evidence::{RunData, SampleForces};
use crate::explain::scan::Scan;

/// Air density alone gives -0.0035 per kelvin; grease makes it more.
const PARAMETERS: [Parameter; 1] = [Parameter::new("w0_per_k", (-0.05, 0.05), 0.0005)];
/// The standard atmosphere's 15 °C, at which the fitted a, b, c hold.
const REFERENCE_DEGC: f64 = 15.0;
/// Mean temperatures of the runs must differ by so many K.
const SPREAD_MIN_K: f64 = 4.0;

/// The kind.
pub struct AmbientTemperature;

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

impl Effect for AmbientTemperature {
    fn kind(&self) -> EffectKind {
        EffectKind::AmbientTemperature
    }

    fn propose(&self, scan: &Scan) -> Proposal {
        let means: Option<Vec<f64>> = scan.problem.runs.iter().map(mean_degc).collect();
        let Some(means) = means else {
            return Proposal::NotTestable(
                "ambient_temperature is not recorded in every run".into(),
            );
        };
        let low = means.iter().copied().fold(f64::INFINITY, f64::min);
        let high = means.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if high - low < SPREAD_MIN_K {
            let spread = high - low;
            return Proposal::NotTestable(format!(
                "the runs' outside temperatures differ by {spread:.1} K only"
            ));
        }
        Proposal::Candidates(vec![Candidate::new(Linear, vec![0.0])])
    }
}

impl Hypothesis for Linear {
    fn kind(&self) -> EffectKind {
        EffectKind::AmbientTemperature
    }

    fn parameters(&self) -> &[Parameter] {
        &PARAMETERS
    }

    fn is_material(&self, parameters: &[f64], _c: f64) -> bool {
        parameters[0].abs() > 0.001
    }

    fn apply(&self, parameters: &[f64], run: &RunData, forces: &mut [SampleForces]) {
        let mut degc = mean_degc(run).unwrap_or(REFERENCE_DEGC);
        for (force, sample) in forces.iter_mut().zip(run.samples()) {
            degc = sample.ambient_temperature_degc.unwrap_or(degc);
            force.resistance_factor *= 1.0 + parameters[0] * (degc - REFERENCE_DEGC);
        }
    }

    fn report(&self, context: &ReportContext) -> Reported {
        let mut reported = Reported::default();
        reported.push("w0_per_k", context.parameters[0], context.deviations[0]);
        reported.push("reference_k", REFERENCE_DEGC + 273.15, 0.0);
        reported
    }
}
