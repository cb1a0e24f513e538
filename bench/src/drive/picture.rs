//! One picture: stops, timetable and energy with declared, learned and true parameters.

use plotters::coord::Shift;
use plotters::prelude::*;

use super::deviations::traffic_name;
use super::score::{ENERGY, FigureInterval, LATE, STOP_RMS, Scored};
use crate::output::BenchError;

const SIZE: (u32, u32) = (1_080, 400);
const COLORS: [RGBColor; 3] =
    [RGBColor(176, 176, 176), RGBColor(31, 119, 180), RGBColor(44, 160, 44)];
const NAMES: [&str; 3] = ["declared parameters", "with Dynocar", "true parameters"];

/// Title, place among the statistics, and factor and shift of the drawn value.
const PANELS: [(&str, usize, f64, f64); 3] = [
    ("stopping error in cm (rms)", STOP_RMS, 100.0, 0.0),
    ("off the timetable in s", LATE, 1.0, 0.0),
    ("energy above the least in %", ENERGY, 1.0, -100.0),
];

/// Returns the picture of some services as SVG; one group of bars each.
///
/// # Errors
///
/// When the picture cannot be drawn.
pub fn svg(scored: &[&Scored]) -> Result<String, BenchError> {
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let panels = area.split_evenly((1, 3));
        for (index, (area, (title, which, factor, shift))) in panels.iter().zip(PANELS).enumerate()
        {
            let of = |value: f64| factor * value + shift;
            let figure = |all: &[FigureInterval]| {
                let FigureInterval { value, low, high } = all[which];
                FigureInterval { value: of(value), low: of(low), high: of(high) }
            };
            panel(area, title, scored, figure, index == 0)?;
        }
        area.present()?;
    }
    Ok(text)
}

/// One group of bars for each service.
fn panel(
    area: &DrawingArea<SVGBackend<'_>, Shift>,
    title: &str,
    scored: &[&Scored],
    figure: impl Fn(&[FigureInterval]) -> FigureInterval,
    has_legend: bool,
) -> Result<(), BenchError> {
    let figures = scored.iter().flat_map(|it| &it.lines).map(|line| figure(&line.figures));
    let most = figures.map(|it| it.high).fold(0.0, f64::max).max(1e-3);
    let right = 4.0 * scored.len() as f64;
    let mut chart = ChartBuilder::on(area)
        .caption(title, ("sans-serif", 17))
        .margin(10)
        .y_label_area_size(40)
        .build_cartesian_2d(0.0..right, -0.12 * most..1.25 * most)?;
    chart
        .configure_mesh()
        .disable_x_mesh()
        .disable_x_axis()
        .y_labels(6)
        .y_label_formatter(&|value| match *value < 0.0 {
            true => String::new(),
            false => format!("{}", (10.0 * value).round() / 10.0),
        })
        .draw()?;
    for (group, it) in scored.iter().enumerate() {
        let left = 4.0 * group as f64 + 0.5;
        for (bar, line) in it.lines.iter().enumerate() {
            let (from, to) = (left + bar as f64, left + bar as f64 + 0.9);
            let bar_figure = figure(&line.figures);
            let (middle, color) = (0.5 * (from + to), COLORS[bar]);
            chart.draw_series([Rectangle::new(
                [(from, 0.0), (to, bar_figure.value.max(0.0))],
                color.filled(),
            )])?;
            let ends = [(middle, bar_figure.low.max(0.0)), (middle, bar_figure.high.max(0.0))];
            chart.draw_series([PathElement::new(ends, BLACK.stroke_width(1))])?;
        }
        let name = traffic_name(it.service.traffic);
        chart.draw_series([Text::new(name, (left, -0.03 * most), ("sans-serif", 14))])?;
    }
    if has_legend {
        for (index, name) in NAMES.into_iter().enumerate() {
            let at = (0.03 * right, (1.22 - 0.08 * index as f64) * most);
            let to = (0.06 * right, (1.18 - 0.08 * index as f64) * most);
            chart.draw_series([Rectangle::new([at, to], COLORS[index].filled())])?;
            let beside = (0.075 * right, at.1);
            chart.draw_series([Text::new(name, beside, ("sans-serif", 13))])?;
        }
    }
    Ok(())
}
