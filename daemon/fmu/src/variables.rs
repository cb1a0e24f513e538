//! Every variable of the FMU, written once: what `modelDescription.xml` says and what is set and
//! got both come from [`VARIABLES`]. A variable's value reference is its place there.

use dynocar_core::pipeline::quantities::candidates;
use dynocar_shared::layout::{FieldLayout, hex_digits, layout_hash};
use dynocar_shared::{Parameter, PipelineKind, Quantity, SampleField};

use crate::units::{self, Unit};

/// A measured input of this value is missing, as is one that is NaN; what unconnected inputs start
/// with. Modelica knows no NaN.
pub const MISSING: f64 = 1e30;

/// The recommended estimators, which a configuration of the daemon has by default; one for each
/// quantity, and the monitor.
pub const PIPELINES: [PipelineKind; 5] = [RESISTANCE, MASS, ADHESION, BRAKE, MONITOR];
const RESISTANCE: PipelineKind = candidates(Quantity::Resistance)[0];
const MASS: PipelineKind = candidates(Quantity::Mass)[0];
const ADHESION: PipelineKind = candidates(Quantity::Adhesion)[0];
const BRAKE: PipelineKind = candidates(Quantity::BrakeFriction)[0];
const MONITOR: PipelineKind = PipelineKind::ResidualMonitor;

/// A file that describes what is declared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModelFile {
    /// The train's.
    Train,
    /// The line's.
    Track,
}

/// What is told of an estimator's snapshot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Told {
    /// A parameter's value.
    Value(Parameter),
    /// A parameter's standard deviation.
    Std(Parameter),
    /// Basic resistance at the speed of the newest sample.
    Resistance,
    /// Its standard deviation, from the full covariance.
    ResistanceStd,
    /// The force that the model does not explain.
    UnexplainedForce,
    /// Its standard deviation.
    UnexplainedForceStd,
    /// The suspected missing effect, by its number.
    SuspectedEffect,
    /// The status, by its number.
    Status,
    /// The reason, by its number.
    Reason,
    /// How many samples were refused.
    Rejected,
}

/// What a variable stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meaning {
    /// Parameter: the name of a file.
    File(ModelFile),
    /// Input: a measured quantity of the sample.
    Measured(SampleField),
    /// Input: the number of the run.
    Run,
    /// Input: the direction of travel.
    Direction,
    /// Input: whether wheel-slide protection is active.
    WheelSlide,
    /// Output: what an estimator says.
    Estimate(PipelineKind, Told),
}

/// The type of a variable in the standard's sense.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A number.
    Real,
    /// A whole number.
    Integer,
    /// True or false.
    Boolean,
    /// A text.
    String,
    /// A member of a vocabulary, by its number.
    Enumeration(Vocabulary),
}

/// A vocabulary of the project that is an enumeration of the FMU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Vocabulary {
    /// What may be done with an estimate.
    Status,
    /// Why.
    Reason,
    /// An effect that the model may lack.
    Effect,
}

impl Vocabulary {
    /// The type's name.
    pub const fn name(self) -> &'static str {
        match self {
            Vocabulary::Status => "Status",
            Vocabulary::Reason => "Reason",
            Vocabulary::Effect => "Effect",
        }
    }
}

impl Kind {
    /// The type's name in `modelDescription.xml`.
    pub const fn name(self) -> &'static str {
        match self {
            Kind::Real => "Real",
            Kind::Integer => "Integer",
            Kind::Boolean => "Boolean",
            Kind::String => "String",
            Kind::Enumeration(_) => "Enumeration",
        }
    }
}

impl Meaning {
    /// The type of the variable.
    pub const fn kind(self) -> Kind {
        match self {
            Meaning::File(_) => Kind::String,
            Meaning::Measured(_) => Kind::Real,
            Meaning::Run | Meaning::Direction => Kind::Integer,
            Meaning::WheelSlide => Kind::Boolean,
            Meaning::Estimate(_, told) => match told {
                Told::Status => Kind::Enumeration(Vocabulary::Status),
                Told::Reason => Kind::Enumeration(Vocabulary::Reason),
                Told::SuspectedEffect => Kind::Enumeration(Vocabulary::Effect),
                Told::Rejected => Kind::Integer,
                _ => Kind::Real,
            },
        }
    }

    /// `parameter`, `input` or `output`.
    pub const fn causality(self) -> &'static str {
        match self {
            Meaning::File(_) => "parameter",
            Meaning::Estimate(..) => "output",
            _ => "input",
        }
    }
}

/// A variable of the FMU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Variable {
    /// Its name, by the structured convention of the standard.
    pub name: &'static str,
    /// What it stands for.
    pub meaning: Meaning,
    /// Its unit.
    pub unit: Unit,
    /// What it is, in words.
    pub description: &'static str,
}

