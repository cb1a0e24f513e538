//! Measured and predicted speed of a run, and the error of the prediction below it.

use dynocar_analysis::explain::report::timeline::{SpeedPoint, Trace};
use plotters::element::PathElement;
use plotters::style::RGBColor;

use super::axes::{Axis, Chart, chart, frame, padded, range_with_zero, shade, stroke, zero_line};
use super::picture::{
    ACTING, AFTER, BEFORE, DrawError, MEASURED, Plot, PlotError, SCALE, Width, before_name, picture,
};
use super::reading::Reading;

/// The run as SVG.
///
/// # Errors
///
/// When the drawing fails.
pub fn draw(trace: &Trace, width: Width, has_effect: bool) -> Result<Plot, PlotError> {
    let (nominal, above, below) = width.size();
    let size = (nominal, above + below);
    let svg = picture(&label(trace, has_effect), width.class(), size, |area| {
        let (speeds, errors) = area.split_vertically(above * SCALE);
        let points = || trace.pieces.iter().flatten();
        let x = padded(points().map(|point| point.time_s), 0.01);
        let labels = width.labels();
        let x_axis = |title| Axis { range: x, title, labels, is_whole: true };

        let all = points().flat_map(|p| [p.measured_mps, p.before_mps, p.after_mps]);
        let y = range_with_zero(all);
        let y = [0.0, y[1]];
        let y_axis = Axis { range: y, title: "Speed, m/s", labels: 5, is_whole: false };
        let mut upper = chart(&speeds, &x_axis(""), &y_axis)?;
        shade(&mut upper, ACTING, &trace.acting_s)?;
        for (_, colour, speed) in predicted(has_effect) {
            lines(&mut upper, trace, colour, 1.2, speed)?;
        }
        lines(&mut upper, trace, MEASURED, 1.4, |point| point.measured_mps)?;

        let away =
            points().flat_map(|p| [p.before_mps - p.measured_mps, p.after_mps - p.measured_mps]);
        let y = range_with_zero(away);
        let y_axis =
            Axis { range: y, title: "Predicted minus measured, m/s", labels: 5, is_whole: false };
        let mut lower = chart(&errors, &x_axis("Time in the recording, s"), &y_axis)?;
        shade(&mut lower, ACTING, &trace.acting_s)?;
        zero_line(&mut lower)?;
        for (_, colour, speed) in predicted(has_effect) {
            lines(&mut lower, trace, colour, 1.4, |p| speed(p) - p.measured_mps)?;
        }
        Ok(vec![frame(&upper), frame(&lower)])
    })?;
    Ok(Plot { svg, readings: readings(trace, has_effect) })
}

/// One of the speeds of a point, its name and its colour.
type Predicted = (&'static str, RGBColor, fn(&SpeedPoint) -> f64);

/// The predictions that are shown.
fn predicted(has_effect: bool) -> impl Iterator<Item = Predicted> {
    let both: [Predicted; 2] = [
        (before_name(has_effect), BEFORE, |point| point.before_mps),
        ("after", AFTER, |point| point.after_mps),
    ];
    both.into_iter().take(1 + usize::from(has_effect))
}

fn readings(trace: &Trace, has_effect: bool) -> Vec<Reading> {
    let values = |value: &dyn Fn(&SpeedPoint) -> f64| -> Vec<f64> {
        // Nothing is read between two pieces.
        trace.pieces.iter().flat_map(|it| it.iter().map(value).chain([f64::NAN])).collect()
    };
    let time = || Reading::new("Time in the recording", "s", false, values(&|p| p.time_s));
    let (mut speeds, mut errors) =
        (time().with("measured", "m/s", values(&|p| p.measured_mps), Vec::new()), time());
    for (name, _, speed) in predicted(has_effect) {
        let away = values(&|p| speed(p) - p.measured_mps);
        speeds = speeds.with(name, "m/s", values(&speed), Vec::new());
        errors = errors.with(format!("{name} − measured"), "m/s", away, Vec::new());
    }
    vec![speeds, errors]
}

fn lines(
    chart: &mut Chart,
    trace: &Trace,
    colour: RGBColor,
    width_px: f64,
    value: impl Fn(&SpeedPoint) -> f64,
) -> Result<(), DrawError> {
    chart.draw_series(trace.pieces.iter().map(|piece| {
        let line: Vec<(f64, f64)> = piece.iter().map(|p| (p.time_s, value(p))).collect();
        PathElement::new(line, stroke(colour, width_px))
    }))?;
    Ok(())
}

fn label(trace: &Trace, has_effect: bool) -> String {
    let (role, file) = (trace.role.name(), &trace.file);
    let mut text = format!("Measured and predicted speed of the {role} run {file} over time");
    if let Some([before, after]) = trace.rmse_mps {
        text += &if has_effect {
            format!("; error {before:.3} m/s before, {after:.3} m/s after the effect is added")
        } else {
            format!("; error {before:.3} m/s")
        };
    }
    text
}
