//! Diagnostics of a run: likely mistakes, or facts to know before its results are believed, in the units of its
//! columns.

use dynocar_core::plausibility::{DetectedFault, InputFault, Severity};
use dynocar_model::units::Unit;
use dynocar_shared::SampleField;
use serde::{Serialize, Serializer};
use toml::Value;

use super::manifest::Manifest;
use super::quantity::Quantity;
use super::resolved::Resolved;

/// A diagnostic on a run, or on the declaration of a train and its line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{text}")]
pub struct Diagnostic {
    /// The name for machines.
    pub code: &'static str,
    /// How much it matters.
    pub severity: Severity,
    /// Text with figures and the likely reason.
    pub text: String,
    /// The figures, each with its name and unit.
    pub figures: Vec<(&'static str, Value)>,
    /// For samples that cannot be true (a wrong unit, an exchange, a wrong sign): the fault, and the unit in which the
    /// quantity was read.
    pub fault: Option<(DetectedFault, Unit)>,
}

impl Diagnostic {
    /// Something other than a detected fault.
    pub(super) fn new<const N: usize>(
        code: &'static str,
        severity: Severity,
        text: impl Into<String>,
        figures: [(&'static str, Value); N],
    ) -> Self {
        Diagnostic { code, severity, text: text.into(), figures: figures.into(), fault: None }
    }

    /// Returns the diagnostic of a fault of samples in this unit.
    pub(super) fn of_fault(detected: DetectedFault, read_as: Unit) -> Self {
        let fault = detected.fault;
        let (text, unit) = (detected.words(&read_as), read_as.name());
        let factor = detected.factor.into();
        let figures =
            [("fault", fault.name().into()), ("factor", factor), ("read_as", unit.into())];
        let mut diagnostic = Diagnostic::new(fault.name(), fault.severity(), text, figures);
        diagnostic.fault = Some((detected, read_as));
        diagnostic
    }
}

impl Serialize for Diagnostic {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let kind = if self.fault.is_some() { "input_fault" } else { self.code };
        let kind = ("remark", Value::from(kind));
        serializer.collect_map(std::iter::once(&kind).chain(&self.figures).map(|it| (it.0, &it.1)))
    }
}

/// Returns the quantities that an input fault is about, and the unit to report it in where none of them is mapped.
pub(super) fn concerned(fault: InputFault) -> (&'static [Quantity], &'static str) {
    use Quantity::*;
    match fault {
        InputFault::TimeScale => (&[Time], "s"),
        InputFault::SpeedScale => (&[Speed], "m/s"),
        InputFault::PositionScale | InputFault::DirectionReversed => (&[Position], "m"),
        InputFault::MassScale => (&[TrainMass], "t"),
        InputFault::BrakeScale => (&[BrakeForce, ControlForce], "kN"),
        InputFault::ForcesSwapped | InputFault::ForcesScale | InputFault::TractionScale => {
            (&[TractionForce, BrakeForce, ControlForce], "kN")
        }
        InputFault::GradientSign | InputFault::GradientScale => (&[Gradient], "permille"),
        InputFault::PressureScale => (&[BrakeCylinderPressure], "Pa"),
    }
}

/// Returns the unit in which the manifest reads the quantity of a fault.
pub(super) fn read_as(manifest: &Manifest, fault: InputFault) -> Unit {
    let (quantities, otherwise) = concerned(fault);
    let mapped = quantities.iter().find_map(|&quantity| manifest.mapping(quantity));
    let name = mapped.map_or(otherwise, |mapping| mapping.unit.name());
    let dimension = fault.dimension();
    Unit::find(dimension, name).unwrap_or_else(|| Unit::base_of(dimension))
}

/// The bounds of the sample, beyond which validation refuses it, and of places on the earth.
const PLAUSIBLE: [(Quantity, (f64, f64)); 7] = [
    (Quantity::Acceleration, SampleField::Acceleration.range()),
    (Quantity::SpecificForce, SampleField::SpecificForce.range()),
    (Quantity::BrakeCylinderPressure, SampleField::BrakeCylinderPressure.range()),
    (Quantity::AmbientTemperature, SampleField::AmbientTemperature.range()),
    (Quantity::Gradient, SampleField::Gradient.range()),
    (Quantity::Latitude, (-90.0, 90.0)),
    (Quantity::Longitude, (-180.0, 180.0)),
];

/// Returns a diagnostic for each column with values that are refused.
pub(super) fn implausible_columns(run: &Resolved) -> Vec<Diagnostic> {
    let mut diagnostics = Vec::new();
    for (quantity, (low, high)) in PLAUSIBLE {
        let Some(column) = run.table.column(quantity) else { continue };
        let is_outside = |value: &&f64| !value.is_nan() && !(low..=high).contains(*value);
        let count = column.iter().filter(is_outside).count();
        if count > 0 {
            let unit = quantity.unit().name();
            let text = format!(
                "{quantity} lies outside {low} to {high} {unit} in {count} rows, and those samples \
                 are refused: is the unit right?"
            );
            let figures = [
                ("quantity", quantity.name().into()),
                ("count", Value::Integer(count as i64)),
                ("low", low.into()),
                ("high", high.into()),
                ("unit", unit.into()),
            ];
            diagnostics.push(Diagnostic::new("implausible", Severity::Warning, text, figures));
        }
    }
    diagnostics
}
