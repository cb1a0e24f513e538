//! Values over one axis: errors of runs, or of a train's models day by day; a surveyed gradient.

use dynocar_analysis::dataset::Role;
use dynocar_analysis::explain::report::errors::RunErrors;
use dynocar_analysis::survey::profile::GradientEntry;
use dynocar_shared::HALF_95;
use plotters::element::{Circle, PathElement};
use plotters::style::{Color, RGBColor, ShapeStyle};

use super::axes::{Axis, Chart, band, chart, frame, padded, range_with_zero, stroke, zero_line};
use super::picture::{
    AFTER, AXIS, BEFORE, DrawError, Plot, PlotError, SCALE, Width, before_name, picture,
};
use super::reading::PointerReading;

/// Nominal size in px of the errors of runs.
const RUNS_SIZE: (u32, u32) = (470, 230);

/// The errors of a day in m/s, where they are known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DailyErrors {
    /// Days since the first.
    pub day: f64,
    /// Error of the declared model.
    pub declared_mps: Option<f64>,
    /// Error of the model in force on that day.
    pub in_force_mps: Option<f64>,
}

/// Returns the days as SVG; `changes` are the days on which another model came in force, `first` names the
/// first day.
///
/// # Errors
///
/// When the drawing fails.
pub fn days(
    days: &[DailyErrors],
    changes: &[f64],
    first: &str,
    width: Width,
) -> Result<Plot, PlotError> {
    let (nominal, height, _) = width.size();
    let title = format!("Days since {first}");
    let label = format!(
        "Error over 60 s by day since {first}, {} days, of the model in force and of the one that was \
         declared; another came in force {} times",
        days.len(),
        changes.len()
    );
    let svg = picture(&label, width.class(), (nominal, height + 30), |area| {
        let x = padded(days.iter().map(|day| day.day), 0.02);
        let errors = days.iter().flat_map(|day| [day.declared_mps, day.in_force_mps]).flatten();
        let y = [0.0, range_with_zero(errors)[1]];
        let labels = width.labels();
        let x_axis = Axis { range: x, title: &title, labels, is_whole: true };
        let y_axis = Axis { range: y, title: "Error over 60 s, m/s", labels: 5, is_whole: false };
        let mut chart = chart(area, &x_axis, &y_axis)?;
        let change = |&at: &f64| PathElement::new(vec![(at, y[0]), (at, y[1])], stroke(AXIS, 1.2));
        chart.draw_series(changes.iter().map(change))?;
        line(&mut chart, days, |day| day.declared_mps, (BEFORE, false))?;
        line(&mut chart, days, |day| day.in_force_mps, (AFTER, true))?;
        Ok(vec![frame(&chart)])
    })?;
    let values = |pick: fn(&DailyErrors) -> Option<f64>| {
        days.iter().map(|day| pick(day).unwrap_or(f64::NAN)).collect::<Vec<f64>>()
    };
    let at = days.iter().map(|day| day.day).collect();
    let reading = PointerReading::new("Day", "", true, at)
        .with("in force", "m/s", values(|day| day.in_force_mps), Vec::new())
        .with("declared", "m/s", values(|day| day.declared_mps), Vec::new());
    Ok(Plot { svg, readings: vec![reading] })
}

/// Returns a line from day to day, broken where one is missing, with its points.
fn line(
    chart: &mut Chart,
    days: &[DailyErrors],
    pick: fn(&DailyErrors) -> Option<f64>,
    (colour, is_filled): (RGBColor, bool),
) -> Result<(), DrawError> {
    let parts = days.chunk_by(|one, next| {
        pick(one).is_some() && pick(next).is_some() && next.day - one.day < 1.5
    });
    for part in parts {
        let points: Vec<(f64, f64)> =
            part.iter().filter_map(|day| Some((day.day, pick(day)?))).collect();
        chart.draw_series([PathElement::new(points.clone(), stroke(colour, 1.2))])?;
        let style = if is_filled { colour.filled() } else { stroke(colour, 1.6) };
        let radius = (5 * SCALE) as i32 / 2;
        chart.draw_series(points.iter().map(|&point| Circle::new(point, radius, style)))?;
    }
    Ok(())
}

