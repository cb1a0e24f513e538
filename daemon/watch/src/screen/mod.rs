//! The screen, drawn from the state alone: it knows no clock and no channel.
//!
//! 80 x 24 characters hold quantities, residual, the next manoeuvre, and every pipeline with its samples; larger terminals
//! get the resistance at more speeds and plots.

mod style;

use dynocar::operator::{duration, refusals, refused_words};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Paragraph, Wrap};

use crate::state::{PipelineState, PlotPoint, TrainState};
use crate::words::{QuantityRow, daemon, residual, rows, samples};
pub use style::Palette;
use style::{draw_plots, heading, sparkline};

/// A smaller terminal shows no table whole.
const COLUMNS_MIN: u16 = 60;
const ROWS_MIN: u16 = 20;
/// Columns of the table after the number: interval and unit, state of use, why; the age takes the rest.
const COLUMNS: [usize; 3] = [20, 15, 26];
/// The same in a narrow terminal.
const COLUMNS_NARROW: [usize; 3] = [12, 12, 22];
/// From this width on there is room for the wide columns.
const WIDE: u16 = 104;
/// From this height on the resistance is shown at three speeds, and plots have rows of their own.
const TALL: u16 = 28;
/// Rows that the plots take at most.
const PLOT_ROWS: u16 = 14;

/// The keys and the terms.
const HELP: &str = "\
q, Esc, Ctrl-C    quit
Tab, Shift-Tab    next train, train before
← →, 1, 2         overview, pipelines
?                 this, and back

± is a 95 % interval. A controller may use what is usable; learning is not known
yet; confirming is known and has to hold without doubt, 2 s at first, after
doubts up to 10 min; doubted is contradicted; unavailable has no values.
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
        draw_pipelines(frame, body, train, palette);
    } else {
        draw_overview(frame, body, train, palette);
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

/// Draws the overview.
fn draw_overview(frame: &mut Frame<'_>, area: Rect, train: &TrainState, palette: Palette) {
    let is_tall = area.height >= TALL;
    let shares: &[f64] = if is_tall { &[0.1, 0.5, 0.9] } else { &[0.5] };
    let mut lines = quantities(train, shares, area.width, palette);
    lines.extend(residual_lines(train, area.width, palette));
    lines.push(heading("what to drive next", area.width, palette));
    lines.extend(advice(train));
    let rows: u16 = lines.iter().map(|line| rows_of(line, area.width)).sum();
    let text = Paragraph::new(lines).wrap(Wrap { trim: false });
    let has_plots = is_tall && area.height >= rows + 7 && !train.pipelines.is_empty();
    let plot_rows = if has_plots { (area.height - rows - 1).min(PLOT_ROWS) } else { 0 };
    let [upper, _, lower] = Layout::vertical([
        Constraint::Length(rows.min(area.height)),
        Constraint::Length(u16::from(has_plots)),
        Constraint::Length(plot_rows),
    ])
    .areas(area);
    frame.render_widget(text, upper);
    if has_plots && let Some(pipeline) = train.residual() {
        draw_plots(frame, lower, &pipeline.history, palette);
    }
}

/// Returns the rows that a line takes at most when it is wrapped between words.
fn rows_of(line: &Line<'_>, width: u16) -> u16 {
    let columns = line.width() as u16;
    if columns <= width { 1 } else { columns.div_ceil(width.saturating_sub(16).max(1)) }
}

fn quantities(
    train: &TrainState,
    shares: &[f64],
    width: u16,
    palette: Palette,
) -> Vec<Line<'static>> {
    let columns = if width >= WIDE { COLUMNS } else { COLUMNS_NARROW };
    let mut lines = vec![heading("quantities, ± 95 %", width, palette)];
    let table = rows(train, shares);
    if table.is_empty() {
        let words = match train.pipelines.is_empty() {
            true => "nothing has come yet",
            false => "no pipeline answers a quantity for this train",
        };
        lines.push(Line::raw(words));
    }
    lines.extend(table.into_iter().map(|row| line_of(row, columns, palette)));
    lines
}

