//! The declared and the found properties of a line: their data, their range, their readings at a pointer.

use dynocar_analysis::explain::report::panels::PanelBin;
use dynocar_analysis::explain::report::residual_line::{AlongLine, MarkedInterval};
use dynocar_model::track::{StepProfile, Track};
use dynocar_model::words::stretch;
use plotters::element::{PathElement, Rectangle, Text};
use plotters::style::Color;
use plotters::style::text_anchor::{HPos, VPos};

use crate::report::plots::axes::{Chart, letters, range_with_zero, stroke};
use crate::report::plots::panel::{reading, vertical_range};
use crate::report::plots::picture::{ACTING, AFTER, DrawError};
use crate::report::plots::reading::{PointerReading, thinned};

/// Nominal height in px of a panel, of a panel that shows places only, and of each further row of places.
const HEIGHT: u32 = 190;
const PLACES_HEIGHT: u32 = 90;
const ROW_HEIGHT: u32 = 26;
/// One property of the line.
pub(super) struct Panel {
    pub name: String,
    pub unit: &'static str,
    pub content: Content,
}

pub(super) enum Content {
    /// (Chainage in km, value), and half widths of 95 % intervals where they are known.
    Line { points: Vec<(f64, f64)>, halves: Vec<f64> },
    /// Where an effect was found.
    Places(Vec<MarkedInterval>),
    /// The residual for travel towards growing (+1) or falling (−1) chainage.
    Means(f64, Vec<PanelBin>),
}

impl Panel {
    pub fn title(&self) -> String {
        if self.unit.is_empty() {
            self.name.clone()
        } else {
            format!("{}, {}", self.name, self.unit)
        }
    }

    pub fn height(&self) -> u32 {
        match &self.content {
            Content::Places(sections) => {
                PLACES_HEIGHT + ROW_HEIGHT * (rows(sections).len() as u32 - 1)
            }
            _ => HEIGHT,
        }
    }

    pub fn range(&self, has_effect: bool) -> [f64; 2] {
        match &self.content {
            Content::Places(_) => [0.0, 1.0],
            Content::Means(_, bins) => vertical_range(bins, has_effect),
            Content::Line { points, .. } => {
                let mut y = range_with_zero(points.iter().map(|point| point.1));
                if points.iter().all(|point| point.1 >= 0.0) {
                    y[0] = 0.0;
                }
                y
            }
        }
    }

    pub fn reading(&self, has_effect: bool) -> PointerReading {
        match &self.content {
            Content::Places(_) => PointerReading::new("Chainage", "km", false, Vec::new()),
            Content::Means(direction, bins) => {
                let mut reading = reading("Chainage", "km", bins, has_effect);
                // Points that are not drawn are not read.
                reading.series.truncate(1 + usize::from(has_effect));
                let direction_label = direction_label(*direction);
                reading.series.iter_mut().for_each(|it| it.name += &format!(", {direction_label}"));
                reading
            }
            Content::Line { points, halves } => {
                let (at, values) = points.iter().copied().unzip();
                let reading = PointerReading::new("Chainage", "km", false, at);
                reading.with(&self.name[..], self.unit, values, halves.clone())
            }
        }
    }

    /// Returns the description of the panel for readers who do not see it.
    pub fn described(&self) -> String {
        match &self.content {
            Content::Places(sections) => format!("{} {}", self.name, described(sections)),
            Content::Means(_, bins) => {
                let most = bins.iter().map(|bin| bin.before_n_per_kn.0.abs()).fold(0.0, f64::max);
                format!("{}: at most {most:.2} N/kN", self.name)
            }
            Content::Line { points, .. } => {
                let values = || points.iter().map(|point| point.1);
                let low = values().fold(f64::INFINITY, f64::min);
                let high = values().fold(f64::NEG_INFINITY, f64::max);
                format!("{} from {low:.1} to {high:.1}", self.title())
            }
        }
    }
}

/// Returns a direction of travel, in words.
pub(super) fn direction_label(direction: f64) -> &'static str {
    if direction > 0.0 { "growing chainage" } else { "falling chainage" }
}

/// Returns the rows of a panel of places: one row for the places of all runs, and one for each run that has places of
/// its own.
pub(super) fn rows(sections: &[MarkedInterval]) -> Vec<Option<&str>> {
    let mut rows: Vec<Option<&str>> = sections.iter().map(|it| it.run.as_deref()).collect();
    rows.sort_unstable();
    rows.dedup();
    rows
}

/// Returns the sections in words.
pub(super) fn described(sections: &[MarkedInterval]) -> String {
    let one = |it: &MarkedInterval| {
        let run = it.run.as_ref().map_or(String::new(), |run| format!(" in {run}"));
        stretch(it.at_m) + &run
    };
    sections.iter().map(one).collect::<Vec<_>>().join(", ")
}

/// Curves so near in m to each other follow without straight track between them.
const JOINED_M: f64 = 0.1;

