//! The command line of `dynocar watch`: the screen on a terminal, with its keys, a terminal that is restored at the
//! end, and a terminal that is gone or takes no more output; else lines, one a second for each train.

use std::io;
use std::io::{ErrorKind, IsTerminal, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use clap::{CommandFactory, Parser};
use crossterm::event::{self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use crossterm::terminal::disable_raw_mode;
use dynocar::cli::{Failure, carry_out};
use dynocar::config::DaemonConfig;
use dynocar::ending::ProgramEnding;
use dynocar::observing::ObservedSelection;
use dynocar::output::{OutputError, can_draw, is_utf8};
use dynocar_shared::TrainId;
use ratatui::DefaultTerminal;

use crate::screen::{Palette, ScreenChoice, ScreenView, draw};
use crate::state::TrainState;
use crate::watcher::Watcher;
use crate::words::{daemon, residual, rows, samples};

/// Show in the terminal the estimates of a train, and which manoeuvre to drive next.
///
/// Quantities with 95 % intervals, residual and suspect, samples used, refused and lost. Without options
/// it shows all trains that any daemon of this host serves. Where standard output is no terminal it
/// writes a line a second for each train. NO_COLOR is respected; ? shows the keys.
#[derive(Debug, Parser)]
#[command(name = "dynocar watch", bin_name = "dynocar watch", version)]
struct Arguments {
    /// The daemon's configuration: its root, its trains and their declarations; the next manoeuvre is computed within
    /// the limits declared there
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Only this train; may be given several times
    #[arg(long = "train", value_name = "ID")]
    trains: Vec<u64>,
    /// A line a second for each train, on a terminal too; so it is where TERM is dumb or the locale is not of UTF-8
    #[arg(long)]
    plain: bool,
}

/// Returns the command line of `dynocar watch`.
pub fn command() -> clap::Command {
    Arguments::command()
}

/// Parses the command line, watches until asked to end, reports a failure on standard error.
pub fn main() -> ExitCode {
    carry_out("dynocar watch", execute)
}

fn execute(arguments: &Arguments) -> Result<(), Failure> {
    let config = arguments.config.as_deref().map(DaemonConfig::load).transpose()?;
    let trains = wanted(arguments, config.as_ref())?;
    let host = DaemonConfig::host_of(config.as_ref()).map_err(Failure::work)?;
    let ending = ProgramEnding::begin().map_err(Failure::work)?;
    end_though_stuck(Arc::clone(&ending.flag))
        .map_err(|error| Failure::Work(format!("watching for the end: {error}")))?;
    let mut watcher = Watcher::new(ObservedSelection { host, trains }, config);
    if arguments.plain || !std::io::stdout().is_terminal() || !can_draw() {
        return print_lines(&mut watcher, &ending);
    }
    let has_colour = std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    show_screen(&mut watcher, &ending, has_colour)
}

/// Returns the trains to show; empty for all there are.
fn wanted(arguments: &Arguments, config: Option<&DaemonConfig>) -> Result<Vec<TrainId>, Failure> {
    let asked: Vec<TrainId> = arguments.trains.iter().map(|&id| TrainId(id)).collect();
    let Some(config) = config else { return Ok(asked) };
    let known: Vec<TrainId> = config.trains.iter().map(|train| train.id).collect();
    if asked.is_empty() {
        return Ok(known);
    }
    match asked.iter().find(|id| !known.contains(id)) {
        None => Ok(asked),
        Some(id) => {
            let known: Vec<String> = known.iter().map(TrainId::to_string).collect();
            let known = known.join(", ");
            Err(Failure::Input(format!("--train {id}: the configuration has train {known}")))
        }
    }
}

/// Time between two polls for snapshots and keys.
const POLL_EVERY: Duration = Duration::from_millis(100);
/// Time between two writings.
const WRITE_EVERY: Duration = Duration::from_secs(1);

/// Writes lines until the program is to end, or until nobody reads them any more.
///
/// # Errors
///
/// When standard output cannot be written.
fn print_lines(watcher: &mut Watcher, ending: &ProgramEnding) -> Result<(), Failure> {
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

/// Time between two drawings without a key: even slow lines can carry this.
const DRAW_EVERY: Duration = Duration::from_millis(500);
/// How long the end of the program may take: an unfinished screen is no loss.
const END_WITHIN: Duration = Duration::from_secs(2);

/// Shows the screen until a key, a signal or the terminal's end ends it; a panic restores the terminal
/// too.
///
/// # Errors
///
/// When the terminal cannot be used.
fn show_screen(
    watcher: &mut Watcher,
    ending: &ProgramEnding,
    has_colour: bool,
) -> Result<(), Failure> {
    let failed = |error: io::Error| Failure::Work(format!("the terminal cannot be used: {error}"));
    let mut terminal = ratatui::try_init().map_err(failed)?;
    let result = show(&mut terminal, watcher, ending, Palette::new(has_colour));
    let restored = result.and(ratatui::try_restore());
    if restored.is_err() && ending.is_terminal_gone() {
        // Dropped, it shows the cursor again; where that fails it says so on standard error, the same
        // terminal, and panics.
        std::mem::forget(terminal);
        return Ok(());
    }
    restored.map_err(failed)
}

/// Ends the program when it does not end by itself: who writes on a terminal that takes nothing, as over
/// a connection that hangs, waits there and sees no flag.
///
/// # Errors
///
/// When the system gives no thread.
pub fn end_though_stuck(must_end: Arc<AtomicBool>) -> io::Result<()> {
    let watch = move || {
        while !must_end.load(Ordering::Relaxed) {
            std::thread::sleep(POLL_EVERY);
        }
        std::thread::sleep(END_WITHIN);
        // Only settings that need no writing can be restored.
        let _ = disable_raw_mode();
        std::process::exit(0);
    };
    std::thread::Builder::new().name("end".into()).spawn(watch).map(drop)
}

fn show(
    terminal: &mut DefaultTerminal,
    watcher: &mut Watcher,
    ending: &ProgramEnding,
    palette: Palette,
) -> io::Result<()> {
    let mut choice = ScreenChoice::default();
    let mut drawn: Option<Instant> = None;
    while !ending.is_due() {
        watcher.look();
        if drawn.is_none_or(|drawn| drawn.elapsed() >= DRAW_EVERY) {
            let (trains, place) = (watcher.trains(), watcher.place());
            choice.train = choice.train.min(trains.len().saturating_sub(1));
            terminal.draw(|frame| draw(frame, &trains, choice, &place, palette))?;
            drawn = Some(Instant::now());
        }
        if !event::poll(POLL_EVERY)? {
            continue;
        }
        match event::read()? {
            Event::Key(key) if key.kind == KeyEventKind::Press => {
                if is_quit(key) {
                    return Ok(());
                }
                choice = pressed(choice, key.code, watcher.trains().len());
                drawn = None;
            }
            Event::Resize(..) => drawn = None,
            _ => {}
        }
    }
    Ok(())
}

fn is_quit(key: KeyEvent) -> bool {
    let is_interrupt = key.modifiers.contains(KeyModifiers::CONTROL);
    match key.code {
        KeyCode::Char('q' | 'Q') | KeyCode::Esc => true,
        KeyCode::Char('c' | 'd') => is_interrupt,
        _ => false,
    }
}

/// Returns the choice after a key.
fn pressed(choice: ScreenChoice, key: KeyCode, trains: usize) -> ScreenChoice {
    let trains = trains.max(1);
    let other = match choice.view {
        ScreenView::Overview => ScreenView::Pipelines,
        ScreenView::Pipelines => ScreenView::Overview,
    };
    match key {
        KeyCode::Char('?' | 'h') => ScreenChoice { has_help: !choice.has_help, ..choice },
        KeyCode::Tab => ScreenChoice { train: (choice.train + 1) % trains, ..choice },
        KeyCode::BackTab => ScreenChoice { train: (choice.train + trains - 1) % trains, ..choice },
        KeyCode::Left | KeyCode::Right => ScreenChoice { view: other, has_help: false, ..choice },
        KeyCode::Char('1') => {
            ScreenChoice { view: ScreenView::Overview, has_help: false, ..choice }
        }
        KeyCode::Char('2') => {
            ScreenChoice { view: ScreenView::Pipelines, has_help: false, ..choice }
        }
        _ => choice,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_change_train_and_view_and_go_round() {
        let start = ScreenChoice::default();
        assert_eq!(pressed(start, KeyCode::BackTab, 3).train, 2);
        assert_eq!(pressed(ScreenChoice { train: 2, ..start }, KeyCode::Tab, 3).train, 0);
        assert_eq!(pressed(start, KeyCode::Tab, 0).train, 0);
        assert_eq!(pressed(start, KeyCode::Right, 1).view, ScreenView::Pipelines);
        let helped = pressed(start, KeyCode::Char('?'), 1);
        assert!(helped.has_help && !pressed(helped, KeyCode::Char('?'), 1).has_help);
        assert!(!pressed(helped, KeyCode::Char('2'), 1).has_help);
    }

    #[test]
    fn q_escape_and_interrupts_quit_and_nothing_else_does() {
        let key = |code, modifiers| is_quit(KeyEvent::new(code, modifiers));
        assert!(key(KeyCode::Char('q'), KeyModifiers::NONE));
        assert!(key(KeyCode::Esc, KeyModifiers::NONE));
        assert!(key(KeyCode::Char('c'), KeyModifiers::CONTROL));
        assert!(!key(KeyCode::Char('c'), KeyModifiers::NONE));
        assert!(!key(KeyCode::Tab, KeyModifiers::NONE));
    }
}