const fn row(
    name: &'static str,
    meaning: Meaning,
    unit: Unit,
    description: &'static str,
) -> Variable {
    Variable { name, meaning, unit, description }
}

const fn measured(
    name: &'static str,
    field: SampleField,
    unit: Unit,
    description: &'static str,
) -> Variable {
    row(name, Meaning::Measured(field), unit, description)
}

const fn told(
    name: &'static str,
    of: PipelineKind,
    told: Told,
    unit: Unit,
    description: &'static str,
) -> Variable {
    row(name, Meaning::Estimate(of, told), unit, description)
}

const STATUS: &str = "What may be done with it: 2 estimated, may be used";
const REASON: &str = "Why the status is what it is";
const REJECTED: &str = "Samples refused so far";
const STD: &str = "Its standard deviation";

/// Every variable, in the order of the value references.
#[rustfmt::skip]
pub const VARIABLES: &[Variable] = &[
    row("train_file", Meaning::File(ModelFile::Train), units::NONE, "Path of the train's file; empty: the one inside the FMU"),
    row("track_file", Meaning::File(ModelFile::Track), units::NONE, "Path of the line's file; empty: the one inside the FMU, if any"),

    measured("position_m", SampleField::Position, units::METRE, "Chainage of the train's centre"),
    measured("speed_mps", SampleField::Speed, units::METRE_PER_SECOND, "Speed, never negative"),
    measured("traction_force_n", SampleField::TractionForce, units::NEWTON, "Traction force at the wheel rims, never negative"),
    measured("brake_force_n", SampleField::BrakeForce, units::NEWTON, "Brake force, retarding, never negative"),
    measured("brake_cylinder_pressure_pa", SampleField::BrakeCylinderPressure, units::PASCAL, "Brake-cylinder pressure"),
    measured("acceleration_mps2", SampleField::Acceleration, units::METRE_PER_SECOND_2, "dv/dt as measured"),
    measured("specific_force_mps2", SampleField::SpecificForce, units::METRE_PER_SECOND_2, "What an accelerometer reads along the track"),
    measured("mass_kg", SampleField::Mass, units::KILOGRAM, "Gross mass without the rotating part"),
    measured("ambient_temperature_degc", SampleField::AmbientTemperature, units::CELSIUS, "Outside temperature"),
    measured("gradient_permille", SampleField::Gradient, units::PERMILLE, "Gradient, climbing positive as the chainage grows; for lines without a file"),
    measured("curve_radius_m", SampleField::CurveRadius, units::METRE, "Curve radius, 0 on straight track; for lines without a file"),
    row("direction", Meaning::Direction, units::NONE, "+1 while the chainage grows in the direction of travel, -1 while it falls"),
    row("wheel_slide", Meaning::WheelSlide, units::NONE, "True while wheel-slide protection is active"),
    row("run", Meaning::Run, units::NONE, "Number of the run (trip); no integral crosses its change"),

    told("resistance.a", RESISTANCE, Told::Value(Parameter::DavisA), units::NEWTON_PER_KILONEWTON, "Davis a"),
    told("resistance.a_std", RESISTANCE, Told::Std(Parameter::DavisA), units::NEWTON_PER_KILONEWTON, STD),
    told("resistance.b", RESISTANCE, Told::Value(Parameter::DavisB), units::DAVIS_B, "Davis b"),
    told("resistance.b_std", RESISTANCE, Told::Std(Parameter::DavisB), units::DAVIS_B, STD),
    told("resistance.c", RESISTANCE, Told::Value(Parameter::DavisC), units::DAVIS_C, "Davis c"),
    told("resistance.c_std", RESISTANCE, Told::Std(Parameter::DavisC), units::DAVIS_C, STD),
    told("resistance.w0", RESISTANCE, Told::Resistance, units::NEWTON_PER_KILONEWTON, "Basic resistance at the speed of the sample"),
    told("resistance.w0_std", RESISTANCE, Told::ResistanceStd, units::NEWTON_PER_KILONEWTON, "Its standard deviation, from the full covariance"),
    told("resistance.status", RESISTANCE, Told::Status, units::NONE, STATUS),
    told("resistance.reason", RESISTANCE, Told::Reason, units::NONE, REASON),
    told("resistance.rejected", RESISTANCE, Told::Rejected, units::NONE, REJECTED),

    told("mass.mass_t", MASS, Told::Value(Parameter::Mass), units::TONNE, "Gross mass"),
    told("mass.mass_t_std", MASS, Told::Std(Parameter::Mass), units::TONNE, STD),
    told("mass.status", MASS, Told::Status, units::NONE, STATUS),
    told("mass.reason", MASS, Told::Reason, units::NONE, REASON),
    told("mass.rejected", MASS, Told::Rejected, units::NONE, REJECTED),

    told("adhesion.adhesion", ADHESION, Told::Value(Parameter::Adhesion), units::NONE, "Adhesion of wheel on rail, where the rail was the limit"),
    told("adhesion.adhesion_std", ADHESION, Told::Std(Parameter::Adhesion), units::NONE, STD),
    told("adhesion.adhesion_lower_bound", ADHESION, Told::Value(Parameter::AdhesionLowerBound), units::NONE, "What the rail carried at least, where the brake was the limit"),
    told("adhesion.adhesion_lower_bound_std", ADHESION, Told::Std(Parameter::AdhesionLowerBound), units::NONE, STD),
    told("adhesion.adhesion_law_scale", ADHESION, Told::Value(Parameter::AdhesionLawScale), units::NONE, "Scale of the known law of adhesion over speed"),
    told("adhesion.adhesion_law_scale_std", ADHESION, Told::Std(Parameter::AdhesionLawScale), units::NONE, STD),
    told("adhesion.status", ADHESION, Told::Status, units::NONE, STATUS),
    told("adhesion.reason", ADHESION, Told::Reason, units::NONE, REASON),
    told("adhesion.rejected", ADHESION, Told::Rejected, units::NONE, REJECTED),

    told("brake_friction.disc_friction", BRAKE, Told::Value(Parameter::DiscFriction), units::NONE, "Friction of the brake discs; needs the pressure and the gear in the train's file"),
    told("brake_friction.disc_friction_std", BRAKE, Told::Std(Parameter::DiscFriction), units::NONE, STD),
    told("brake_friction.status", BRAKE, Told::Status, units::NONE, STATUS),
    told("brake_friction.reason", BRAKE, Told::Reason, units::NONE, REASON),
    told("brake_friction.rejected", BRAKE, Told::Rejected, units::NONE, REJECTED),

    told("monitor.unexplained_force_n", MONITOR, Told::UnexplainedForce, units::NEWTON, "Force that the declared model does not explain, retarding positive"),
    told("monitor.unexplained_force_n_std", MONITOR, Told::UnexplainedForceStd, units::NEWTON, STD),
    told("monitor.suspected_effect", MONITOR, Told::SuspectedEffect, units::NONE, "The effect that the model may lack"),
    told("monitor.status", MONITOR, Told::Status, units::NONE, STATUS),
    told("monitor.reason", MONITOR, Told::Reason, units::NONE, REASON),
    told("monitor.rejected", MONITOR, Told::Rejected, units::NONE, REJECTED),
];

