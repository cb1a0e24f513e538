//! Keys, a terminal that is restored at the end, and a terminal that is gone or takes no more output.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crossterm::event::{self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use crossterm::terminal::disable_raw_mode;
use dynocar::cli::Failure;
use dynocar::ending::ProgramEnding;
use ratatui::DefaultTerminal;

use crate::screen::{Palette, ScreenChoice, ScreenView, draw};
use crate::watcher::Watcher;

/// Time between two polls for snapshots and keys.
const POLL_EVERY: Duration = Duration::from_millis(100);
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
pub fn run(watcher: &mut Watcher, ending: &ProgramEnding, has_colour: bool) -> Result<(), Failure> {
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
