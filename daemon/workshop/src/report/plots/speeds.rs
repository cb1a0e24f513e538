//! Measured and predicted speed of a run, and the error of the prediction below it.

use dynocar_analysis::dataset::Run;
use dynocar_analysis::explain::report::timeline::{SpeedPoint, Trace};
use plotters::element::PathElement;
use plotters::style::RGBColor;

use crate::run_facts::beginning;

use super::axes::{Axis, Chart, chart, frame, padded, range_with_zero, shade, stroke, zero_line};
use super::picture::{
    ACTING, AFTER, BEFORE, DrawError, MEASURED, Plot, PlotError, SCALE, Width, before_name, picture,
};
use super::reading::PointerReading;

/// Returns the run as SVG.
///
/// # Errors
///
/// When the drawing fails.
pub fn draw(
    trace: &Trace,
    run: Option<&Run>,
    width: Width,
    has_effect: bool,
) -> Result<Plot, PlotError> {
    let (trace, time) = &from_start(trace, run);
    let (nominal, above, below) = width.size();
    let size = (nominal, above + below);
    let svg = picture(&label(trace, has_effect), width.class(), size, |area| {
        let (speeds, errors) = area.split_vertically(above * SCALE);
        let points = || trace.pieces.iter().flatten();
        let x = padded(points().map(|point| point.time_s), 0.01);
        let (labels, title) = (width.labels(), format!("{time}, s"));
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
        let mut lower = chart(&errors, &x_axis(&title), &y_axis)?;
        shade(&mut lower, ACTING, &trace.acting_s)?;
        zero_line(&mut lower)?;
        for (_, colour, speed) in predicted(has_effect) {
            lines(&mut lower, trace, colour, 1.4, |p| speed(p) - p.measured_mps)?;
        }
        Ok(vec![frame(&upper), frame(&lower)])
    })?;
    Ok(Plot { svg, readings: readings(trace, time, has_effect) })
}

/// One of the speeds of a point, its name and its colour.
type Predicted = (&'static str, RGBColor, fn(&SpeedPoint) -> f64);

/// Returns the predictions that are shown.
fn predicted(has_effect: bool) -> impl Iterator<Item = Predicted> {
    let both: [Predicted; 2] = [
        (before_name(has_effect), BEFORE, |point| point.before_mps),
        ("after", AFTER, |point| point.after_mps),
    ];
    both.into_iter().take(1 + usize::from(has_effect))
}

/// Returns the run, with times from its beginning where that is known, and the title of its time axis.
fn from_start(trace: &Trace, run: Option<&Run>) -> (Trace, String) {
    let mut trace = trace.clone();
    let first_s = trace.pieces.iter().flatten().map(|point| point.time_s).reduce(f64::min);
    let Some((start, start_s)) = first_s.and_then(|it| beginning(it, run)) else {
        return (trace, "Time in the recording".into());
    };
    trace.pieces.iter_mut().flatten().for_each(|point| point.time_s -= start_s);
    trace.acting_s.iter_mut().flatten().for_each(|time_s| *time_s -= start_s);
    (trace, format!("Time since {start}"))
}

fn readings(trace: &Trace, time: &str, has_effect: bool) -> Vec<PointerReading> {
    let values = |value: &dyn Fn(&SpeedPoint) -> f64| -> Vec<f64> {
        // Nothing is read between two pieces.
        trace.pieces.iter().flat_map(|it| it.iter().map(value).chain([f64::NAN])).collect()
    };
    let time = || PointerReading::new(time, "s", false, values(&|p| p.time_s));
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

#[cfg(test)]
mod tests {
    use dynocar_analysis::dataset::Role;

    use super::*;

    #[test]
    fn times_that_count_from_1970_are_shown_from_their_start_with_its_date() {
        let drawn = |from_s: f64| {
            let point = |k: u32| SpeedPoint {
                time_s: from_s + f64::from(k),
                measured_mps: 10.0,
                before_mps: 10.5,
                after_mps: 10.1,
            };
            let trace = Trace {
                file: "01.csv".into(),
                role: Role::Fit,
                pieces: vec![(0..100).map(point).collect()],
                rmse_mps: None,
                acting_s: vec![[from_s + 20.0, from_s + 40.0]],
            };
            draw(&trace, None, Width::Narrow, true).unwrap()
        };
        let plot = drawn(1_738_479_600.0);
        assert!(plot.svg.contains("Time since 2025-02-02T07:00:00Z, s"), "{}", plot.svg);
        assert!(!plot.svg.contains("17384796"), "{}", plot.svg);
        assert_eq!(plot.readings[1].name, "Time since 2025-02-02T07:00:00Z");
        assert_eq!(plot.readings[1].at[..2], [0.0, 1.0]);
        assert!(drawn(0.0).svg.contains("Time in the recording, s"));
    }
}
