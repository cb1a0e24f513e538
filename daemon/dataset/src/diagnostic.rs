//! Diagnostics of a run: likely mistakes, or facts to know before its results are believed, in the units of its
//! columns; and resistances that no train has, with the unit that they may be in.

use dynocar_core::plausibility::{DetectedFault, InputFault, Severity};
use dynocar_model::train::Davis;
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
        InputFault::ForcesSwapped
        | InputFault::ForcesScale
        | InputFault::TractionScale
        | InputFault::ForcesStale => (&[TractionForce, BrakeForce, ControlForce], "kN"),
        InputFault::GradientSign | InputFault::GradientScale | InputFault::GradientAlongTravel => {
            (&[Gradient], "permille")
        }
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

/// Basic resistances in N/kN that trains have at rest, and at their greatest speed; a declared 0 does not count.
const USUAL_AT_REST_N_PER_KN: (f64, f64) = (0.2, 15.0);
const USUAL_AT_TOP_N_PER_KN: (f64, f64) = (0.5, 60.0);

/// Describes an unusual resistance in N/kN up to a greatest speed in m/s, with the likely unit; `None` for one that
/// trains have.
pub fn unusual_resistance(davis: &Davis, top_mps: f64) -> Option<String> {
    let is_outside =
        |value: f64, (low, high): (f64, f64)| value != 0.0 && !(low..=high).contains(&value);
    let times = |what: &str, value: f64, usual: (f64, f64), units: &[(f64, &str)]| {
        let fits = |(factor, _): &&(f64, &str)| (usual.0..=usual.1).contains(&(factor * value));
        let likely = units.iter().find(fits).map_or(String::new(), |(factor, unit)| {
            format!(": {unit}? Then it is {:.2} N/kN", factor * value)
        });
        format!("{value:.2e} N/kN {what}, where trains have {} to {}{likely}", usual.0, usual.1)
    };
    if is_outside(davis.a, USUAL_AT_REST_N_PER_KN) {
        let units = [
            (1e3, "is a in kN where b and c are in N"),
            (1e-3, "is a in N for each t of weight"),
            (1.0 / 9.80665, "is a in N for each kN and a mass in t"),
        ];
        return Some(times("at rest", davis.a, USUAL_AT_REST_N_PER_KN, &units));
    }
    let top = davis.w0_n_per_kn(top_mps);
    let by_kmh = Davis { b: davis.b / 3.6, c: davis.c / 12.96, ..*davis }.w0_n_per_kn(top_mps);
    let units = [
        (by_kmh / top, "are b and c for v in km/h"),
        (1e3, "are b and c in kN where a is in N"),
        (1e-3, "are b and c for the whole train"),
    ];
    let what = format!("at {top_mps:.0} m/s");
    is_outside(top, USUAL_AT_TOP_N_PER_KN).then(|| times(&what, top, USUAL_AT_TOP_N_PER_KN, &units))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unusual_resistance_is_named_with_the_likely_unit() {
        let words = |a, b, c| unusual_resistance(&Davis { a, b, c }, 30.0);
        assert_eq!(words(1.5, 0.015, 0.0009), None);
        assert_eq!(words(0.0, 0.0, 0.0), None, "none is declared");
        assert_eq!(words(0.0, 0.02, 0.0009), None);
        let in_kn = words(0.00122, 0.015, 0.0009).unwrap();
        assert!(in_kn.contains("a in kN") && in_kn.contains("1.22 N/kN"), "{in_kn}");
        let by_kmh = words(1.5, 0.2, 0.09).unwrap();
        assert!(by_kmh.contains("at 30 m/s") && by_kmh.contains("km/h"), "{by_kmh}");
        let each_t = words(1500.0, 0.015, 0.0009).unwrap();
        assert!(each_t.contains("each t"), "{each_t}");
    }
}
