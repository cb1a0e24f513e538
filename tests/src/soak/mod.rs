//! Seeded faults and checks that tests run for seconds and `dynocar-soak` runs for hours.
//!
//! A failed check panics with the seed and round that reproduce it.
//!
//! # Layout
//!
//! - [`arguments`]: the command line of `dynocar-soak`
//! - [`bad_samples`]: every pipeline under every failure of its sensors
//! - [`day`]: eight trains for a day in accelerated time, with a disturbance in each quarter of an hour
//! - [`faults`]: kills, stops and restarts of daemon, controller and client
//! - [`hostile`]: garbage written into shared memory
//! - [`load`]: eight trains for hours, with faults
//! - [`months`]: months of one train: learning, trying, adopting, taking back
//! - [`starts`]: `kill -9` of daemon, controller and client while they start
//! - [`state_kills`]: `kill -9` while a state file is written

pub mod arguments;
pub mod bad_samples;
pub mod day;
pub mod faults;
pub mod hostile;
pub mod load;
pub mod months;
pub mod starts;
pub mod state_kills;

use std::path::{Path, PathBuf};

/// The programs that the checks start.
#[derive(Clone, Debug)]
pub struct Programs {
    /// `dynocar-under-test`.
    pub dynocar: PathBuf,
    /// `dynocar-test-peer`.
    pub peer: PathBuf,
}

impl Programs {
    /// Returns the programs in the folder of another one of them.
    pub fn beside(program: &Path) -> Self {
        let folder = program.parent().unwrap_or(Path::new("."));
        Programs {
            dynocar: folder.join("dynocar-under-test"),
            peer: folder.join("dynocar-test-peer"),
        }
    }
}
