//! What was found along a line: places with their intervals, errors of the gradient, the residual.

use dynocar_analysis::explain::report::line::{AlongLine, MarkedInterval};
use plotters::element::{PathElement, Rectangle, Text};
use plotters::style::Color;
use plotters::style::text_anchor::{HPos, VPos};

use super::panel::{Content, Panel, direction_label, rows};
use crate::report::plots::axes::{Chart, letters, stroke};
use crate::report::plots::{ACTING, AFTER, DrawError};

/// The panels below those of the declared line.
pub(super) fn panels(found: &AlongLine) -> Vec<Panel> {
    let mut panels = Vec::new();
    let mut push = |name: String, unit: &'static str, content: Content| {
        panels.push(Panel { name, unit, content });
    };
    for place in &found.places {
        let content = Content::Places(place.sections.clone());
        push(format!("Found: {}", place.name), "", content);
    }
    if !found.gradient_error.is_empty() {
        let nodes = found.gradient_error.iter();
        let (points, halves) =
            nodes.map(|[at_m, value, half]| ((at_m / 1e3, *value), *half)).unzip();
        push("Error of the gradient, found".into(), "‰", Content::Line { points, halves });
    }
    for (direction, bins) in &found.residual {
        let name = format!("Missing resistance, {}", direction_label(*direction));
        push(name, "N/kN", Content::Means(*direction, bins.clone()));
    }
    panels
}

/// Bars where an effect was found, the first row on top, with whiskers where their ends may lie.
pub(super) fn bars(
    chart: &mut Chart,
    sections: &[MarkedInterval],
    from_km: f64,
) -> Result<(), DrawError> {
    let rows = rows(sections);
    let height = 1.0 / rows.len() as f64;
    for (row, run) in rows.iter().enumerate() {
        let at = |share: f64| 1.0 - (row as f64 + share) * height;
        for MarkedInterval { at_m, ends_m, .. } in
            sections.iter().filter(|it| it.run.as_deref() == *run)
        {
            let [from, to] = at_m.map(|end| end / 1e3);
            let (top, bottom) = (at(0.25), at(0.75));
            chart.draw_series([Rectangle::new([(from, bottom), (to, top)], ACTING.filled())])?;
            let corners = [(from, top), (to, top), (to, bottom), (from, bottom), (from, top)];
            chart.draw_series([PathElement::new(corners.to_vec(), stroke(AFTER, 1.0))])?;
            for [low, high] in ends_m.iter().flatten().map(|ends| ends.map(|end| end / 1e3)) {
                let across = [(low, at(0.5)), (high, at(0.5))];
                let ends = [low, high].map(|end| [(end, at(0.1)), (end, at(0.9))]);
                let strokes = [across, ends[0], ends[1]].map(|line| line.to_vec());
                let style = stroke(AFTER, 1.6);
                chart.draw_series(strokes.map(|line| PathElement::new(line, style)))?;
            }
        }
        let style = letters((HPos::Left, VPos::Center));
        let name = run.map(|run| Text::new(format!("\u{2002}{run}"), (from_km, at(0.5)), style));
        chart.draw_series(name)?;
    }
    Ok(())
}
