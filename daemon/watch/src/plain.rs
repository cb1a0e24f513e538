//! Lines where there is no terminal: one a second for each train.

use std::io::{ErrorKind, IsTerminal, Write};
use std::time::{Duration, Instant};

use dynocar::cli::Failure;
use dynocar::ending::ProgramEnding;
use dynocar::output::OutputError;
use dynocar::redrawn::is_utf8;

use crate::state::TrainState;
use crate::watcher::Watcher;
use crate::words::{daemon, residual, rows, samples};

/// Time between two polls for snapshots.
const POLL_EVERY: Duration = Duration::from_millis(100);
/// Time between two writings.
const WRITE_EVERY: Duration = Duration::from_secs(1);

/// Writes lines until the program is to end, or until nobody reads them any more.
///
/// # Errors
///
/// When standard output cannot be written.
pub fn run(watcher: &mut Watcher, ending: &ProgramEnding) -> Result<(), Failure> {
    // The first poll takes the snapshots that are there; a heartbeat brings them.
    let mut next = Instant::now() + WRITE_EVERY / 2;
    while !ending.is_due() {
        watcher.look();
        if Instant::now() >= next {
            next += WRITE_EVERY;
            let mut text: String =
                watcher.trains().into_iter().map(|train| line(train) + "\n").collect();
            if text.is_empty() {
                text = format!("no daemon serves any train under {}\n", watcher.place());
            }
            if std::io::stdout().is_terminal() && !is_utf8() {
                text = in_ascii(&text);
            }
            let mut output = std::io::stdout().lock();
            match output.write_all(text.as_bytes()).and_then(|()| output.flush()) {
                Err(error)
                    if error.kind() == ErrorKind::BrokenPipe || ending.is_terminal_gone() =>
                {
                    return Ok(());
                }
                Err(error) => return Err(OutputError::StandardOutput(error).into()),
                Ok(()) => {}
            }
        }
        std::thread::sleep(POLL_EVERY);
    }
    Ok(())
}

/// Returns the text for a terminal that knows no other letters.
fn in_ascii(text: &str) -> String {
    let letters =
        text.replace('±', "+-").replace('…', "...").replace('‰', "o/oo").replace('²', "2");
    letters.chars().map(|it| if it.is_ascii() { it } else { '?' }).collect()
}

/// Returns a train in a line.
pub fn line(train: &TrainState) -> String {
    let mut parts = vec![daemon(&train.daemon, None)];
    for row in rows(train, &[0.5]) {
        let words = [row.label.trim(), &row.number, &row.interval, row.unit];
        let value = words.into_iter().filter(|it| !it.is_empty()).collect::<Vec<_>>().join(" ");
        let state = match row.use_state {
            Some(state) if row.why.is_empty() => format!(" {state}"),
            Some(state) => format!(" {state} ({})", row.why),
            None => String::new(),
        };
        parts.push(value + &state);
    }
    if !train.pipelines.is_empty() {
        parts.extend(
            residual(train)
                .map(|(force, suspect)| format!("unexplained {force}, suspect {suspect}")),
        );
        parts.push(samples(train));
        parts.extend(train.advice.first().map(|advice| format!("next: {advice}")));
    }
    format!("train {}: {}", train.id, parts.join("; "))
}
