//! A declared line over its chainage: height, gradient, curves and permitted speed, with tunnels and stops.

use dynocar_core::track::{StepProfile, Track};
use plotters::backend::SVGBackend;
use plotters::drawing::IntoDrawingArea;
use plotters::element::{PathElement, Text};
use plotters::style::text_anchor::{HPos, VPos};

use super::axes::{Axis, Chart, chart, letters, padded, range_with_zero, shade, stroke, zero_line};
use super::{AFTER, AXIS, PlotError, SCALE, for_page};

/// Nominal width in px.
const WIDTH: u32 = 980;
/// Nominal height in px of each panel.
const HEIGHT: u32 = 190;
/// Nominal width in px of the letters of a stop's name, and of the gap to the next.
const LETTER_PX: f64 = 7.0;
const GAP_PX: f64 = 10.0;
/// Curves so near in m to each other follow without straight track between them.
const JOINED_M: f64 = 0.1;

/// One property of the line.
struct Panel {
    title: &'static str,
    /// (chainage in km, value).
    points: Vec<(f64, f64)>,
}

/// The line as SVG; `None` where nothing of it is known that could be drawn.
///
/// # Errors
///
/// When the drawing fails.
pub fn draw(track: &Track) -> Result<Option<String>, PlotError> {
    let Some(ends_m) = ends_m(track) else { return Ok(None) };
    let panels = panels(track, ends_m);
    if panels.is_empty() {
        return Ok(None);
    }
    let size = (WIDTH * SCALE, HEIGHT * SCALE * panels.len() as u32);
    let mut drawing = String::new();
    {
        let whole = SVGBackend::with_string(&mut drawing, size).into_drawing_area();
        let areas = whole.split_evenly((panels.len(), 1));
        let x = padded(ends_m.into_iter().map(|at_m| at_m / 1e3), 0.005);
        let tunnels: Vec<[f64; 2]> =
            track.tunnels().iter().map(|it| [it.start_m / 1e3, it.end_m / 1e3]).collect();
        let below = x_title(track);
        for (index, (panel, area)) in panels.iter().zip(&areas).enumerate() {
            let mut y = range_with_zero(panel.points.iter().map(|point| point.1));
            if panel.points.iter().all(|point| point.1 >= 0.0) {
                y[0] = 0.0;
            }
            let is_last = index + 1 == panels.len();
            let title = if is_last { below.as_str() } else { "" };
            let x_axis = Axis { range: x, title, labels: 10, is_whole: false };
            let y_axis = Axis { range: y, title: panel.title, labels: 5, is_whole: false };
            let mut chart = chart(area, &x_axis, &y_axis)?;
            shade(&mut chart, &tunnels, x, y)?;
            zero_line(&mut chart, x)?;
            stops(&mut chart, track, x, y, index == 0)?;
            chart.draw_series([PathElement::new(panel.points.clone(), stroke(AFTER, 1.4))])?;
        }
        whole.present()?;
    }
    Ok(Some(for_page(&drawing, &label(track, &panels), "wide", size)))
}

/// The first and the last chainage in m that something is known of.
fn ends_m(track: &Track) -> Option<[f64; 2]> {
    let survey = track.survey();
    let starts = |profile: Option<&StepProfile>| -> Vec<f64> {
        profile.map_or_else(Vec::new, |it| it.entries().map(|entry| entry.0).collect())
    };
    let mut all = starts(track.gradient());
    all.extend(starts(survey.permitted_speed_mps.as_ref()));
    all.extend(track.curves().iter().flat_map(|it| [it.start_m, it.end_m]));
    all.extend(track.tunnels().iter().flat_map(|it| [it.start_m, it.end_m]));
    all.extend(survey.stops.iter().map(|stop| stop.0));
    let low_m = all.iter().copied().min_by(f64::total_cmp)?;
    let high_m = all.iter().copied().max_by(f64::total_cmp)?;
    Some([low_m, track.length_m.map_or(high_m, |length_m| high_m.max(low_m + length_m))])
}

fn panels(track: &Track, ends_m: [f64; 2]) -> Vec<Panel> {
    let mut panels = Vec::new();
    if let Some(profile) = track.gradient() {
        let inside = profile.entries().map(|entry| entry.0).filter(|at_m| *at_m > ends_m[0]);
        let places = [ends_m[0]].into_iter().chain(inside).chain([ends_m[1]]);
        // ‰ times m are mm.
        let height_m = |at_m: f64| profile.integral_to(at_m) - profile.integral_to(ends_m[0]);
        let points = places.map(|at_m| (at_m / 1e3, height_m(at_m) / 1e3)).collect();
        panels.push(Panel { title: "Height above the start, m", points });
        panels.push(Panel { title: "Gradient, ‰", points: steps(profile, ends_m, 1.0) });
    }
    if track.knows_curves() {
        panels.push(Panel { title: "Curvature 1/R, 1/km", points: curvature(track, ends_m) });
    }
    if let Some(permitted) = &track.survey().permitted_speed_mps {
        let points = steps(permitted, ends_m, 3.6);
        panels.push(Panel { title: "Permitted speed, km/h", points });
    }
    panels
}

/// A step profile with its corners.
fn steps(profile: &StepProfile, [from_m, to_m]: [f64; 2], factor: f64) -> Vec<(f64, f64)> {
    let mut points = vec![(from_m / 1e3, factor * profile.value_at(from_m))];
    let mut before = points[0].1;
    for (at_m, value) in profile.entries().filter(|entry| entry.0 > from_m) {
        points.push((at_m / 1e3, before));
        before = factor * value;
        points.push((at_m / 1e3, before));
    }
    points.push((to_m / 1e3, before));
    points
}

