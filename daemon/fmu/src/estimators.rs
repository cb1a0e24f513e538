//! The model that learns: the recommended estimators, and all its variables.

use dynocar_core::pipeline::Pipeline;
use dynocar_core::pipeline::output::candidates;
use dynocar_shared::{
    Parameter, ParameterSnapshot, PipelineKind, Quantity, SampleField, TrainSample,
};

use crate::variables;
use crate::variables::{
    FmiUnit, Interface, Meaning, ModelFile, SnapshotField, Variable, digits, guid, measured, row,
};

/// The recommended estimators, which a configuration of the daemon has by default; one for each
/// quantity, and the monitor.
pub const PIPELINES: [PipelineKind; 4] = [RESISTANCE, ADHESION, BRAKE, MONITOR];
const RESISTANCE: PipelineKind = candidates(Quantity::Resistance)[0];
const MASS: PipelineKind = candidates(Quantity::Mass)[0];
const _: () = assert!(RESISTANCE as u32 == MASS as u32, "one estimate of both");
const ADHESION: PipelineKind = candidates(Quantity::Adhesion)[0];
const BRAKE: PipelineKind = candidates(Quantity::BrakeFriction)[0];
const MONITOR: PipelineKind = PipelineKind::ResidualMonitor;

/// The estimators.
pub const ESTIMATORS: Interface = Interface {
    identifier: "dynocar",
    name: "Dynocar",
    about: "Learns running resistance, mass, adhesion and brake friction of a train from what its \
        controller measures",
    step: "Each step takes one sample: the inputs at the beginning of the step, stamped with its \
        time. Use an estimate only while its status is 2, estimated.",
    guid: digits(&GUID_DIGITS),
    variables: VARIABLES,
    takes_slopes: false,
};

pub(crate) const GUID_DIGITS: [u8; 16] =
    guid::<{ VARIABLES.len() }>(concat!("dynocar ", env!("CARGO_PKG_VERSION")), VARIABLES);

const fn reported(
    name: &'static str,
    of: PipelineKind,
    reported: SnapshotField,
    unit: FmiUnit,
    description: &'static str,
) -> Variable {
    row(name, Meaning::Estimate(of, reported), unit, description)
}

const STATUS: &str = "What may be done with it: 2 estimated, may be used";
const REASON: &str = "Why the status is what it is";
const USABLE: &str = "True while its status is estimated: it may be used";
const REJECTED: &str = "Samples refused so far";
const STD: &str = "Its standard deviation";

