//! What looks like a mistake in a run, or should be known before its results are believed.

use dynocar_core::plausibility::{DetectedFault, Severity};
use dynocar_model::units::Unit;
use serde::{Serialize, Serializer};
use toml::Value;

/// A diagnostic on a run, or on what is declared of a train and its line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{text}")]
pub struct Diagnostic {
    /// The name for machines.
    pub code: &'static str,
    /// How much it matters.
    pub severity: Severity,
    /// What it is, with figures and the likely reason.
    pub text: String,
    /// The figures, each with its name and unit.
    pub figures: Vec<(&'static str, Value)>,
    /// Of samples that cannot be true (a wrong unit, an exchange, a wrong sign): what it is, and the unit that
    /// the quantity was read in.
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

    /// What cannot be true of samples in this unit.
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