fn line_of(row: QuantityRow, columns: [usize; 3], palette: Palette) -> Line<'static> {
    let [interval, state, why] = columns;
    let number = format!("{:>9}  ", row.number);
    let interval_and_unit = format!("{} {}", row.interval, row.unit);
    let label = format!("{:<15}", row.label);
    let Some(of_quantity) = row.use_state else {
        return Line::raw(label + &number + interval_and_unit.trim_start());
    };
    let age = row.age_s.map_or("never".to_owned(), duration);
    Line::from(vec![
        Span::styled(label, palette.strong()),
        Span::raw(format!("{number}{:<interval$}", interval_and_unit.trim())),
        Span::styled(format!("{:<state$}", of_quantity.name()), palette.use_state(of_quantity)),
        Span::raw(format!("{:<why$}{age}", row.why)),
    ])
}

fn residual_lines(train: &TrainState, width: u16, palette: Palette) -> Vec<Line<'static>> {
    let mut lines = vec![heading("residual: force that the model lacks", width, palette)];
    let Some(((force, suspect), pipeline)) = residual(train).zip(train.residual()) else {
        lines.push(Line::raw("no pipeline watches it"));
        return lines;
    };
    let room = usize::from(width).saturating_sub(46);
    let curve = |of: fn(&PlotPoint) -> f64| sparkline(pipeline.history.newest(room).map(of));
    let plotted = |words: String, curve: String| {
        let words = format!("{words:<36}");
        Line::from(vec![Span::raw(words), Span::styled(curve, palette.curve())])
    };
    let force = format!("{:<13}{force}", "unexplained");
    lines.push(plotted(force, curve(|point| point.unexplained_kn)));
    let (square, alike) =
        (pipeline.snapshot.innovation_mean_square, pipeline.snapshot.innovation_correlation);
    let evidence = format!("{:<13}{:.1}", "evidence", pipeline.snapshot.suspicion_evidence);
    lines.push(plotted(evidence, curve(|point| point.evidence)));
    let style = if suspect == "none" { palette.plain() } else { palette.alarm() };
    lines.push(Line::from(vec![
        Span::raw(format!("{:<13}", "suspect")),
        Span::styled(suspect, style),
    ]));
    lines.push(Line::raw(format!(
        "{:<13}mean square {square:.2} (1 where the model holds), correlation {alike:+.2}",
        "innovations"
    )));
    lines
}

fn advice(train: &TrainState) -> Vec<Line<'static>> {
    if train.advice.is_empty() {
        let words = match train.pipelines.is_empty() {
            true => "nothing is known yet",
            false => "nothing: no three minutes of driving would show much more",
        };
        return vec![Line::raw(words)];
    }
    train.advice.iter().map(|words| Line::raw(words.clone())).collect()
}

/// Draws every pipeline with its samples.
fn draw_pipelines(frame: &mut Frame<'_>, area: Rect, train: &TrainState, palette: Palette) {
    let mut lines = vec![heading("pipelines", area.width, palette)];
    for pipeline in &train.pipelines {
        lines.extend(lines_of(pipeline, palette));
    }
    if train.pipelines.is_empty() {
        lines.push(Line::raw("nothing has come yet"));
    }
    frame.render_widget(Paragraph::new(lines).wrap(Wrap { trim: false }), area);
}

fn lines_of(pipeline: &PipelineState, palette: Palette) -> Vec<Line<'static>> {
    let it = &pipeline.snapshot;
    let rate = pipeline.history.rate_hz().map_or("…".to_owned(), |rate| format!("{rate:.1}"));
    let age = pipeline.sample_age_s.map_or("no sample".to_owned(), duration);
    let name = match pipeline.name == pipeline.kind() {
        true => pipeline.name.clone(),
        false => format!("{} ({})", pipeline.name, pipeline.kind()),
    };
    let latency_us = 1e-3 * it.published_ns.saturating_sub(it.sample_published_ns) as f64;
    let mut lines = vec![
        Line::from(vec![
            Span::styled(format!("{} {name}  ", it.pipeline_index), palette.strong()),
            Span::styled(pipeline.status_words(), palette.status(pipeline.status)),
        ]),
        Line::raw(format!(
            "  {rate}/s, newest {age} ago, answered in {latency_us:.0} µs; used {}, rejected {}, lost {}",
            it.samples_used, it.samples_rejected, it.samples_lost
        )),
    ];
    let why = refused_words(&refusals(&it.rejected_by_reason));
    if !why.is_empty() {
        lines.push(Line::raw(format!("  rejected: {why}")));
    }
    lines
}

#[cfg(test)]
mod tests;
