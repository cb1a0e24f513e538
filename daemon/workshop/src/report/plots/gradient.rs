//! A surveyed gradient over the chainage, with its 95 % band.

use dynocar_shared::HALF_95;
use plotters::element::PathElement;

use super::axes::{Axis, band, chart, frame, padded, range_with_zero, stroke, zero_line};
use super::reading::Reading;
use super::speeds::Width;
use super::{AFTER, Plot, PlotError, picture};

/// A profile of (chainage in m, gradient in ‰, its standard deviation in ‰) as SVG.
///
/// # Errors
///
/// When the drawing fails.
pub fn draw(entries: &[(f64, f64, f64)], direction: &str, width: Width) -> Result<Plot, PlotError> {
    let (nominal, height, _) = width.size();
    let halves: Vec<f64> = entries.iter().map(|entry| HALF_95 * entry.2).collect();
    let (low, high) = entries.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |range, entry| {
        (range.0.min(entry.1), range.1.max(entry.1))
    });
    let label = format!("Gradient over the chainage for {direction}: from {low:.1} to {high:.1} ‰");
    let svg = picture(&label, width.class(), (nominal, height + 60), |area| {
        let x = padded(entries.iter().map(|entry| entry.0 / 1e3), 0.005);
        // Where nothing is driven the band is wide: it is cut so that the rest stays readable.
        let y = range_with_zero(entries.iter().map(|entry| entry.1));
        let labels = if width == Width::Wide { 10 } else { 5 };
        let x_axis = Axis { range: x, title: "Chainage, km", labels, is_whole: false };
        let y_axis = Axis { range: y, title: "Gradient, ‰", labels: 6, is_whole: false };
        let mut chart = chart(area, &x_axis, &y_axis)?;
        let line: Vec<(f64, f64)> =
            entries.iter().map(|&(at_m, gradient, _)| (at_m / 1e3, gradient)).collect();
        band(&mut chart, &line, &halves, y)?;
        zero_line(&mut chart, x)?;
        chart.draw_series([PathElement::new(line, stroke(AFTER, 1.2))])?;
        Ok(vec![frame(&chart)])
    })?;
    let at = entries.iter().map(|entry| entry.0 / 1e3).collect();
    let values = entries.iter().map(|entry| entry.1).collect();
    let reading = Reading::new("Chainage", "km", false, at).with("gradient", "‰", values, halves);
    Ok(Plot { svg, readings: vec![reading] })
}
