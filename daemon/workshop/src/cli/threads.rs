//! `--threads`: the number of cores on which a command works. The answer does not depend on it.

use clap::Args;
use rayon::ThreadPoolBuilder;

use dynocar::cli::Failure;

/// Greatest number of threads: more than any machine has cores.
const THREADS_MAX: usize = 1024;

/// On how many cores to work.
#[derive(Clone, Copy, Debug, Args)]
pub struct Threads {
    /// Work on this many cores, else on all; the answer is the same
    #[arg(long = "threads", value_name = "N", value_parser = count)]
    pub(super) count: Option<usize>,
}

/// Returns a number of threads.
fn count(text: &str) -> Result<usize, String> {
    let count = text.parse().ok().filter(|count| (1..=THREADS_MAX).contains(count));
    count.ok_or_else(|| format!("expected a whole number of threads from 1 to {THREADS_MAX}"))
}

impl Threads {
    /// Returns one core where no number is given: such a command runs while a daemon serves trains.
    pub fn or_one(self) -> Self {
        Threads { count: self.count.or(Some(1)) }
    }

    /// Does some work on that many threads.
    ///
    /// # Errors
    ///
    /// When the system does not give them.
    pub fn work<T: Send>(self, work: impl FnOnce() -> T + Send) -> Result<T, Failure> {
        let Some(count) = self.count else { return Ok(work()) };
        let threads = ThreadPoolBuilder::new().num_threads(count).build();
        let threads = threads
            .map_err(|error| Failure::Work(format!("cannot start {count} threads: {error}")))?;
        Ok(threads.install(work))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_of_threads_is_whole_and_at_least_one() {
        assert_eq!(count("3"), Ok(3));
        for wrong in ["0", "-1", "two", "1.5", "", "4096"] {
            let refusal = count(wrong).unwrap_err();
            assert_eq!(refusal, "expected a whole number of threads from 1 to 1024", "{wrong}");
        }
    }
}