/// Every variable, in the order of the value references.
#[rustfmt::skip]
const VARIABLES: &[Variable] = &[
    row("train_file", Meaning::File(ModelFile::Train), variables::NONE, "Path of the train's file; empty: the one inside the FMU"),
    row("track_file", Meaning::File(ModelFile::Track), variables::NONE, "Path of the line's file; empty: the one inside the FMU, if any"),

    measured("position_m", SampleField::Position, variables::METRE, "Chainage of the train's centre"),
    measured("speed_mps", SampleField::Speed, variables::METRE_PER_SECOND, "Speed, never negative"),
    measured("traction_force_n", SampleField::TractionForce, variables::NEWTON, "Traction force at the wheel rims, never negative"),
    measured("brake_force_n", SampleField::BrakeForce, variables::NEWTON, "Brake force, retarding, never negative"),
    measured("brake_cylinder_pressure_pa", SampleField::BrakeCylinderPressure, variables::PASCAL, "Brake-cylinder pressure"),
    measured("acceleration_mps2", SampleField::Acceleration, variables::METRE_PER_SECOND_2, "dv/dt as measured"),
    measured("specific_force_mps2", SampleField::SpecificForce, variables::METRE_PER_SECOND_2, "What an accelerometer reads along the track"),
    measured("mass_kg", SampleField::Mass, variables::KILOGRAM, "Gross mass without the rotating part"),
    measured("ambient_temperature_degc", SampleField::AmbientTemperature, variables::CELSIUS, "Outside temperature"),
    measured("gradient_permille", SampleField::Gradient, variables::PERMILLE, "Gradient, climbing positive as the chainage grows; for lines without a file"),
    measured("curve_radius_m", SampleField::CurveRadius, variables::METRE, "Curve radius, 0 on straight track; for lines without a file"),
    row("direction", Meaning::Direction, variables::NONE, "+1 while the chainage grows in the direction of travel, -1 while it falls"),
    row("wheel_slide", Meaning::WheelSlide, variables::NONE, "True while wheel-slide protection is active"),
    row("run", Meaning::Run, variables::NONE, "Number of the run (trip); no integral crosses its change"),

    reported("resistance.a", RESISTANCE, SnapshotField::Value(Parameter::DavisA), variables::NEWTON_PER_KILONEWTON, "Davis a"),
    reported("resistance.a_std", RESISTANCE, SnapshotField::Std(Parameter::DavisA), variables::NEWTON_PER_KILONEWTON, STD),
    reported("resistance.b", RESISTANCE, SnapshotField::Value(Parameter::DavisB), variables::DAVIS_B, "Davis b"),
    reported("resistance.b_std", RESISTANCE, SnapshotField::Std(Parameter::DavisB), variables::DAVIS_B, STD),
    reported("resistance.c", RESISTANCE, SnapshotField::Value(Parameter::DavisC), variables::DAVIS_C, "Davis c"),
    reported("resistance.c_std", RESISTANCE, SnapshotField::Std(Parameter::DavisC), variables::DAVIS_C, STD),
    reported("resistance.w0", RESISTANCE, SnapshotField::Resistance, variables::NEWTON_PER_KILONEWTON, "Basic resistance at the speed of the sample"),
    reported("resistance.w0_std", RESISTANCE, SnapshotField::ResistanceStd, variables::NEWTON_PER_KILONEWTON, "Its standard deviation, from the full covariance"),
    reported("resistance.status", RESISTANCE, SnapshotField::Status, variables::NONE, STATUS),
    reported("resistance.reason", RESISTANCE, SnapshotField::Reason, variables::NONE, REASON),
    reported("resistance.rejected", RESISTANCE, SnapshotField::Rejected, variables::NONE, REJECTED),

    reported("mass.mass_t", MASS, SnapshotField::Value(Parameter::Mass), variables::TONNE, "Gross mass"),
    reported("mass.mass_t_std", MASS, SnapshotField::Std(Parameter::Mass), variables::TONNE, STD),
    reported("mass.status", MASS, SnapshotField::Status, variables::NONE, STATUS),
    reported("mass.reason", MASS, SnapshotField::Reason, variables::NONE, REASON),
    reported("mass.rejected", MASS, SnapshotField::Rejected, variables::NONE, REJECTED),

    reported("adhesion.adhesion", ADHESION, SnapshotField::Value(Parameter::Adhesion), variables::NONE, "Adhesion of wheel on rail, where the rail was the limit"),
    reported("adhesion.adhesion_std", ADHESION, SnapshotField::Std(Parameter::Adhesion), variables::NONE, STD),
    reported("adhesion.adhesion_lower_bound", ADHESION, SnapshotField::Value(Parameter::AdhesionLowerBound), variables::NONE, "What the rail carried at least, where the brake was the limit"),
    reported("adhesion.adhesion_lower_bound_std", ADHESION, SnapshotField::Std(Parameter::AdhesionLowerBound), variables::NONE, STD),
    reported("adhesion.adhesion_law_scale", ADHESION, SnapshotField::Value(Parameter::AdhesionLawScale), variables::NONE, "Scale of the known law of adhesion over speed"),
    reported("adhesion.adhesion_law_scale_std", ADHESION, SnapshotField::Std(Parameter::AdhesionLawScale), variables::NONE, STD),
    reported("adhesion.status", ADHESION, SnapshotField::Status, variables::NONE, STATUS),
    reported("adhesion.reason", ADHESION, SnapshotField::Reason, variables::NONE, REASON),
    reported("adhesion.rejected", ADHESION, SnapshotField::Rejected, variables::NONE, REJECTED),

    reported("brake_friction.disc_friction", BRAKE, SnapshotField::Value(Parameter::DiscFriction), variables::NONE, "Friction of the brake discs; needs the pressure and the gear in the train's file"),
    reported("brake_friction.disc_friction_std", BRAKE, SnapshotField::Std(Parameter::DiscFriction), variables::NONE, STD),
    reported("brake_friction.status", BRAKE, SnapshotField::Status, variables::NONE, STATUS),
    reported("brake_friction.reason", BRAKE, SnapshotField::Reason, variables::NONE, REASON),
    reported("brake_friction.rejected", BRAKE, SnapshotField::Rejected, variables::NONE, REJECTED),

    reported("monitor.unexplained_force_n", MONITOR, SnapshotField::UnexplainedForce, variables::NEWTON, "Force that the declared model does not explain, retarding positive"),
    reported("monitor.unexplained_force_n_std", MONITOR, SnapshotField::UnexplainedForceStd, variables::NEWTON, STD),
    reported("monitor.suspected_effect", MONITOR, SnapshotField::SuspectedEffect, variables::NONE, "The effect that the model may lack"),
    reported("monitor.status", MONITOR, SnapshotField::Status, variables::NONE, STATUS),
    reported("monitor.reason", MONITOR, SnapshotField::Reason, variables::NONE, REASON),
    reported("monitor.rejected", MONITOR, SnapshotField::Rejected, variables::NONE, REJECTED),

    // For hosts that drop enumerations; below the others, whose references stay.
    reported("resistance.status_number", RESISTANCE, SnapshotField::StatusNumber, variables::NONE, STATUS),
    reported("resistance.reason_number", RESISTANCE, SnapshotField::ReasonNumber, variables::NONE, REASON),
    reported("resistance.usable", RESISTANCE, SnapshotField::Usable(Quantity::Resistance), variables::NONE, USABLE),
    reported("mass.status_number", MASS, SnapshotField::StatusNumber, variables::NONE, STATUS),
    reported("mass.reason_number", MASS, SnapshotField::ReasonNumber, variables::NONE, REASON),
    reported("mass.usable", MASS, SnapshotField::Usable(Quantity::Mass), variables::NONE, USABLE),
    reported("adhesion.status_number", ADHESION, SnapshotField::StatusNumber, variables::NONE, STATUS),
    reported("adhesion.reason_number", ADHESION, SnapshotField::ReasonNumber, variables::NONE, REASON),
    reported("adhesion.usable", ADHESION, SnapshotField::Usable(Quantity::Adhesion), variables::NONE, USABLE),
    reported("brake_friction.status_number", BRAKE, SnapshotField::StatusNumber, variables::NONE, STATUS),
    reported("brake_friction.reason_number", BRAKE, SnapshotField::ReasonNumber, variables::NONE, REASON),
    reported("brake_friction.usable", BRAKE, SnapshotField::Usable(Quantity::BrakeFriction), variables::NONE, USABLE),
    reported("monitor.status_number", MONITOR, SnapshotField::StatusNumber, variables::NONE, STATUS),
    reported("monitor.reason_number", MONITOR, SnapshotField::ReasonNumber, variables::NONE, REASON),
    reported("monitor.suspected_effect_number", MONITOR, SnapshotField::SuspectedEffectNumber, variables::NONE, "The effect that the model may lack"),
];

