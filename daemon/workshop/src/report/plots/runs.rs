//! The error of every run, before and after.

use dynocar_analysis::dataset::Role;
use dynocar_analysis::explain::report::errors::RunErrors;
use plotters::element::{Circle, PathElement};
use plotters::prelude::Color;

use super::axes::{Axis, chart, frame, range_with_zero, stroke};
use super::reading::Reading;
use super::{AFTER, AXIS, BEFORE, Plot, PlotError, SCALE, before_name, picture};

/// Nominal size in px.
const SIZE: (u32, u32) = (470, 230);

/// Errors of runs with their numbers in the dataset, as SVG.
///
/// # Errors
///
/// When the drawing fails.
pub fn draw(runs: &[(usize, &RunErrors)], role: Role, has_effect: bool) -> Result<Plot, PlotError> {
    let known: Vec<(usize, [f64; 2])> =
        runs.iter().filter_map(|(number, run)| Some((*number, run.full_run_mps?))).collect();
    let label = format!("Error of the predicted speed of {} {} runs", known.len(), role.name());
    let svg = picture(&label, "panel", SIZE, |area| {
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
        let point = |side: usize, style: plotters::style::ShapeStyle| {
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
    let mut reading = Reading::new("Run", "", true, at);
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
    fn a_single_run_has_its_number_once() {
        let errors = RunErrors {
            file: "2.csv".into(),
            role: Role::Holdout,
            full_run_mps: Some([0.27, 0.08]),
            window60_mps: None,
        };
        let svg = draw(&[(7, &errors)], Role::Holdout, true).unwrap().svg;
        let labels = svg.lines().filter(|line| line.trim() == "7").count();
        assert_eq!(labels, 1, "{svg}");
    }
}