/// Name and type of each variable by its reference, for the hash that two peers compare.
const LAYOUT: [FieldLayout; VARIABLES.len()] = {
    let mut fields = [FieldLayout { name: "", type_name: "", offset: 0, size: 0 }; VARIABLES.len()];
    let mut reference = 0;
    while reference < fields.len() {
        let Variable { name, meaning, .. } = VARIABLES[reference];
        fields[reference] =
            FieldLayout { name, type_name: meaning.kind().name(), offset: reference, size: 0 };
        reference += 1;
    }
    fields
};

const GUID_DIGITS: [u8; 16] =
    hex_digits(layout_hash(concat!("dynocar ", env!("CARGO_PKG_VERSION")), LAYOUT.len(), &LAYOUT));

/// Over the version and the table of variables: `modelDescription.xml` and library of one FMU
/// have the same.
pub const GUID: &str = match core::str::from_utf8(&GUID_DIGITS) {
    Ok(digits) => digits,
    Err(_) => panic!("digits are ASCII"),
};

/// The [`GUID`] as a symbol, so that a library tells its own without being loaded.
#[unsafe(no_mangle)]
pub static DYNOCAR_FMU_GUID: [u8; 16] = GUID_DIGITS;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_says_what_the_variable_stands_for() {
        for variable in VARIABLES {
            let name = variable.name;
            let expected = match variable.meaning {
                Meaning::Estimate(_, Told::Value(parameter)) => parameter.name().to_owned(),
                Meaning::Estimate(_, Told::Std(parameter)) => format!("{}_std", parameter.name()),
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
    fn every_recommended_estimator_tells_status_reason_and_refusals_under_one_name() {
        for kind in PIPELINES {
            let of_kind =
                |it: &&Variable| matches!(it.meaning, Meaning::Estimate(of, _) if of == kind);
            let names: Vec<_> = VARIABLES.iter().filter(of_kind).map(|it| it.name).collect();
            let group = names[0].split('.').next().unwrap();
            for name in &names {
                assert_eq!(name.split('.').next(), Some(group));
            }
            for told in ["status", "reason", "rejected"] {
                assert!(names.contains(&format!("{group}.{told}").as_str()), "{kind}: {told}");
            }
        }
    }

    #[test]
    fn names_are_unique_and_units_known() {
        for (reference, variable) in VARIABLES.iter().enumerate() {
            assert!(VARIABLES[..reference].iter().all(|it| it.name != variable.name));
            assert!(variable.unit == units::NONE || units::ALL.contains(&variable.unit));
        }
    }
}
