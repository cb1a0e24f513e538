//! Common parts of all plots: canvas, axes, titles, text.

use plotters::backend::SVGBackend;
use plotters::chart::{ChartBuilder, ChartContext};
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::{Cartesian2d, Color, IntoFont, Polygon, Rectangle, Text, TextStyle};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{RGBColor, ShapeStyle};

use super::picture::{AXIS, Area, BAND, DrawError, Frame, GRID, SCALE, TEXT};
use crate::report::html::minus;

pub(super) type Chart<'a, 't> =
    ChartContext<'a, SVGBackend<'t>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// Nominal size of letters in px.
const LETTERS_PX: f64 = 12.5;
/// Nominal height in px of the labels below a chart.
const LABELS_PX: u32 = 22;
/// The backend writes font sizes divided by this.
const BACKEND_FACTOR: f64 = 1.24;

/// An axis: its range and its title.
pub(super) struct Axis<'a> {
    pub range: [f64; 2],
    pub title: &'a str,
    /// Greatest number of labels.
    pub labels: usize,
    /// True where labels stand at whole numbers only.
    pub is_whole: bool,
}

pub(super) fn letters(position: (HPos, VPos)) -> TextStyle<'static> {
    let size = LETTERS_PX * BACKEND_FACTOR * f64::from(SCALE);
    TextStyle::from(("sans-serif", size).into_font())
        .color(&TEXT)
        .pos(Pos::new(position.0, position.1))
}

/// Returns a stroke of nominal width.
pub(super) fn stroke(colour: RGBColor, width_px: f64) -> ShapeStyle {
    colour.stroke_width((width_px * f64::from(SCALE)).round() as u32)
}

/// Returns a chart with its axes drawn; the titles stand above the vertical axis and below the
/// horizontal one.
pub(super) fn chart<'a, 't>(
    area: &'a Area<'t>,
    x: &Axis,
    y: &Axis,
) -> Result<Chart<'a, 't>, DrawError> {
    let px = |nominal: u32| nominal * SCALE;
    let (width, height) = area.dim_in_pixel();
    let mut chart = ChartBuilder::on(area)
        .margin_top(px(24))
        .margin_right(px(12))
        .margin_bottom(px(if x.title.is_empty() { 2 } else { 20 }))
        .margin_left(px(2))
        .x_label_area_size(px(LABELS_PX))
        .y_label_area_size(px(44))
        .build_cartesian_2d(x.range[0]..x.range[1], y.range[0]..y.range[1])?;
    area.draw(&Text::new(y.title.to_string(), (px(4) as i32, px(4) as i32), letters(TOP_LEFT)))?;
    if !x.title.is_empty() {
        let below = (width as i32 - px(12) as i32, height as i32 - px(3) as i32);
        area.draw(&Text::new(x.title.to_string(), below, letters((HPos::Right, VPos::Bottom))))?;
    }
    let label = |axis: &Axis| {
        let decimals = if axis.is_whole { 0 } else { decimals(axis) };
        let is_whole = axis.is_whole;
        move |value: &f64| {
            // A label between two whole numbers would repeat one of them.
            let is_shown = !is_whole || (value - value.round()).abs() < 1e-6;
            if is_shown { minus(&format!("{value:.decimals$}")) } else { String::new() }
        }
    };
    let (x_label, y_label) = (label(x), label(y));
    chart
        .configure_mesh()
        .disable_x_mesh()
        .light_line_style(plotters::style::TRANSPARENT)
        .bold_line_style(stroke(GRID, 1.0))
        .axis_style(stroke(AXIS, 1.0))
        .label_style(letters((HPos::Center, VPos::Center)))
        .set_all_tick_mark_size(px(3))
        .x_labels(x.labels)
        .y_labels(y.labels)
        .x_label_formatter(&x_label)
        .y_label_formatter(&y_label)
        .draw()?;
    Ok(chart)
}

