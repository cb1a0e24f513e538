//! What is declared of a line, as lines over its chainage.

use dynocar_model::track::{StepProfile, Track};

use super::panel::{Content, Panel};
use crate::report::plots::reading::thinned;

/// Curves so near in m to each other follow without straight track between them.
const JOINED_M: f64 = 0.1;

/// The first and the last chainage in m that something is known of.
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

pub(super) fn panels(track: &Track, ends_m: [f64; 2]) -> Vec<Panel> {
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