/// Draws the gradient over the chainage with its 95 % interval, as SVG.
///
/// # Errors
///
/// When the drawing fails.
pub fn gradient(
    entries: &[GradientEntry],
    direction: &str,
    width: Width,
) -> Result<Plot, PlotError> {
    let (nominal, height, _) = width.size();
    let halves: Vec<f64> = entries.iter().map(|entry| HALF_95 * entry.std_permille).collect();
    let (low, high) = entries.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |range, entry| {
        (range.0.min(entry.gradient_permille), range.1.max(entry.gradient_permille))
    });
    let label = format!("Gradient over the chainage for {direction}: from {low:.1} to {high:.1} ‰");
    let svg = picture(&label, width.class(), (nominal, height + 60), |area| {
        let x = padded(entries.iter().map(|entry| entry.from_m / 1e3), 0.005);
        // Where nothing is driven the band is wide: it is cut so that the rest stays readable.
        let y = range_with_zero(entries.iter().map(|entry| entry.gradient_permille));
        let labels = width.labels();
        let x_axis = Axis { range: x, title: "Chainage, km", labels, is_whole: false };
        let y_axis = Axis { range: y, title: "Gradient, ‰", labels: 6, is_whole: false };
        let mut chart = chart(area, &x_axis, &y_axis)?;
        let line: Vec<(f64, f64)> =
            entries.iter().map(|it| (it.from_m / 1e3, it.gradient_permille)).collect();
        band(&mut chart, &line, &halves)?;
        zero_line(&mut chart)?;
        chart.draw_series([PathElement::new(line, stroke(AFTER, 1.2))])?;
        Ok(vec![frame(&chart)])
    })?;
    let at = entries.iter().map(|entry| entry.from_m / 1e3).collect();
    let values = entries.iter().map(|entry| entry.gradient_permille).collect();
    let reading =
        PointerReading::new("Chainage", "km", false, at).with("gradient", "‰", values, halves);
    Ok(Plot { svg, readings: vec![reading] })
}

/// Returns the errors of runs with their numbers in the dataset, as SVG.
///
/// # Errors
///
/// When the drawing fails.
pub fn errors_of_runs(
    runs: &[(usize, &RunErrors)],
    role: Role,
    has_effect: bool,
) -> Result<Plot, PlotError> {
    let known: Vec<(usize, [f64; 2])> =
        runs.iter().filter_map(|(number, run)| Some((*number, run.full_run_mps?))).collect();
    let label = format!("Error of the predicted speed of {} {} runs", known.len(), role.name());
    let svg = picture(&label, "panel", RUNS_SIZE, |area| {
        let last = known.iter().map(|run| run.0).max().unwrap_or(1) as f64;
        let first = known.iter().map(|run| run.0).min().unwrap_or(1) as f64;
        let x = [first - 0.6, last + 0.6];
        let y = [0.0, range_with_zero(known.iter().flat_map(|run| run.1))[1]];
        let labels = ((last - first) as usize + 3).clamp(3, 14);
        let x_axis = Axis { range: x, title: "Run, by number", labels, is_whole: true };
        let y_axis = Axis { range: y, title: "RMSE of the speed, m/s", labels: 5, is_whole: false };
        let mut chart = chart(area, &x_axis, &y_axis)?;
        if has_effect {
            chart.draw_series(known.iter().map(|&(number, [before, after])| {
                let at = number as f64;
                PathElement::new(vec![(at, before), (at, after)], stroke(AXIS, 1.2))
            }))?;
        }
        let point = |side: usize, style: ShapeStyle| {
            known.iter().map(move |(number, rmse)| {
                Circle::new((*number as f64, rmse[side]), 4 * SCALE, style)
            })
        };
        chart.draw_series(point(0, stroke(BEFORE, 1.8)))?;
        if has_effect {
            chart.draw_series(point(1, AFTER.filled()))?;
        }
        Ok(vec![frame(&chart)])
    })?;
    let at = known.iter().map(|run| run.0 as f64).collect();
    let errors = |side: usize| known.iter().map(|run| run.1[side]).collect();
    let mut reading = PointerReading::new("Run", "", true, at);
    reading = reading.with(before_name(has_effect), "m/s", errors(0), Vec::new());
    if has_effect {
        reading = reading.with("after", "m/s", errors(1), Vec::new());
    }
    Ok(Plot { svg, readings: vec![reading] })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_known_day_has_its_points_and_each_change_its_line() {
        let day = |day: f64| DailyErrors {
            day,
            declared_mps: Some(0.8),
            in_force_mps: (day != 3.0).then_some(0.3 + 0.01 * day),
        };
        let days: Vec<DailyErrors> = (0..6).map(|k| day(f64::from(k))).collect();
        let plot = super::days(&days, &[2.0], "2026-01-01", Width::Wide).unwrap();
        assert_eq!(plot.svg.matches("<circle").count(), 6 + 5);
        assert!(plot.svg.contains("Days since 2026-01-01") && plot.svg.contains("1 times"));
        assert!(plot.readings[0].series[0].values[3].is_nan());
    }

    #[test]
    fn a_single_run_has_its_number_once() {
        let errors = RunErrors {
            file: "2.csv".into(),
            role: Role::Holdout,
            full_run_mps: Some([0.27, 0.08]),
            window60_mps: None,
        };
        let svg = errors_of_runs(&[(7, &errors)], Role::Holdout, true).unwrap().svg;
        let labels = svg.lines().filter(|line| line.trim() == "7").count();
        assert_eq!(labels, 1, "{svg}");
    }
}