/// Returns where a chart lies.
pub(super) fn frame(chart: &Chart) -> Frame {
    let (across, down) = chart.plotting_area().get_pixel_range();
    let x = chart.x_range();
    let labels_end = down.end + (LABELS_PX * SCALE) as i32;
    let px = [across.start, down.start, across.end, down.end, labels_end].map(f64::from);
    [px[0], px[1], px[2], px[3], px[4], x.start, x.end]
}

const TOP_LEFT: (HPos, VPos) = (HPos::Left, VPos::Top);

/// Decimals that distinguish the labels of an axis.
fn decimals(axis: &Axis) -> usize {
    let step = (axis.range[1] - axis.range[0]).abs() / axis.labels.max(1) as f64;
    (-step.max(1e-9).log10().floor()).clamp(0.0, 6.0) as usize
}

/// Returns a range that holds all values and zero, with room at the ends.
pub(super) fn range_with_zero(values: impl Iterator<Item = f64>) -> [f64; 2] {
    padded(values.chain([0.0]), 0.08)
}

/// Returns a range that holds all values, widened by a share of it at either end.
pub(super) fn padded(values: impl Iterator<Item = f64>, share: f64) -> [f64; 2] {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for value in values.filter(|value| value.is_finite()) {
        (low, high) = (low.min(value), high.max(value));
    }
    if low > high {
        return [0.0, 1.0];
    }
    let room = if high > low { share * (high - low) } else { 0.5 * high.abs().max(1.0) };
    [low - room, high + room]
}

/// Shades ranges, as those in which an effect acts; draw it first.
pub(super) fn shade(
    chart: &mut Chart,
    colour: RGBColor,
    ranges: &[[f64; 2]],
) -> Result<(), DrawError> {
    let (x, y) = (chart.x_range(), chart.y_range());
    let inside = ranges
        .iter()
        .map(|range| range.map(|value| value.clamp(x.start, x.end)))
        .filter(|[from, to]| to > from);
    chart.draw_series(
        inside.map(|[from, to]| Rectangle::new([(from, y.start), (to, y.end)], colour.filled())),
    )?;
    Ok(())
}

/// Draws a band of so much to either side of a line, cut where the chart ends.
pub(super) fn band(
    chart: &mut Chart,
    line: &[(f64, f64)],
    halves: &[f64],
) -> Result<(), DrawError> {
    let y = chart.y_range();
    let edge = |side: f64| {
        let both = line.iter().zip(halves);
        both.map(move |((at, value), half)| (*at, (value + side * half).clamp(y.start, y.end)))
    };
    let outline: Vec<(f64, f64)> = edge(1.0).chain(edge(-1.0).rev()).collect();
    chart.draw_series([Polygon::new(outline, BAND.filled())])?;
    Ok(())
}

/// Draws a horizontal line at zero.
pub(super) fn zero_line(chart: &mut Chart) -> Result<(), DrawError> {
    let x = chart.x_range();
    let line = vec![(x.start, 0.0), (x.end, 0.0)];
    chart.draw_series([plotters::element::PathElement::new(line, stroke(AXIS, 1.0))])?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_hold_their_values_with_room() {
        assert_eq!(padded([1.0, f64::NAN, 3.0].into_iter(), 0.5), [0.0, 4.0]);
        assert_eq!(padded([2.0].into_iter(), 0.1), [1.0, 3.0]);
        assert_eq!(padded([].into_iter(), 0.1), [0.0, 1.0]);
        let [low, high] = range_with_zero([2.0].into_iter());
        assert!(low < 0.0 && high > 2.0);
    }

    #[test]
    fn labels_have_the_decimals_that_show_them_apart() {
        let axis = |range| Axis { range, title: "", labels: 5, is_whole: false };
        assert_eq!(decimals(&axis([0.0, 1000.0])), 0);
        assert_eq!(decimals(&axis([0.0, 5.0])), 0);
        assert_eq!(decimals(&axis([0.0, 0.4])), 2);
    }
}
