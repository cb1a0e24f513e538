//! Variables of an FMU. Each model has a table of them, which determines both `modelDescription.xml` and the values
//! that are set and got. A variable's value reference is its index in the table. Units are in the SI's base units.

use dynocar_analysis::driven::ForcePart;
use dynocar_shared::layout::{FieldLayout, hex_digits, layout_hash};
use dynocar_shared::{Parameter, PipelineKind, Quantity, SampleField};

use crate::error::ModelError;

/// One of the models in the library, as a simulator sees it.
#[derive(Clone, Copy, Debug)]
pub struct Interface {
    /// The standard's model identifier, which is also the name of the library inside the FMU.
    pub identifier: &'static str,
    /// Its name for people.
    pub name: &'static str,
    /// Purpose of the model, in a sentence without a full stop.
    pub about: &'static str,
    /// Inputs and outputs of a step, in sentences.
    pub step: &'static str,
    /// Identifier that description and library of one FMU share.
    pub guid: &'static str,
    /// Every variable, in the order of the value references.
    pub variables: &'static [Variable],
    /// Whether it takes the slope of an input within a step.
    pub takes_slopes: bool,
}

/// A measured input of this value is missing, as is one that is NaN; unconnected inputs start with it. Modelica knows
/// no NaN.
pub const MISSING: f64 = 1e30;

impl Interface {
    /// Returns the variable of a reference and a type; enumerations are got and set as whole numbers.
    ///
    /// # Errors
    ///
    /// If there is no such variable.
    pub fn variable(
        &self,
        reference: u32,
        expected: Kind,
    ) -> Result<&'static Variable, ModelError> {
        let variable = self.variables.get(reference as usize);
        let variable = variable.ok_or(ModelError::UnknownReference(reference))?;
        let is = match variable.meaning.kind() {
            Kind::Enumeration(_) => Kind::Integer,
            kind => kind,
        };
        if is == expected {
            return Ok(variable);
        }
        let (name, expected) = (variable.name, expected.name());
        Err(ModelError::WrongType { name, is: is.name(), expected })
    }
}

/// A file that describes the declaration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModelFile {
    /// The train's.
    Train,
    /// The line's.
    Track,
}

/// Reported field of an estimator's snapshot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SnapshotField {
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
    /// The suspected missing effect, by its number, as an integer: some hosts drop enumerations.
    SuspectedEffectNumber,
    /// The status likewise.
    StatusNumber,
    /// The reason likewise.
    ReasonNumber,
    /// Whether the values of this quantity may be used.
    Usable(Quantity),
    /// How many samples were refused.
    Rejected,
}

/// How the driven train begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Begins {
    /// Its speed.
    Speed,
    /// Its chainage.
    Position,
    /// Whether a brake holds it while it stands and is not pulled.
    HeldAtRest,
}

/// Values of the driven train's motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DrivenValue {
    /// True speed.
    Speed,
    /// Speed as the train's own sensor shows it.
    MeasuredSpeed,
    /// Chainage of its centre.
    Position,
    /// dv/dt.
    Acceleration,
    /// Gross mass.
    Mass,
    /// A force on it.
    Force(ForcePart),
    /// All that resists.
    Resistance,
}

/// Meaning of a variable.
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
    /// Output: an estimator's result.
    Estimate(PipelineKind, SnapshotField),
    /// Parameter: how the driven train begins.
    Begins(Begins),
    /// Output: a value of the driven train's motion.
    Driven(DrivenValue),
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
    Enumeration(FmiEnumeration),
}

/// A vocabulary of the project that is an enumeration of the FMU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FmiEnumeration {
    /// Status of the estimate.
    Status,
    /// Why.
    Reason,
    /// An effect that the model may lack.
    Effect,
}

impl FmiEnumeration {
    /// Returns the type's name.
    pub const fn name(self) -> &'static str {
        match self {
            FmiEnumeration::Status => "Status",
            FmiEnumeration::Reason => "Reason",
            FmiEnumeration::Effect => "Effect",
        }
    }
}

impl Kind {
    /// Returns the type's name in `modelDescription.xml`.
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
    /// Returns the type of the variable.
    pub const fn kind(self) -> Kind {
        match self {
            Meaning::File(_) => Kind::String,
            Meaning::Measured(_) => Kind::Real,
            Meaning::Run | Meaning::Direction => Kind::Integer,
            Meaning::WheelSlide | Meaning::Begins(Begins::HeldAtRest) => Kind::Boolean,
            Meaning::Begins(_) | Meaning::Driven(_) => Kind::Real,
            Meaning::Estimate(_, reported) => match reported {
                SnapshotField::Status => Kind::Enumeration(FmiEnumeration::Status),
                SnapshotField::Reason => Kind::Enumeration(FmiEnumeration::Reason),
                SnapshotField::SuspectedEffect => Kind::Enumeration(FmiEnumeration::Effect),
                SnapshotField::Usable(_) => Kind::Boolean,
                SnapshotField::Rejected
                | SnapshotField::SuspectedEffectNumber
                | SnapshotField::StatusNumber
                | SnapshotField::ReasonNumber => Kind::Integer,
                _ => Kind::Real,
            },
        }
    }

