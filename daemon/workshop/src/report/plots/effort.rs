//! The greatest forces of a train over the speed, with its resistance.

use dynocar_model::train::{EffortCurve, TrainModel};
use plotters::element::{PathElement, Text};
use plotters::style::RGBColor;
use plotters::style::text_anchor::{HPos, VPos};

use super::axes::{Axis, chart, letters, range_with_zero, stroke};
use super::picture::{AFTER, BEFORE, MEASURED, PlotError, SCALE, picture};

/// Nominal size in px.
const SIZE: (u32, u32) = (980, 380);
/// Nominal width in px of a letter of the legend.
const LETTER_PX: f64 = 7.0;
/// Greatest speed in m/s drawn where the curves give none.
const SPEED_MPS: f64 = 40.0;
/// Number of points of the resistance curve.
const POINTS: u32 = 100;

/// A curve of (km/h, kN) with its name and colour.
type NamedCurve = (&'static str, RGBColor, Vec<(f64, f64)>);

/// Returns the curves as SVG; `None` for a train without any.
///
/// # Errors
///
/// When the drawing fails.
pub fn draw(train: &TrainModel) -> Result<Option<String>, PlotError> {
    if train.traction.is_none() && train.brake.is_none() {
        return Ok(None);
    }
    let top_mps = train.speed_max_mps().filter(|top| *top > 0.0).unwrap_or(SPEED_MPS);
    let mut lines: Vec<NamedCurve> = Vec::new();
    for (name, colour, curve) in
        [("traction", AFTER, &train.traction), ("brake", BEFORE, &train.brake)]
    {
        lines.extend(curve.as_ref().map(|curve| (name, colour, points(curve, top_mps))));
    }
    lines.push(("resistance on level track", MEASURED, resistance(train, top_mps)));
    let svg = picture(&label(train, top_mps), "wide", SIZE, |area| {
        let forces = lines.iter().flat_map(|line| line.2.iter().map(|point| point.1));
        let y = [0.0, range_with_zero(forces)[1]];
        let x = [0.0, 1.02 * 3.6 * top_mps];
        let x_axis = Axis { range: x, title: "Speed, km/h", labels: 10, is_whole: true };
        let y_axis = Axis { range: y, title: "Force, kN", labels: 6, is_whole: false };
        let mut chart = chart(area, &x_axis, &y_axis)?;
        let mut right_px = f64::from(SIZE.0) - 12.0;
        for (name, colour, points) in lines.iter().rev() {
            chart.draw_series([PathElement::new(points.clone(), stroke(*colour, 1.6))])?;
            let place = ((right_px * f64::from(SCALE)) as i32, 4 * SCALE as i32);
            let style = letters((HPos::Right, VPos::Top)).color(colour);
            area.draw(&Text::new((*name).to_string(), place, style))?;
            right_px -= LETTER_PX * (name.len() + 3) as f64;
        }
        Ok(Vec::new())
    });
    svg.map(Some)
}

/// Returns the curve from standstill to a speed, as (km/h, kN).
fn points(curve: &EffortCurve, top_mps: f64) -> Vec<(f64, f64)> {
    let inside = curve.points().iter().map(|point| point.0).filter(|it| *it > 0.0 && *it < top_mps);
    let speeds = [0.0].into_iter().chain(inside).chain([top_mps]);
    speeds.map(|speed| (3.6 * speed, curve.force_n(speed) / 1e3)).collect()
}

fn resistance(train: &TrainModel, top_mps: f64) -> Vec<(f64, f64)> {
    let weight_kn = TrainModel::weight_kn(train.mass_kg);
    let at = |step: u32| {
        let speed_mps = top_mps * f64::from(step) / f64::from(POINTS);
        (3.6 * speed_mps, train.resistance.w0_n_per_kn(speed_mps) * weight_kn / 1e3)
    };
    (0..=POINTS).map(at).collect()
}

/// Returns the description of the plot for readers who do not see it.
fn label(train: &TrainModel, top_mps: f64) -> String {
    let most = |name: &str, curve: &Option<EffortCurve>| match curve {
        Some(curve) => format!("; {name} up to {:.1} kN", curve.force_max_n() / 1e3),
        None => String::new(),
    };
    let (name, top_kmh) = (&train.name, 3.6 * top_mps);
    let (traction, brake) = (most("traction", &train.traction), most("brake", &train.brake));
    format!("Greatest forces of {name} up to {top_kmh:.0} km/h{traction}{brake}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynocar_analysis::dataset::parse_train;

    const TRAIN: &str = "[train]\nname = \"<T>\"\nmass_t = 100\nlength_m = 50\n\
        rotating_mass_factor = 0.1\n[resistance]\na = 1\nb = 0.01\nc = 0.001\n";

    #[test]
    fn effort_and_resistance_are_drawn_and_reported() {
        let text = format!(
            "{TRAIN}[traction]\neffort = [[0, 80.0], [25.0, 30.0]]\n[brake]\nmax_force_kn = 90\n"
        );
        let train = parse_train("train.toml", &text).unwrap();
        let svg = draw(&train).unwrap().expect("curves");
        for words in ["Speed, km/h", "Force, kN", "traction", "brake", "resistance on level track"]
        {
            assert!(svg.contains(words), "{words}");
        }
        let label = "Greatest forces of &lt;T&gt; up to 90 km/h; traction up to 80.0 kN; brake up to \
                     90.0 kN";
        assert!(svg.contains(label), "{svg}");
        // Beyond its end a curve holds.
        assert_eq!(points(train.brake.as_ref().unwrap(), 25.0), [(0.0, 90.0), (90.0, 90.0)]);
    }

    #[test]
    fn a_train_without_curves_is_not_drawn() {
        assert_eq!(draw(&parse_train("train.toml", TRAIN).unwrap()).unwrap(), None);
    }
}
