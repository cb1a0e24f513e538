//! Colours, or none, headings, and plots over time: one row of blocks, or a chart where there is room.

use dynocar_shared::{Status, UseState};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::symbols::Marker;
use ratatui::text::Line;
use ratatui::widgets::{Axis, Chart, Dataset, GraphType};

use crate::state::{PlotHistory, PlotPoint};

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

const BLOCKS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// One row: the lowest value is the lowest block; values that are all the same are a low line.
pub fn sparkline(values: impl Iterator<Item = f64> + Clone) -> String {
    let low = values.clone().fold(f64::INFINITY, f64::min);
    let high = values.clone().fold(f64::NEG_INFINITY, f64::max);
    let block = |value: f64| {
        let share = if high > low { (value - low) / (high - low) } else { 0.0 };
        BLOCKS[((share * 8.0) as usize).min(7)]
    };
    values.map(block).collect()
}

/// Two charts side by side: the unexplained force and the evidence for the suspect.
pub fn draw_plots(frame: &mut Frame<'_>, area: Rect, history: &PlotHistory, palette: Palette) {
    let [left, right] =
        Layout::horizontal([Constraint::Fill(1), Constraint::Fill(1)]).spacing(2).areas(area);
    chart(frame, left, history, ("unexplained force in kN", |it| it.unexplained_kn), palette);
    chart(frame, right, history, ("evidence for the suspect", |it| it.evidence), palette);
}

fn chart(
    frame: &mut Frame<'_>,
    area: Rect,
    history: &PlotHistory,
    (title, of): (&'static str, fn(&PlotPoint) -> f64),
    palette: Palette,
) {
    let count = history.newest(usize::MAX).count();
    let ago = |index: usize| index as f64 + 1.0 - count as f64;
    let points: Vec<(f64, f64)> = history
        .newest(usize::MAX)
        .enumerate()
        .map(|(index, point)| (ago(index), of(point)))
        .collect();
    let (low, high) = range(points.iter().map(|point| point.1));
    let first_s = points.first().map_or(-1.0, |point| point.0.min(-1.0));
    let curve = Dataset::default()
        .marker(Marker::Braille)
        .graph_type(GraphType::Line)
        .style(palette.curve())
        .data(&points);
    let labels = [low, 0.5 * (low + high), high].map(|value| Line::raw(format!("{value:.1}")));
    let chart = Chart::new(vec![curve])
        .x_axis(
            Axis::default()
                .bounds([first_s, 0.0])
                .labels([Line::raw(format!("{first_s:.0} s")), Line::raw("now")])
                .style(palette.faint()),
        )
        .y_axis(
            Axis::default().title(title).bounds([low, high]).labels(labels).style(palette.faint()),
        );
    frame.render_widget(chart, area);
}

/// Returns the bounds around all values and 0.
fn range(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let low = values.clone().fold(0.0, f64::min);
    let high = values.fold(0.0, f64::max);
    let room = 0.05 * (high - low).max(1.0);
    (low - room, high + room)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_of_blocks_goes_from_the_lowest_to_the_highest() {
        assert_eq!(sparkline([-1.0, 0.0, 1.0].into_iter()), "▁▅█");
        assert_eq!(sparkline([2.0, 2.0].into_iter()), "▁▁");
        assert_eq!(sparkline(std::iter::empty()), "");
    }
}
