//! Passed and failed checks.

use std::process::ExitCode;

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
