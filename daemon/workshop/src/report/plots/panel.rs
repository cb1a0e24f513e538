//! The residual force against one covariate.

use dynocar_analysis::dataset::Run;
use dynocar_analysis::explain::report::covariates::Covariate;
use dynocar_analysis::explain::report::panels::{Panel, PanelBin};
use plotters::element::{Circle, PathElement};
use plotters::style::{Color, RGBColor};

use crate::run_facts::beginning;

use super::axes::{
    Axis, Chart, band, chart, frame, padded, range_with_zero, shade, stroke, zero_line,
};
use super::picture::{
    ACTING, AFTER, BEFORE, DrawError, Plot, PlotError, SCALE, before_name, picture,
};
use super::reading::PointerReading;

/// Nominal size in px.
const SIZE: (u32, u32) = (470, 290);
/// Distance between the marks before and after, as a share of the axis.
const APART: f64 = 0.004;

/// Returns the panel as SVG.
///
/// # Errors
///
/// When the drawing fails.
pub fn draw(panel: &Panel, run: Option<&Run>, has_effect: bool) -> Result<Plot, PlotError> {
    let (panel, since) = &from_start(panel, run);
    let svg = picture(&label(panel, has_effect), "panel", SIZE, |area| {
        let is_category = panel.covariate.is_category();
        let room = if is_category { 0.0 } else { 0.03 };
        let x = match panel.covariate {
            Covariate::Direction => [-1.6, 1.6],
            Covariate::Run => [0.4, panel.bins.last().map_or(1.0, |bin| bin.at) + 0.6],
            _ => padded(panel.bins.iter().map(|bin| bin.at), room),
        };
        let y = vertical_range(&panel.bins, has_effect);
        let title = match since {
            Some(since) => format!("{since}, s"),
            None => axis_title(panel.covariate),
        };
        let labels = if is_category { panel.bins.len().clamp(3, 13) } else { 6 };
        let x_axis = Axis { range: x, title: &title, labels, is_whole: is_category };
        let y_axis =
            Axis { range: y, title: "Missing resistance, N/kN", labels: 5, is_whole: false };
        let mut chart = chart(area, &x_axis, &y_axis)?;
        shade(&mut chart, ACTING, &panel.acting)?;
        zero_line(&mut chart)?;
        if has_effect && !is_category {
            let (line, halves): (Vec<(f64, f64)>, Vec<f64>) = panel
                .bins
                .iter()
                .map(|bin| ((bin.at, bin.effect_n_per_kn.0), bin.effect_n_per_kn.1))
                .unzip();
            band(&mut chart, &line, &halves)?;
            chart.draw_series([PathElement::new(line, stroke(BEFORE, 1.0))])?;
        }
        means(&mut chart, &panel.bins, has_effect, x)?;
        Ok(vec![frame(&chart)])
    })?;
    let covariate = panel.covariate;
    let name = since.as_deref().unwrap_or(covariate.title());
    let reading = reading(name, covariate.unit(), &panel.bins, has_effect);
    Ok(Plot { svg, readings: vec![reading] })
}

/// Returns the panel; where the beginning of a run's times is known, it counts them from there, and returns the new title.
fn from_start(panel: &Panel, run: Option<&Run>) -> (Panel, Option<String>) {
    let mut panel = panel.clone();
    let first_s = panel.bins.first().map_or(0.0, |bin| bin.at);
    let start = match panel.covariate {
        Covariate::TimeInRun(_) => beginning(first_s, run),
        _ => None,
    };
    if let Some((_, start_s)) = start {
        panel.bins.iter_mut().for_each(|bin| bin.at -= start_s);
        panel.acting.iter_mut().flatten().for_each(|time_s| *time_s -= start_s);
    }
    (panel, start.map(|(start, _)| format!("Time since {start}")))
}

/// A mean of a bin, with its half width.
type Mean = fn(&PanelBin) -> (f64, f64);

/// Bins as a pointer reads them.
pub(super) fn reading(
    name: &str,
    unit: &'static str,
    bins: &[PanelBin],
    has_effect: bool,
) -> PointerReading {
    let sides: [(&str, Mean); 3] = [
        (before_name(has_effect), |bin| bin.before_n_per_kn),
        ("after", |bin| bin.after_n_per_kn),
        ("effect", |bin| bin.effect_n_per_kn),
    ];
    let reading = PointerReading::new(name, unit, true, bins.iter().map(|bin| bin.at).collect());
    let shown = sides.into_iter().take(if has_effect { 3 } else { 1 });
    shown.fold(reading, |reading, (name, side)| {
        let (values, halves) = bins.iter().map(side).unzip();
        reading.with(name, "N/kN", values, halves)
    })
}

/// The means of bins, before and after, with their whiskers.
pub(super) fn means(
    chart: &mut Chart,
    bins: &[PanelBin],
    has_effect: bool,
    x: [f64; 2],
) -> Result<(), DrawError> {
    let apart = if has_effect { APART * (x[1] - x[0]) } else { 0.0 };
    let before = bins.iter().map(|bin| (bin.at - apart, bin.before_n_per_kn));
    points(chart, before, BEFORE, false)?;
    if has_effect {
        let after = bins.iter().map(|bin| (bin.at + apart, bin.after_n_per_kn));
        points(chart, after, AFTER, true)?;
    }
    Ok(())
}

