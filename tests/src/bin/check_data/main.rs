//! Checks Dynocar against a folder of recorded and simulated data: every dataset loads; the resistance that `dynocar
//! identify` finds is the true one where the truth is known; the forward simulation agrees with other simulators;
//! undeclared effects are found, offline and live; a bus's line is surveyed and predicts trips that took no part in the
//! survey; files of other projects are imported, and their invalid ones refused.
//!
//! `dynocar-check-data FOLDER`, with the folders `practice`, `practice-truth`, `independent`,
//! `measured` and `imports` in it. Exit status 1 when a check fails.

mod bus;
mod bus_variants;
mod explaining;
mod imports;
mod monitor;
mod resistance;
mod simulation;
mod stop_masses;
mod stops;
mod trainruns;
mod truth;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use dynocar::dataset;

/// Prints each outcome and counts it.
#[derive(Default)]
pub struct Report {
    passed: usize,
    failed: usize,
}

impl Report {
    /// Takes down one check.
    pub fn note(&mut self, what: &str, outcome: Result<String, String>) {
        match outcome {
            Ok(detail) => {
                self.passed += 1;
                println!("ok    {what}: {detail}");
            }
            Err(detail) => {
                self.failed += 1;
                println!("FAIL  {what}: {detail}");
            }
        }
    }

    /// Prints the counts; a run without any check has failed.
    pub fn finish(self) -> ExitCode {
        println!("{} passed, {} failed", self.passed, self.failed);
        if self.failed == 0 && self.passed > 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
    }
}

fn main() -> ExitCode {
    let Some(folder) = std::env::args_os().nth(1).map(PathBuf::from) else {
        eprintln!("expected: dynocar-check-data FOLDER");
        return ExitCode::from(2);
    };
    let mut report = Report::default();
    check_loading(&mut report, &folder);
    resistance::check(&mut report, &folder);
    simulation::check(&mut report, &folder);
    trainruns::check(&mut report, &folder.join("independent/trainruns"));
    imports::check(&mut report, &folder);
    explaining::check(&mut report, &folder);
    monitor::check(&mut report, &folder);
    stops::check(&mut report, &folder);
    bus::check(&mut report, &folder.join("measured/ztbus"));
    report.finish()
}

fn check_loading(report: &mut Report, folder: &Path) {
    for path in dataset_folders(folder) {
        let outcome = dataset::load(&path).map(|it| format!("{} runs", it.runs.len()));
        report.note(&format!("{} loads", path.display()), outcome.map_err(|it| it.to_string()));
    }
}

fn dataset_folders(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for group in ["practice", "independent", "measured"] {
        let entries = std::fs::read_dir(folder.join(group)).into_iter().flatten().flatten();
        found.extend(
            entries.map(|entry| entry.path()).filter(|it| it.join("dataset.toml").is_file()),
        );
    }
    found.sort();
    found
}
