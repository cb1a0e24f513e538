//! Names of files within a simulated dataset.

/// Name of a run's file, by the run's number from 0.
pub fn run_file(number: usize) -> String {
    format!("runs/{:02}.csv", number + 1)
}