/// Returns a range that shows every mean with the usual whisker; the longest whiskers may be cut so that
/// the others stay readable.
pub(super) fn vertical_range(bins: &[PanelBin], has_effect: bool) -> [f64; 2] {
    let sides = |bin: &PanelBin| {
        let after = if has_effect { bin.after_n_per_kn } else { bin.before_n_per_kn };
        [bin.before_n_per_kn, after]
    };
    let all: Vec<(f64, f64)> = bins.iter().flat_map(sides).collect();
    let mut halves: Vec<f64> = bins.iter().map(|bin| bin.before_n_per_kn.1).collect();
    halves.sort_unstable_by(f64::total_cmp);
    let usual = 1.5 * halves[halves.len() * 3 / 4];
    let whiskers = all.iter().flat_map(|(mean, half)| {
        let shown = half.min(usual);
        [mean - shown, mean + shown]
    });
    range_with_zero(whiskers.chain(bins.iter().map(|bin| bin.effect_n_per_kn.0)))
}

/// Returns a covariate's name with its unit.
pub fn axis_title(covariate: Covariate) -> String {
    match (covariate, covariate.unit()) {
        (Covariate::Run, _) => "Fit run, by number".into(),
        (_, "") => covariate.title().into(),
        (_, unit) => format!("{}, {unit}", covariate.title()),
    }
}

fn points(
    chart: &mut Chart,
    points: impl Iterator<Item = (f64, (f64, f64))> + Clone,
    colour: RGBColor,
    is_filled: bool,
) -> Result<(), DrawError> {
    let whisker = |(at, (mean, half)): (f64, (f64, f64))| {
        PathElement::new(vec![(at, mean - half), (at, mean + half)], stroke(colour, 1.2))
    };
    chart.draw_series(points.clone().filter(|point| point.1.1 > 0.0).map(whisker))?;
    let style = if is_filled { colour.filled() } else { stroke(colour, 1.6) };
    chart.draw_series(points.map(|(at, (mean, _))| Circle::new((at, mean), 3 * SCALE, style)))?;
    Ok(())
}

/// Returns the description of the plot for readers who do not see it.
fn label(panel: &Panel, has_effect: bool) -> String {
    let largest = |value: fn(&PanelBin) -> f64| {
        panel.bins.iter().map(|bin| value(bin).abs()).fold(0.0, f64::max)
    };
    let before = largest(|bin| bin.before_n_per_kn.0);
    let of_run = panel.file.as_ref().map_or(String::new(), |file| format!(" of {file}"));
    let title = axis_title(panel.covariate);
    let mut text = format!(
        "Missing resistance against {title}{of_run}, {} bins: at most {before:.2} N/kN",
        panel.bins.len()
    );
    if has_effect {
        let after = largest(|bin| bin.after_n_per_kn.0);
        text += &format!(" before and {after:.2} N/kN after the effect is added");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn panel() -> Panel {
        let bin = |k: f64| PanelBin {
            at: k,
            count: 5,
            before_n_per_kn: (0.2 * k, 0.1),
            after_n_per_kn: (0.01, 0.1),
            effect_n_per_kn: (0.2 * k, 0.05),
        };
        let bins = (0..8).map(|k| bin(f64::from(k))).collect();
        Panel { covariate: Covariate::Chainage, file: None, bins, acting: vec![[2.0, 4.0]] }
    }

    #[test]
    fn both_sides_have_a_point_and_a_whisker_for_each_bin() {
        let svg = draw(&panel(), None, true).unwrap().svg;
        assert_eq!(svg.matches("<circle").count(), 16);
        assert_eq!(svg.matches("<polygon").count(), 1);
        assert!(svg.contains("Chainage, km") && svg.contains("fill=\"#E4EEF7\""));
        assert!(svg.contains("at most 1.40 N/kN before and 0.01 N/kN after"));
    }

    #[test]
    fn times_that_count_from_1970_are_shown_from_their_start_with_its_date() {
        let mut of_run = Panel { covariate: Covariate::TimeInRun(0), ..panel() };
        of_run.bins.iter_mut().for_each(|bin| bin.at += 1_738_479_600.0);
        let plot = draw(&of_run, None, true).unwrap();
        assert!(plot.svg.contains("Time since 2025-02-02T07:00:00Z, s"), "{}", plot.svg);
        assert_eq!(plot.readings[0].at[..2], [0.0, 1.0]);
        let from_start = Panel { covariate: Covariate::TimeInRun(0), ..panel() };
        assert!(draw(&from_start, None, true).unwrap().svg.contains("Time in the run, s"));
    }

    #[test]
    fn without_an_effect_there_is_no_after() {
        let svg = draw(&panel(), None, false).unwrap().svg;
        assert_eq!(svg.matches("<circle").count(), 8);
        assert!(!svg.contains("after"));
    }
}