/// Returns the first and the last chainage in m that something is known of.
pub(super) fn ends_m(track: &Track) -> Option<[f64; 2]> {
    let survey = &track.survey;
    let starts = |profile: Option<&StepProfile>| -> Vec<f64> {
        profile.map_or_else(Vec::new, |it| it.entries().map(|entry| entry.0).collect())
    };
    let mut all = starts(track.gradient());
    all.extend(starts(survey.gradient_falling.as_ref()));
    all.extend(starts(survey.permitted_speed_mps.as_ref()));
    all.extend(track.curves().iter().flat_map(|it| [it.start_m, it.end_m]));
    all.extend(track.tunnels().iter().flat_map(|it| [it.start_m, it.end_m]));
    all.extend(survey.stops.iter().map(|stop| stop.0));
    let low_m = all.iter().copied().min_by(f64::total_cmp)?;
    let high_m = all.iter().copied().max_by(f64::total_cmp)?;
    Some([low_m, track.length_m.map_or(high_m, |length_m| high_m.max(low_m + length_m))])
}

pub(super) fn declared(track: &Track, ends_m: [f64; 2]) -> Vec<Panel> {
    let mut panels = Vec::new();
    let mut push = |name: &str, unit: &'static str, points: Vec<(f64, f64)>| {
        let content = Content::Line { points: thinned(points), halves: Vec::new() };
        panels.push(Panel { name: name.into(), unit, content });
    };
    if let Some(profile) = track.gradient() {
        let inside = profile.entries().map(|entry| entry.0).filter(|at_m| *at_m > ends_m[0]);
        let places = [ends_m[0]].into_iter().chain(inside).chain([ends_m[1]]);
        // ‰ times m are mm.
        let height_m = |at_m: f64| profile.integral_to(at_m) - profile.integral_to(ends_m[0]);
        let points = places.map(|at_m| (at_m / 1e3, height_m(at_m) / 1e3)).collect();
        push("Height above the start", "m", points);
        push("Gradient", "‰", steps(profile, ends_m, 1.0));
    }
    if let Some(falling) = &track.survey.gradient_falling {
        push("Gradient of the way of falling chainage", "‰", steps(falling, ends_m, 1.0));
    }
    if track.knows_curves() {
        push("Curvature 1/R", "1/km", curvature(track, ends_m));
    }
    if let Some(permitted) = &track.survey.permitted_speed_mps {
        push("Permitted speed", "km/h", steps(permitted, ends_m, 3.6));
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

pub(super) fn curvature(track: &Track, ends_m: [f64; 2]) -> Vec<(f64, f64)> {
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

/// Returns the panels below those of the declared line.
pub(super) fn found(found: &AlongLine) -> Vec<Panel> {
    let mut panels = Vec::new();
    let mut push = |name: String, unit: &'static str, content: Content| {
        panels.push(Panel { name, unit, content });
    };
    for place in &found.places {
        let content = Content::Places(place.sections.clone());
        push(format!("Found: {}", place.name), "", content);
    }
    if !found.gradient_error.is_empty() {
        let nodes = found.gradient_error.iter();
        let (points, halves) =
            nodes.map(|[at_m, value, half]| ((at_m / 1e3, *value), *half)).unzip();
        push("Error of the gradient, found".into(), "‰", Content::Line { points, halves });
    }
    for (direction, bins) in &found.residual {
        let name = format!("Missing resistance, {}", direction_label(*direction));
        push(name, "N/kN", Content::Means(*direction, bins.clone()));
    }
    panels
}

/// Bars where an effect was found, the first row on top, with whiskers where their ends may lie.
pub(super) fn bars(
    chart: &mut Chart,
    sections: &[MarkedInterval],
    from_km: f64,
) -> Result<(), DrawError> {
    let rows = rows(sections);
    let height = 1.0 / rows.len() as f64;
    for (row, run) in rows.iter().enumerate() {
        let at = |share: f64| 1.0 - (row as f64 + share) * height;
        for MarkedInterval { at_m, ends_m, .. } in
            sections.iter().filter(|it| it.run.as_deref() == *run)
        {
            let [from, to] = at_m.map(|end| end / 1e3);
            let (top, bottom) = (at(0.25), at(0.75));
            chart.draw_series([Rectangle::new([(from, bottom), (to, top)], ACTING.filled())])?;
            let corners = [(from, top), (to, top), (to, bottom), (from, bottom), (from, top)];
            chart.draw_series([PathElement::new(corners.to_vec(), stroke(AFTER, 1.0))])?;
            for [low, high] in ends_m.iter().flatten().map(|ends| ends.map(|end| end / 1e3)) {
                let across = [(low, at(0.5)), (high, at(0.5))];
                let ends = [low, high].map(|end| [(end, at(0.1)), (end, at(0.9))]);
                let strokes = [across, ends[0], ends[1]].map(|line| line.to_vec());
                let style = stroke(AFTER, 1.6);
                chart.draw_series(strokes.map(|line| PathElement::new(line, style)))?;
            }
        }
        let style = letters((HPos::Left, VPos::Center));
        let name = run.map(|run| Text::new(format!("\u{2002}{run}"), (from_km, at(0.5)), style));
        chart.draw_series(name)?;
    }
    Ok(())
}
