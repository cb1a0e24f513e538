//! Axes on which an unexplained residual may depend, and the shapes of an extra force there.

use dynocar_model::force::ResolvedSample;
use dynocar_model::terms::Parameter;
use dynocar_model::terms::extra::Covariate;

use crate::explain::evidence::RunData;
use crate::explain::scan::Scan;

const RESISTANCE: [Parameter; 1] = [Parameter::new("extra_n_per_kn", (-50.0, 50.0), 0.01)];
const GRADIENT: [Parameter; 1] = [Parameter::new("gradient_error_permille", (-30.0, 30.0), 0.01)];
const SHARE: [Parameter; 1] = [Parameter::new("force_error_share", (-0.6, 0.6), 0.002)];

/// Axis along which the bands lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BandAxis {
    Of(Covariate),
    Run,
}

/// All axes.
pub const AXES: [BandAxis; 7] = [
    BandAxis::Of(Covariate::Speed),
    BandAxis::Of(Covariate::Chainage),
    BandAxis::Of(Covariate::TimeSinceStart),
    BandAxis::Of(Covariate::TractionForce),
    BandAxis::Of(Covariate::BrakeForce),
    BandAxis::Of(Covariate::Temperature),
    BandAxis::Run,
];

impl BandAxis {
    /// Its name in the answer, with the unit.
    pub fn name(self) -> &'static str {
        match self {
            BandAxis::Of(covariate) => covariate.name(),
            BandAxis::Run => "run",
        }
    }

    /// At a sample of the fit run with this number; a holdout run has none.
    pub fn value(self, run: &RunData, number: Option<usize>, index: usize) -> Option<f64> {
        match self {
            BandAxis::Of(Covariate::Speed) => Some(run.smooth_mps[index]),
            BandAxis::Of(Covariate::TimeSinceStart) => Some(run.recording.time_s()[index]),
            BandAxis::Of(covariate) => {
                Some(run.covariate(covariate)[index]).filter(|value| !value.is_nan())
            }
            BandAxis::Run => number.map(|number| number as f64),
        }
    }

    /// True where an extra force there is a share of the control force.
    pub fn is_force(self) -> bool {
        matches!(self, BandAxis::Of(Covariate::TractionForce | Covariate::BrakeForce))
    }

    /// Returns the parameters that measure an extra force there.
    pub fn parameters(self) -> &'static [Parameter] {
        match self {
            BandAxis::Of(Covariate::Chainage) => &GRADIENT,
            BandAxis::Of(Covariate::TractionForce) | BandAxis::Of(Covariate::BrakeForce) => &SHARE,
            _ => &RESISTANCE,
        }
    }

    /// Acceleration in m/s² per unit of the parameter.
    pub fn shape(self, scan: &Scan, sample: &ResolvedSample) -> f64 {
        let per_unit = scan.per_unit_resistance_mps2(sample);
        match self {
            // The map's error turns its sign with the direction of travel.
            BandAxis::Of(Covariate::Chainage) => -sample.direction * per_unit,
            BandAxis::Of(Covariate::TractionForce) => {
                sample.traction_force_n.unwrap_or(0.0) / sample.inertial_mass_kg
            }
            BandAxis::Of(Covariate::BrakeForce) => {
                -sample.brake_force_n.unwrap_or(0.0) / sample.inertial_mass_kg
            }
            _ => -per_unit,
        }
    }
}
