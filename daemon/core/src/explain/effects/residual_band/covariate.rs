//! What an unexplained residual may depend on, and what an extra force there looks like.

use crate::explain::effects::Parameter;
use crate::explain::evidence::RunData;
use crate::explain::scan::Scan;
use crate::force::ResolvedSample;

const RESISTANCE: [Parameter; 1] = [Parameter::new("extra_n_per_kn", (-50.0, 50.0), 0.01)];
const GRADIENT: [Parameter; 1] = [Parameter::new("gradient_error_permille", (-30.0, 30.0), 0.01)];
const SHARE: [Parameter; 1] = [Parameter::new("force_error_share", (-0.6, 0.6), 0.002)];

/// What the residual may depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Covariate {
    Speed,
    Chainage,
    TimeSinceStart,
    TractionForce,
    BrakeForce,
    Temperature,
    Run,
}

/// All of them.
pub const COVARIATES: [Covariate; 7] = [
    Covariate::Speed,
    Covariate::Chainage,
    Covariate::TimeSinceStart,
    Covariate::TractionForce,
    Covariate::BrakeForce,
    Covariate::Temperature,
    Covariate::Run,
];

impl Covariate {
    /// Its name in the answer, with the unit.
    pub fn name(self) -> &'static str {
        match self {
            Covariate::Speed => "speed_mps",
            Covariate::Chainage => "chainage_m",
            Covariate::TimeSinceStart => "time_since_start_s",
            Covariate::TractionForce => "traction_force_n",
            Covariate::BrakeForce => "brake_force_n",
            Covariate::Temperature => "ambient_temperature_degc",
            Covariate::Run => "run",
        }
    }

    /// At a sample of the fit run with this number; a holdout run has none.
    pub fn value(self, run: &RunData, number: Option<usize>, index: usize) -> Option<f64> {
        let sample = &run.samples()[index];
        match self {
            Covariate::Speed => Some(run.smooth_mps[index]),
            Covariate::Chainage => sample.position_m,
            Covariate::TimeSinceStart => Some(run.recording.time_s()[index]),
            Covariate::TractionForce => sample.traction_force_n,
            Covariate::BrakeForce => sample.brake_force_n,
            Covariate::Temperature => sample.ambient_temperature_degc,
            Covariate::Run => number.map(|number| number as f64),
        }
    }

    /// What an extra force there is measured by.
    pub fn parameters(self) -> &'static [Parameter] {
        match self {
            Covariate::Chainage => &GRADIENT,
            Covariate::TractionForce | Covariate::BrakeForce => &SHARE,
            _ => &RESISTANCE,
        }
    }

    /// Acceleration in m/s² per unit of the parameter.
    pub fn shape(self, scan: &Scan, sample: &ResolvedSample) -> f64 {
        let per_unit = scan.per_unit_resistance_mps2(sample);
        match self {
            // The map's error turns its sign with the direction of travel.
            Covariate::Chainage => -sample.direction * per_unit,
            Covariate::TractionForce => {
                sample.traction_force_n.unwrap_or(0.0) / sample.inertial_mass_kg
            }
            Covariate::BrakeForce => -sample.brake_force_n.unwrap_or(0.0) / sample.inertial_mass_kg,
            _ => -per_unit,
        }
    }
}
