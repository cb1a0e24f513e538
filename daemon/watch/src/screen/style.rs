//! Colours, or none, and headings.

use dynocar_shared::{Status, UseState};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::Line;

/// Colours where they are wanted; without them only bold and faint text.
#[derive(Clone, Copy, Debug)]
pub struct Palette {
    has_colour: bool,
}

impl Palette {
    /// With colours or without.
    pub fn new(has_colour: bool) -> Self {
        Palette { has_colour }
    }

    fn coloured(self, colour: Color) -> Style {
        if self.has_colour { Style::new().fg(colour) } else { Style::new() }
    }

    /// Plain text.
    pub fn plain(self) -> Style {
        Style::new()
    }

    /// Names.
    pub fn strong(self) -> Style {
        Style::new().add_modifier(Modifier::BOLD)
    }

    /// Style of text that is read once.
    pub fn faint(self) -> Style {
        Style::new().add_modifier(Modifier::DIM)
    }

    /// Style of text that must be seen.
    pub fn alarm(self) -> Style {
        self.coloured(Color::Red).add_modifier(Modifier::BOLD)
    }

    /// Curves.
    pub fn curve(self) -> Style {
        self.coloured(Color::Cyan)
    }

    /// Returns a state of use.
    pub fn use_state(self, state: UseState) -> Style {
        match state {
            UseState::Usable => self.coloured(Color::Green),
            UseState::Confirming | UseState::Doubted => self.coloured(Color::Yellow),
            UseState::Unavailable => self.alarm(),
            UseState::Learning => self.faint(),
        }
    }

    /// Returns a status.
    pub fn status(self, status: Status) -> Style {
        match status {
            Status::Estimated => self.coloured(Color::Green),
            Status::Degraded => self.coloured(Color::Yellow),
            Status::Invalid => self.alarm(),
            Status::Unestimated => self.faint(),
        }
    }
}

/// Returns a heading over a section, with a rule to the right edge.
pub fn heading(words: &str, width: u16, palette: Palette) -> Line<'static> {
    let rule = "─".repeat(usize::from(width).saturating_sub(words.chars().count() + 4));
    Line::styled(format!("── {words} {rule}"), palette.faint())
}
