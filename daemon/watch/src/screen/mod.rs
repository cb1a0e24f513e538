//! The screen, drawn from the state alone: it knows no clock and no channel.
//!
//! 80 x 24 characters hold everything; larger terminals get the resistance at more speeds and plots.

mod overview;
mod style;

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Paragraph, Wrap};

pub use style::Palette;

use crate::state::TrainState;
use crate::words::{daemon, samples};

/// A smaller terminal shows no table whole.
const COLUMNS_MIN: u16 = 60;
const ROWS_MIN: u16 = 20;

/// The keys and the terms.
const HELP: &str = "\
q, Esc, Ctrl-C    quit
Tab, Shift-Tab    next train, train before
← →, 1, 2         overview, pipelines
?                 this, and back

± is a 95 % interval. A controller may use what is usable; learning is not known
yet; confirming is known and has to hold without doubt, 2 s at first, after
doubts up to 10 min; doubted ends with its reason; unavailable has no values.
What each reason means and asks for: docs/guides/reading.md.

Unexplained is the force that the model lacks, retarding positive. Evidence is
twice the log-likelihood ratio for the suspected effect. Small plots show the
last minutes, one block a second, from their lowest to their highest value.

What to drive next is computed from the present covariance on level track, within
what the train's file declares.";

/// Views of the screen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ScreenView {
    /// Quantities, residual, next manoeuvre.
    #[default]
    Overview,
    /// Every pipeline with its samples.
    Pipelines,
}

/// Choice made by keys.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ScreenChoice {
    /// Place among the trains.
    pub train: usize,
    /// The view.
    pub view: ScreenView,
    /// True while the keys are explained.
    pub has_help: bool,
}

/// Draws everything; `place` says where daemons are looked for.
pub fn draw(
    frame: &mut Frame<'_>,
    trains: &[&TrainState],
    choice: ScreenChoice,
    place: &str,
    palette: Palette,
) {
    let area = frame.area();
    if area.width < COLUMNS_MIN || area.height < ROWS_MIN {
        let words = format!(
            "{} x {} is too small: {COLUMNS_MIN} x {ROWS_MIN} or more, please. q quits",
            area.width, area.height
        );
        frame.render_widget(Paragraph::new(words).wrap(Wrap { trim: true }), area);
        return;
    }
    let [head, body, foot] =
        Layout::vertical([Constraint::Length(3), Constraint::Fill(1), Constraint::Length(1)])
            .areas(area);
    keys(frame, foot, trains.len(), palette);
    let Some(train) = trains.get(choice.train.min(trains.len().saturating_sub(1))) else {
        let words = format!(
            "No daemon serves any train under {place}.\n\nWaiting. `dynocar run --config FILE` starts \
             one; the variable DYNOCAR_ROOT or --config names another place."
        );
        frame.render_widget(Paragraph::new("Dynocar").style(palette.strong()), head);
        frame.render_widget(Paragraph::new(words).wrap(Wrap { trim: true }), body);
        return;
    };
    title(frame, head, train, (choice.train, trains.len()), palette);
    if choice.has_help {
        let help = Paragraph::new(HELP).wrap(Wrap { trim: false });
        frame.render_widget(help.style(palette.plain()), body);
    } else if choice.view == ScreenView::Pipelines {
        overview::draw_pipelines(frame, body, train, palette);
    } else {
        overview::draw(frame, body, train, palette);
    }
}

fn title(
    frame: &mut Frame<'_>,
    area: Rect,
    train: &TrainState,
    (index, count): (usize, usize),
    palette: Palette,
) {
    let mut first = vec![Span::styled(format!("Dynocar  train {}", train.id), palette.strong())];
    first.extend(train.name.as_ref().map(|name| Span::raw(format!("  {name}"))));
    if count > 1 {
        first.push(Span::styled(format!("  ({} of {count})", index + 1), palette.faint()));
    }
    let second = daemon(&train.daemon, train.up_s);
    let third = if train.pipelines.is_empty() { String::new() } else { samples(train) };
    let is_served = matches!(train.daemon, crate::state::Daemon::Serving { .. });
    let second_style = if is_served { palette.plain() } else { palette.alarm() };
    // A long message of an incompatible daemon takes the third line too.
    let lines = vec![Line::from(first), Line::styled(second, second_style), Line::raw(third)];
    frame.render_widget(Paragraph::new(lines).wrap(Wrap { trim: true }), area);
}

fn keys(frame: &mut Frame<'_>, area: Rect, trains: usize, palette: Palette) {
    let mut words = "q quit   ←→ view   ? help".to_owned();
    if trains > 1 {
        words = words.replace("←→ view", "Tab train   ←→ view");
    }
    frame.render_widget(Paragraph::new(words).style(palette.faint()), area);
}

#[cfg(test)]
mod tests;
