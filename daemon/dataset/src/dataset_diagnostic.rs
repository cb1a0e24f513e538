//! Diagnostics to know before results from a dataset are believed, each once.

use dynocar_core::plausibility::window_balance::WindowBalance;
use dynocar_core::plausibility::{DetectedFault, Severity, gradient_fault};
use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;
use dynocar_model::units::Unit;
use serde::Serialize;

use super::Dataset;
use super::declared::misdeclared;
use super::diagnostic::Diagnostic;
use super::run::Run;

/// A diagnostic on a dataset.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DatasetDiagnostic {
    /// Its name for machines.
    pub code: &'static str,
    /// How much it matters.
    pub severity: Severity,
    /// The files of the runs it is about; empty when it is about the train or the line.
    pub runs: Vec<String>,
    /// Text with figures and the likely input fault.
    pub text: String,
}

impl std::fmt::Display for DatasetDiagnostic {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.runs[..] {
            [] => f.write_str(&self.text),
            [run] => write!(f, "{run}: {}", self.text),
            [first, .., last] => {
                write!(f, "{first} … {last} ({} runs): {}", self.runs.len(), self.text)
            }
        }
    }
}

impl Dataset {
    /// Returns the diagnostics that may spoil results from these runs, the worst first.
    pub fn diagnostics(&self) -> Vec<DatasetDiagnostic> {
        diagnostics(&self.train, self.track.as_deref(), &self.runs)
    }
}

/// Returns the diagnostics that may spoil results from runs of a train on a line, the worst first.
pub fn diagnostics<'r>(
    train: &TrainModel,
    track: Option<&Track>,
    runs: impl IntoIterator<Item = &'r Run>,
) -> Vec<DatasetDiagnostic> {
    let of = |runs, it: &Diagnostic| DatasetDiagnostic {
        code: it.code,
        severity: it.severity,
        runs,
        text: it.text.clone(),
    };
    let of_declared = misdeclared(train, track);
    let mut diagnostics: Vec<_> = of_declared.iter().map(|it| of(Vec::new(), it)).collect();
    // The factors of an input fault that several runs share, from the lowest to the highest.
    let mut faults: Vec<(usize, DetectedFault, Unit, (f64, f64))> = Vec::new();
    let mut all = AllRuns::default();
    for run in runs {
        all.push(run);
        for diagnostic in run.diagnostics.iter().filter(|it| it.severity > Severity::Info) {
            let known = match diagnostic.fault {
                Some((detected, read_as)) => {
                    let known = faults.iter_mut().find(|(_, other, unit, (low, _))| {
                        other.fault == detected.fault
                            && *unit == read_as
                            && (*low < 1.0) == (detected.factor < 1.0)
                    });
                    known.map(|(index, .., range)| {
                        *range = (range.0.min(detected.factor), range.1.max(detected.factor));
                        *index
                    })
                }
                None => diagnostics.iter().position(|other: &DatasetDiagnostic| {
                    let is_of_runs = other.code == diagnostic.code && !other.runs.is_empty();
                    is_of_runs && other.text == diagnostic.text
                }),
            };
            match known {
                Some(index) => diagnostics[index].runs.push(run.file.clone()),
                None => {
                    if let Some((detected, read_as)) = diagnostic.fault {
                        let range = (detected.factor, detected.factor);
                        faults.push((diagnostics.len(), detected, read_as, range));
                    }
                    diagnostics.push(of(vec![run.file.clone()], diagnostic));
                }
            }
        }
    }
    for (index, detected, read_as, range) in faults {
        diagnostics[index].text = detected.words_for(range, &read_as);
    }
    diagnostics.extend(all.gradient_scale());
    diagnostics.sort_by_key(|diagnostic| std::cmp::Reverse(diagnostic.severity));
    diagnostics
}

/// Sums over all runs: together they show faults that each is too short to show, as one from stop to stop.
#[derive(Default)]
struct AllRuns {
    balance: Option<(WindowBalance, Unit)>,
    files: Vec<String>,
    has_fault: bool,
}

impl AllRuns {
    fn push(&mut self, run: &Run) {
        let of_all = || (WindowBalance::of_all(), run.gradient_unit);
        self.balance.get_or_insert_with(of_all).0.add(&run.balance);
        self.files.push(run.file.clone());
        self.has_fault |= run.diagnostics.iter().any(|it| it.fault.is_some());
    }

    /// Returns that the gradients are in another unit, where no run shows a fault by itself.
    fn gradient_scale(self) -> Option<DatasetDiagnostic> {
        let (balance, read_as) = self.balance.filter(|_| !self.has_fault)?;
        let found = Diagnostic::of_fault(gradient_fault(&balance)?, read_as);
        let Diagnostic { code, severity, text, .. } = found;
        Some(DatasetDiagnostic { code, severity, runs: self.files, text })
    }
}