    /// `parameter`, `input` or `output`.
    pub const fn causality(self) -> &'static str {
        match self {
            Meaning::File(_) | Meaning::Begins(_) => "parameter",
            Meaning::Estimate(..) | Meaning::Driven(_) => "output",
            _ => "input",
        }
    }
}

/// A variable of the FMU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Variable {
    /// Its name, by the structured convention of the standard.
    pub name: &'static str,
    /// Meaning of the variable.
    pub meaning: Meaning,
    /// Its unit.
    pub unit: FmiUnit,
    /// Description in words.
    pub description: &'static str,
}

/// Returns a variable.
pub(crate) const fn row(
    name: &'static str,
    meaning: Meaning,
    unit: FmiUnit,
    description: &'static str,
) -> Variable {
    Variable { name, meaning, unit, description }
}

/// Returns an input that the sample of a step takes.
pub(crate) const fn measured(
    name: &'static str,
    field: SampleField,
    unit: FmiUnit,
    description: &'static str,
) -> Variable {
    row(name, Meaning::Measured(field), unit, description)
}

/// Returns the digits by which description and library know each other: over the version, the model's
/// identifier and its table of `N` variables.
pub(crate) const fn guid<const N: usize>(identifier: &str, variables: &[Variable]) -> [u8; 16] {
    let mut fields = [FieldLayout { name: "", type_name: "", offset: 0, size: 0 }; N];
    let mut reference = 0;
    while reference < N {
        let Variable { name, meaning, .. } = variables[reference];
        fields[reference] =
            FieldLayout { name, type_name: meaning.kind().name(), offset: reference, size: 0 };
        reference += 1;
    }
    hex_digits(layout_hash(identifier, N, &fields))
}

/// Digits as a text.
pub(crate) const fn digits(digits: &[u8; 16]) -> &str {
    match core::str::from_utf8(digits) {
        Ok(digits) => digits,
        Err(_) => panic!("digits are ASCII"),
    }
}

/// A unit and its expression in base units, as the attributes of `BaseUnit`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FmiUnit {
    /// Its name; empty for a number without a unit.
    pub name: &'static str,
    /// Exponents of the base units, factor and offset.
    pub base: &'static str,
}

impl FmiUnit {
    const fn new(name: &'static str, base: &'static str) -> Self {
        FmiUnit { name, base }
    }
}

/// A number without a unit.
pub const NONE: FmiUnit = FmiUnit::new("", "");
/// Length.
pub const METRE: FmiUnit = FmiUnit::new("m", r#"m="1""#);
/// Speed.
pub const METRE_PER_SECOND: FmiUnit = FmiUnit::new("m/s", r#"m="1" s="-1""#);
/// Acceleration.
pub const METRE_PER_SECOND_2: FmiUnit = FmiUnit::new("m/s2", r#"m="1" s="-2""#);
/// Force.
pub const NEWTON: FmiUnit = FmiUnit::new("N", r#"kg="1" m="1" s="-2""#);
/// Pressure.
pub const PASCAL: FmiUnit = FmiUnit::new("Pa", r#"kg="1" m="-1" s="-2""#);
/// Mass.
pub const KILOGRAM: FmiUnit = FmiUnit::new("kg", r#"kg="1""#);
/// Mass, 1000 kg.
pub const TONNE: FmiUnit = FmiUnit::new("t", r#"kg="1" factor="1000""#);
/// Temperature.
pub const CELSIUS: FmiUnit = FmiUnit::new("degC", r#"K="1" offset="273.15""#);
/// Gradient, m of height per km.
pub const PERMILLE: FmiUnit = FmiUnit::new("permille", r#"factor="0.001""#);
/// Davis a, and resistance per weight.
pub const NEWTON_PER_KILONEWTON: FmiUnit = FmiUnit::new("N/kN", r#"factor="0.001""#);
/// Davis b.
pub const DAVIS_B: FmiUnit = FmiUnit::new("N.s/(kN.m)", r#"m="-1" s="1" factor="0.001""#);
/// Davis c.
pub const DAVIS_C: FmiUnit = FmiUnit::new("N.s2/(kN.m2)", r#"m="-2" s="2" factor="0.001""#);

/// Every unit that has a name.
pub const ALL: [FmiUnit; 12] = [
    METRE,
    METRE_PER_SECOND,
    METRE_PER_SECOND_2,
    NEWTON,
    PASCAL,
    KILOGRAM,
    TONNE,
    CELSIUS,
    PERMILLE,
    NEWTON_PER_KILONEWTON,
    DAVIS_B,
    DAVIS_C,
];