/// Snapshot before the files are read.
static NOTHING: ParameterSnapshot = ParameterSnapshot::empty();

/// The estimators behind an instance.
pub struct Estimators {
    /// By [`PIPELINES`].
    pipelines: Vec<Pipeline>,
    /// Speed in m/s of the newest step's sample; NaN before it.
    speed_mps: f64,
}

impl Estimators {
    /// These, by [`PIPELINES`], before the first sample.
    pub fn new(pipelines: Vec<Pipeline>) -> Self {
        Estimators { pipelines, speed_mps: f64::NAN }
    }

    /// Takes a sample.
    pub fn take(&mut self, sample: &TrainSample) {
        self.speed_mps = sample.get(SampleField::Speed).unwrap_or(f64::NAN);
        for pipeline in &mut self.pipelines {
            pipeline.process(sample);
        }
    }

    fn snapshot(&self, of: PipelineKind) -> &ParameterSnapshot {
        let place = PIPELINES.iter().position(|&kind| kind == of);
        place.and_then(|place| self.pipelines.get(place)).map_or(&NOTHING, Pipeline::snapshot)
    }

    /// Returns a number, where it is known.
    pub fn real(&self, of: PipelineKind, reported: SnapshotField) -> Option<f64> {
        let snapshot = self.snapshot(of);
        match reported {
            SnapshotField::Value(parameter) => snapshot.value(parameter),
            SnapshotField::Std(parameter) => snapshot.std(parameter),
            SnapshotField::Resistance => Some(snapshot.resistance_at(self.speed_mps)?.w0_n_per_kn),
            SnapshotField::ResistanceStd => {
                Some(snapshot.resistance_at(self.speed_mps)?.w0_std_n_per_kn)
            }
            SnapshotField::UnexplainedForce => Some(snapshot.unexplained_force_n),
            SnapshotField::UnexplainedForceStd => Some(snapshot.unexplained_force_std_n),
            _ => None,
        }
    }

