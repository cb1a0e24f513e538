//! The distributions as a picture: latency over the share of samples that took longer.

use std::path::Path;

use dynocar::output::write_file;
use hdrhistogram::Histogram;
use plotters::prelude::*;

use super::case::LatencyCase;
use super::report::{MeasuredCase, pooled};
use crate::open_loop::sockets::COMPARED;
use crate::open_loop::trial::Answerer;
use crate::output::{BenchError, during};

const SIZE: (u32, u32) = (1_240, 640);
/// Width in px of the curves; their names stand beside them.
const CURVES_PX: u32 = 960;
/// Height in px of a name, and of the names' first line.
const NAME_PX: (i32, i32) = (22, 56);
/// Latencies shown, in µs.
const SPAN_US: (f64, f64) = (0.2, 20_000.0);
/// The axis runs over log10(1 / share of samples that took longer): 0 is all, 4 is 1 in 10,000.
const NINES: f64 = 4.5;

/// Draws the floors, the daemon's compared cases and the alternatives.
///
/// # Errors
///
/// When the file cannot be written.
pub fn draw(measured: &MeasuredCase, file: &Path) -> Result<(), BenchError> {
    let mut svg = String::new();
    draw_into(measured, &mut svg).map_err(during(file.display()))?;
    Ok(write_file(file, &svg)?)
}

fn draw_into(measured: &MeasuredCase, svg: &mut String) -> Result<(), BenchError> {
    let area = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let caption = format!("Sample → snapshot polled at {} Hz", measured.extent.traffic.rate_hz);
    let (curves, names) = area.split_horizontally(CURVES_PX);
    let mut chart = ChartBuilder::on(&curves)
        .caption(caption, ("sans-serif", 22))
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d(0.0..NINES, (SPAN_US.0..SPAN_US.1).log_scale())?;
    chart
        .configure_mesh()
        .x_desc("quantile")
        .y_desc("latency in µs")
        .x_labels(6)
        .x_label_formatter(&|nines| quantile_name(*nines))
        .y_label_formatter(&|us| format!("{us}"))
        .draw()?;
    let shown = measured.cases.iter().filter(|(case, _)| is_shown(case));
    for (index, (case, outcomes)) in shown.enumerate() {
        let color = Palette99::pick(index).to_rgba();
        let latencies = pooled(outcomes, |outcome| &outcome.from_appointed);
        chart.draw_series(LineSeries::new(points(&latencies), color.stroke_width(2)))?;
        let y = NAME_PX.1 + NAME_PX.0 * index as i32;
        names.draw(&PathElement::new([(4, y), (24, y)], color.stroke_width(2)))?;
        names.draw(&Text::new(case.label(), (32, y - 7), ("sans-serif", 13)))?;
    }
    area.present()?;
    Ok(())
}

/// The other pipelines alone lie so near to each other that lines would hide lines.
fn is_shown(case: &LatencyCase) -> bool {
    match &case.setting.answerer {
        Answerer::Daemon(_, polled) => *polled == Some(COMPARED),
        _ => true,
    }
}

/// `90 %`, `99.9 %`: as many decimals as the quantile has nines beyond two.
fn quantile_name(nines: f64) -> String {
    let decimals = (nines.ceil() as usize).saturating_sub(2);
    format!("{:.decimals$} %", 100.0 * (1.0 - 0.1_f64.powf(nines)))
}

fn points(histogram: &Histogram<u64>) -> Vec<(f64, f64)> {
    // Beyond the longest latency there is nothing more to draw.
    let last = (histogram.len().max(1) as f64).log10().min(NINES);
    (0..=200)
        .map(|step| f64::from(step) / 200.0 * NINES)
        .filter(|&nines| nines <= last)
        .map(|nines| {
            let ns = histogram.value_at_quantile(1.0 - 0.1_f64.powf(nines));
            (nines, ns as f64 * 1e-3)
        })
        .collect()
}
