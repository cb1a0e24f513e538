//! Every pipeline with its samples.

use dynocar::operator::{duration, refusals, refused_words};
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Paragraph, Wrap};

use super::style::{Palette, heading};
use crate::state::{PipelineState, TrainState};

/// Draws the view.
pub fn draw(frame: &mut Frame<'_>, area: Rect, train: &TrainState, palette: Palette) {
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
            Span::styled(pipeline.status.name(), palette.status(pipeline.status)),
            Span::raw(format!(" ({})", pipeline.reason_name())),
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
