//! The keys and the words.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::widgets::{Paragraph, Wrap};

use super::style::Palette;

const HELP: &str = "\
q, Esc, Ctrl-C    quit
Tab, Shift-Tab    next train, train before
← →, 1, 2         overview, pipelines
?                 this, and back

± is a 95 % interval. A controller may use what is estimated; degraded has a
reservation that the reason names; invalid must not be used. What each reason
means and asks for: docs/guides/reading.md.

Unexplained is the force that the model lacks, retarding positive. Evidence is
twice the log-likelihood ratio for the suspected effect. Small plots show the
last minutes, one block a second, from their lowest to their highest value.

What to drive next is computed from the present covariance on level track, within
what the train's file declares.";

/// Draws it.
pub fn draw(frame: &mut Frame<'_>, area: Rect, palette: Palette) {
    frame.render_widget(
        Paragraph::new(HELP).wrap(Wrap { trim: false }).style(palette.plain()),
        area,
    );
}