    /// Returns a whole number, or the number of a member of a vocabulary.
    pub fn integer(&self, of: PipelineKind, reported: SnapshotField) -> u64 {
        let snapshot = self.snapshot(of);
        match reported {
            SnapshotField::Status | SnapshotField::StatusNumber => snapshot.status.into(),
            SnapshotField::Reason | SnapshotField::ReasonNumber => snapshot.reason.into(),
            SnapshotField::SuspectedEffect | SnapshotField::SuspectedEffectNumber => {
                snapshot.suspected_effect.into()
            }
            _ => snapshot.samples_rejected,
        }
    }

    /// Returns whether the values of a quantity may be used, with the daemon's hysteresis.
    pub fn is_usable(&self, of: PipelineKind, quantity: Quantity) -> bool {
        self.snapshot(of).usable_quantities & quantity.bit() != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_says_what_the_variable_stands_for() {
        for variable in VARIABLES {
            let name = variable.name;
            let expected = match variable.meaning {
                Meaning::Estimate(_, SnapshotField::Value(parameter)) => {
                    parameter.name().to_owned()
                }
                Meaning::Estimate(_, SnapshotField::Std(parameter)) => {
                    format!("{}_std", parameter.name())
                }
                _ => continue,
            };
            assert_eq!(name.split_once('.').map(|(_, name)| name), Some(expected.as_str()));
        }
        for field in SampleField::ALL {
            let count =
                VARIABLES.iter().filter(|it| it.meaning == Meaning::Measured(field)).count();
            assert_eq!(count, 1, "{field:?}");
        }
    }

    #[test]
    fn every_recommended_estimator_shows_status_reason_and_refusals_under_one_name() {
        for kind in PIPELINES {
            let of_kind =
                |it: &&Variable| matches!(it.meaning, Meaning::Estimate(of, _) if of == kind);
            let names: Vec<_> = VARIABLES.iter().filter(of_kind).map(|it| it.name).collect();
            for group in names.iter().map(|name| name.split('.').next().unwrap()) {
                let mut reported =
                    vec!["status", "reason", "rejected", "status_number", "reason_number"];
                // The monitor answers no quantity.
                reported.extend((kind != MONITOR).then_some("usable"));
                for reported in reported {
                    let name = format!("{group}.{reported}");
                    assert!(names.contains(&name.as_str()), "{kind}: {reported}");
                }
            }
        }
    }
}