fn curvature(track: &Track, ends_m: [f64; 2]) -> Vec<(f64, f64)> {
    let mut curves = track.curves().to_vec();
    curves.sort_by(|one, other| one.start_m.total_cmp(&other.start_m));
    let mut points = vec![(ends_m[0] / 1e3, 0.0)];
    for (index, curve) in curves.iter().enumerate() {
        let per_km = 1e3 / curve.radius_m;
        let is_joined = |from_m: f64, to_m: f64| (to_m - from_m).abs() < JOINED_M;
        if index == 0 || !is_joined(curves[index - 1].end_m, curve.start_m) {
            points.push((curve.start_m / 1e3, 0.0));
        }
        points.push((curve.start_m / 1e3, per_km));
        points.push((curve.end_m / 1e3, per_km));
        if curves.get(index + 1).is_none_or(|next| !is_joined(curve.end_m, next.start_m)) {
            points.push((curve.end_m / 1e3, 0.0));
        }
    }
    points.push((ends_m[1] / 1e3, 0.0));
    points
}

/// A line at each stop and, where there is room, its name above.
fn stops(
    chart: &mut Chart,
    track: &Track,
    x: [f64; 2],
    y: [f64; 2],
    has_names: bool,
) -> Result<(), PlotError> {
    let km_per_px = (x[1] - x[0]) / f64::from(WIDTH);
    let mut free_km = f64::NEG_INFINITY;
    for (at_m, name) in &track.survey().stops {
        let at_km = at_m / 1e3;
        let line = vec![(at_km, y[0]), (at_km, y[1])];
        chart.draw_series([PathElement::new(line, stroke(AXIS, 0.6))])?;
        if has_names && at_km >= free_km && !name.is_empty() {
            let style = letters((HPos::Left, VPos::Top));
            chart.draw_series([Text::new(format!(" {name}"), (at_km, y[1]), style)])?;
            let width_px = LETTER_PX * name.chars().count() as f64 + GAP_PX;
            free_km = at_km + km_per_px * width_px;
        }
    }
    Ok(())
}

fn x_title(track: &Track) -> String {
    let mut title = String::from("Chainage, km");
    if !track.survey().stops.is_empty() {
        title += "; upright lines: stops";
    }
    if !track.tunnels().is_empty() {
        title += "; shaded: tunnels";
    }
    title
}

/// What is shown, for those who do not see it.
fn label(track: &Track, panels: &[Panel]) -> String {
    let range = |panel: &Panel| {
        let (low, high) =
            panel.points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |range, it| {
                (range.0.min(it.1), range.1.max(it.1))
            });
        format!("{} from {low:.1} to {high:.1}", panel.title)
    };
    let ranges: Vec<String> = panels.iter().map(range).collect();
    let (stops, tunnels) = (track.survey().stops.len(), track.tunnels().len());
    let line = format!("The line {} over its chainage", track.name);
    format!("{line}: {}; {stops} stops, {tunnels} tunnels", ranges.join("; "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynocar_core::dataset::parse_track;

    const LINE: &str = "[track]\nname = \"A & B\"\nlength_m = 2000\n\
        gradient = [[0, 10.0], [1000, -5.0]]\ncurves = [[500, 700, 400]]\n\
        tunnels = [[1200, 1400]]\nstops = [[0, \"A\"], [10, \"hidden\"], [2000, \"B\"]]\n\
        permitted_speed = [[0, 20], [800, 30]]\n";

    #[test]
    fn a_line_is_drawn_with_all_that_is_known_of_it() {
        let track = parse_track("track.toml", LINE).unwrap();
        let svg = draw(&track).unwrap().expect("something to draw");
        for words in [
            "Height above the start, m",
            "Gradient, ‰",
            "Curvature 1/R, 1/km",
            "Permitted speed, km/h",
            "Chainage, km; upright lines: stops; shaded: tunnels",
            "The line A &amp; B over its chainage: Height above the start, m from 0.0 to 10.0",
            "Gradient, ‰ from -5.0 to 10.0; Curvature 1/R, 1/km from 0.0 to 2.5",
            "Permitted speed, km/h from 72.0 to 108.0; 3 stops, 1 tunnels",
        ] {
            assert!(svg.contains(words), "{words}");
        }
        assert!(!svg.contains("hidden"), "two names would overlap");
        assert!(svg.contains("fill=\"#E4EEF7\""), "tunnels are shaded");
        let joined = LINE.replace("[[500, 700, 400]]", "[[500, 600, 1000], [600, 700, 500]]");
        let track = parse_track("track.toml", &joined).unwrap();
        let corners = [(0.0, 0.0), (0.5, 0.0), (0.5, 1.0), (0.6, 1.0), (0.6, 2.0), (0.7, 2.0)];
        let rest = [(0.7, 0.0), (2.0, 0.0)];
        assert_eq!(curvature(&track, [0.0, 2000.0]), [&corners[..], &rest].concat());
    }

    #[test]
    fn only_what_is_known_is_drawn() {
        let drawn = |text: &str| draw(&parse_track("track.toml", text).unwrap()).unwrap();
        assert_eq!(drawn("[track]\n"), None);
        assert_eq!(drawn("[track]\ntunnels = [[0, 5]]\n"), None);
        let svg = drawn("[track]\ncurves = []\nstops = [[0, \"\"], [900, \"\"]]\n").unwrap();
        assert!(svg.contains("Curvature") && !svg.contains("Gradient"));
        assert!(drawn("[track]\ngradient = [[0, 3]]\n").unwrap().contains("Gradient"));
    }
}
