//! `kill -9` while a state file is written: at any moment, a whole state is there.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use dynocar::stamp::Stamp;
use dynocar::state::entry::{ModelKey, StateContent, StoredEstimate};
use dynocar::state::file;
use dynocar_core::pipeline::KeptEstimate;
use dynocar_shared::Parameter;
use rand::{RngExt, SeedableRng};

/// The file that the writer replaces for ever, in its folder.
const FILE: &str = "train-1.state";
/// The writer is killed within this many µs of its first sign of life.
const KILLED_WITHIN_US: u64 = 8_000;

/// Returns a state that shows its number: every value holds it.
fn numbered(number: u64) -> StateContent {
    // Lengths differ, so that a file mixed from two would show.
    let estimate = |pipeline: u64| StoredEstimate {
        train: 1,
        pipeline: format!("pipeline_{pipeline}"),
        settings: pipeline,
        estimated: Stamp { unix_s: number as f64, since_boot: None },
        estimate: KeptEstimate::new(&[Parameter::Mass], &[number as f64], &[1.0])
            .expect("a sound estimate"),
    };
    StateContent {
        key: ModelKey { train: 1, wheel_set: String::new(), model: 1 },
        estimates: (0..1 + number % 17).map(estimate).collect(),
    }
}

/// Replaces the state for ever, with numbers counting up from the one that is there.
///
/// # Panics
///
/// When the state cannot be read or written.
pub fn write_for_ever(folder: &Path) {
    let path = folder.join(FILE);
    let mut number = read_number(&path).expect("a readable state").unwrap_or(0);
    loop {
        number += 1;
        let text = numbered(number).to_text().expect("text");
        file::replace(&path, &text).expect("the state to be replaced");
    }
}

/// Returns the number of the state in a file; `None` when there is none yet.
fn read_number(path: &Path) -> Result<Option<u64>, String> {
    let Some(text) = file::read(path).map_err(|error| error.to_string())? else { return Ok(None) };
    let content = StateContent::from_text(path, &text).map_err(|error| error.to_string())?;
    let number = content.estimates[0].estimated.unix_s as u64;
    if content == numbered(number) {
        Ok(Some(number))
    } else {
        Err(format!("a mixture of states: {content:?}"))
    }
}

/// Kills the writer (`test_peer state-writer FOLDER`) at random moments; gives the number of
/// states written over all rounds.
///
/// # Panics
///
/// When a state cannot be read after a kill, or is older than one read before.
pub fn kill_writers(peer: &Path, rounds: u64, seed: u64) -> u64 {
    let folder = tempfile::tempdir().expect("a temporary directory");
    let path = folder.path().join(FILE);
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let mut newest = 0;
    for round in 1..=rounds {
        let mut writer = Command::new(peer)
            .arg("state-writer")
            .arg(folder.path())
            .stdout(Stdio::null())
            .spawn()
            .expect("the writer to start");
        crate::process::await_true(
            || read_number(&path).ok().flatten().is_some_and(|number| number > newest),
            || format!("a first state in round {round} of seed {seed}"),
        );
        std::thread::sleep(Duration::from_micros(random.random_range(0..KILLED_WITHIN_US)));
        writer.kill().expect("the writer to be there");
        writer.wait().expect("an exit status");
        let number = match read_number(&path) {
            Ok(Some(number)) => number,
            other => panic!("round {round} of seed {seed}: unreadable state: {other:?}"),
        };
        assert!(number >= newest, "round {round} of seed {seed}: {number} after {newest}");
        newest = number;
    }
    newest
}
