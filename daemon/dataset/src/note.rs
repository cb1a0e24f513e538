//! What is to be known before results from a dataset are believed, each thing once.

use dynocar_core::plausibility::{Finding, Severity};
use dynocar_core::track::Track;
use dynocar_core::train::TrainModel;
use serde::Serialize;

use super::Dataset;
use super::declared::misdeclared;
use super::diagnostic::Diagnostic;
use super::finding_unit::unit_of;
use super::run::Run;

/// A note on a dataset.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Note {
    /// Its name for machines.
    pub code: &'static str,
    /// How much it matters.
    pub severity: Severity,
    /// The files of the runs it is about; empty when it is about the train or the line.
    pub runs: Vec<String>,
    /// What it is, with figures and the likely input fault.
    pub text: String,
}

impl std::fmt::Display for Note {
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
    /// What may spoil results from these runs, the worst first.
    pub fn notes(&self) -> Vec<Note> {
        notes(&self.train, self.track.as_deref(), &self.runs)
    }
}

/// What may spoil results from runs of a train on a line, the worst first.
pub fn notes<'r>(
    train: &TrainModel,
    track: Option<&Track>,
    runs: impl IntoIterator<Item = &'r Run>,
) -> Vec<Note> {
    let of_declared = misdeclared(train, track).into_iter();
    let mut notes: Vec<Note> = of_declared
        .map(|it| Note { code: it.code, severity: it.severity, runs: Vec::new(), text: it.text })
        .collect();
    // The factors of an input fault that several runs share, from the lowest to the highest.
    let mut faults: Vec<(usize, Finding, &'static str, (f64, f64))> = Vec::new();
    for run in runs {
        for remark in run.remarks.iter().filter(|it| it.severity() > Severity::Info) {
            let same = |note: &Note| note.code == remark.code() && !note.runs.is_empty();
            let known = match remark {
                Diagnostic::InputFault { finding, read_as } => {
                    let known = faults.iter_mut().find(|(_, other, unit, (low, _))| {
                        other.fault == finding.fault
                            && unit == read_as
                            && (*low < 1.0) == (finding.factor < 1.0)
                    });
                    known.map(|(place, .., range)| {
                        *range = (range.0.min(finding.factor), range.1.max(finding.factor));
                        *place
                    })
                }
                other => notes.iter().position(|note| same(note) && note.text == other.to_string()),
            };
            match known {
                Some(place) => notes[place].runs.push(run.file.clone()),
                None => {
                    if let Diagnostic::InputFault { finding, read_as } = remark {
                        let range = (finding.factor, finding.factor);
                        faults.push((notes.len(), *finding, read_as, range));
                    }
                    let (code, severity) = (remark.code(), remark.severity());
                    let (runs, text) = (vec![run.file.clone()], remark.to_string());
                    notes.push(Note { code, severity, runs, text });
                }
            }
        }
    }
    for (place, finding, read_as, range) in faults {
        notes[place].text = finding.words_for(range, &unit_of(finding, read_as));
    }
    notes.sort_by_key(|note| std::cmp::Reverse(note.severity));
    notes
}
