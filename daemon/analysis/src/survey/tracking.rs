//! A chainage for each fix: following a recording along an alignment, with gaps of the fixes filled by the path of
//! another pass.

use super::alignment::{Alignment, Foot, distance_squared};
use super::recording::{Fix, RecordingPart, SAME_ALIGNMENT_M, SurveyRecording};
use crate::statistics::least_first;

/// Window in m around the expected chainage in which a fix is placed.
const WINDOW_M: f64 = 60.0;
/// Share of a difference by which the expected chainage follows the fixes.
const FOLLOWING: f64 = 0.1;
/// Distance in m away from the alignment after which a recording has left it.
const LEFT_AFTER_M: f64 = 300.0;
/// Distance in m over which a recording is compared with an alignment to find it there.
const SEARCH_M: f64 = 400.0;
/// Width in m of the bins in which offsets are counted.
const BIN_M: f64 = 20.0;
/// Distance in m beyond the end of an alignment after which a recording has left it.
const BEYOND_M: f64 = 30.0;

/// A fix placed on an alignment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlacedFix {
    /// Row of the recording.
    pub row: usize,
    /// Chainage in m.
    pub chainage_m: f64,
    /// Distance in m to the left of the alignment.
    pub left_m: f64,
}

/// Places the fixes of some rows on an alignment that is driven in its own direction: the longest part
/// without leaving it.
pub fn follow(
    recording: &SurveyRecording,
    rows: std::ops::Range<usize>,
    alignment: &Alignment,
) -> Vec<PlacedFix> {
    let fixes = &recording.fixes;
    let first = fixes.partition_point(|fix| fix.row < rows.start);
    let end = fixes.partition_point(|fix| fix.row < rows.end);
    let (mut longest, mut covered_m) = (Vec::new(), 0.0);
    let mut from = first;
    while let Some((start, offset_m)) = found(recording, &fixes[..end], from, alignment) {
        let (placed, next) = follow_from(recording, &fixes[..end], start, offset_m, alignment);
        let length_m = match (placed.first(), placed.last()) {
            (Some(one), Some(other)) => other.chainage_m - one.chainage_m,
            _ => 0.0,
        };
        if length_m > covered_m {
            (longest, covered_m) = (placed, length_m);
        }
        from = next.max(start + 1);
    }
    longest
}

fn follow_from(
    recording: &SurveyRecording,
    fixes: &[Fix],
    start: usize,
    offset_m: f64,
    alignment: &Alignment,
) -> (Vec<PlacedFix>, usize) {
    let mut placed: Vec<PlacedFix> = Vec::new();
    let mut offset_m = offset_m;
    let mut seen_at_m = recording.travelled_m[fixes[start].row];
    for (index, fix) in fixes.iter().enumerate().skip(start) {
        let travelled_m = recording.travelled_m[fix.row];
        let expected_m = travelled_m + offset_m;
        if expected_m > alignment.length_m() + BEYOND_M {
            return (placed, index);
        }
        if expected_m < -BEYOND_M {
            continue;
        }
        let beside = alignment.beside(fix.at_m, expected_m - WINDOW_M, expected_m + WINDOW_M);
        if beside.left_m.abs() < SAME_ALIGNMENT_M {
            let difference_m = (beside.chainage_m - expected_m).clamp(-10.0, 10.0);
            offset_m += FOLLOWING * difference_m;
            seen_at_m = travelled_m;
            let Foot { chainage_m, left_m } = beside;
            placed.push(PlacedFix { row: fix.row, chainage_m, left_m });
        } else if travelled_m - seen_at_m > LEFT_AFTER_M {
            return (placed, index);
        }
    }
    (placed, fixes.len())
}

/// Returns the first fix from which a recording follows an alignment for a while, and the difference in m between
/// chainage and distance travelled there.
fn found(
    recording: &SurveyRecording,
    fixes: &[Fix],
    from: usize,
    alignment: &Alignment,
) -> Option<(usize, f64)> {
    let offsets: Vec<Option<Vec<f64>>> =
        (from..fixes.len()).map(|index| offsets(recording, fixes, index, alignment)).collect();
    let travelled_m = |index: usize| recording.travelled_m[fixes[index].row];
    let mut start = from;
    while start < fixes.len() {
        if offsets[start - from].as_ref().is_none_or(Vec::is_empty) {
            start += 1;
            continue;
        }
        let ahead = (start..fixes.len())
            .take_while(|&index| travelled_m(index) - travelled_m(start) < SEARCH_M);
        let heading: Vec<&Vec<f64>> =
            ahead.filter_map(|index| offsets[index - from].as_ref()).collect();
        let candidates = offsets[start - from].clone().unwrap_or_default();
        let support = |offset: f64| {
            let near = |list: &&&Vec<f64>| list.iter().any(|other| (other - offset).abs() < BIN_M);
            heading.iter().filter(near).count()
        };
        let best = candidates.iter().copied().map(|offset| (support(offset), offset));
        let best = best.max_by(|one, other| one.0.cmp(&other.0));
        if let Some((count, offset)) = best
            && heading.len() >= 5
            && 10 * count >= 7 * heading.len()
        {
            return Some((start, offset));
        }
        // Two points of the alignment further on, rather than every fix of a stand.
        let here_m = travelled_m(start);
        start += 1;
        while start < fixes.len() && travelled_m(start) - here_m < BIN_M {
            start += 1;
        }
    }
    None
}

/// Returns the differences in m between chainage and distance travelled that a fix may have: one for each place of the
/// alignment near the fix where it moves along the alignment; `None` while it stands.
fn offsets(
    recording: &SurveyRecording,
    fixes: &[Fix],
    index: usize,
    alignment: &Alignment,
) -> Option<Vec<f64>> {
    let (one, other) = (index.saturating_sub(3), (index + 3).min(fixes.len() - 1));
    let moved_m = recording.travelled_m[fixes[other].row] - recording.travelled_m[fixes[one].row];
    let (from, to) = (fixes[one].at_m, fixes[other].at_m);
    let length_m = distance_squared(from, to).sqrt();
    if moved_m < 10.0 || length_m < 10.0 {
        return None;
    }
    let along = [(to[0] - from[0]) / length_m, (to[1] - from[1]) / length_m];
    let fix = fixes[index];
    let mut near: Vec<(usize, f64)> = alignment
        .nodes_near(fix.at_m, SAME_ALIGNMENT_M)
        .filter(|&(node, _)| {
            let [x, y] = alignment.direction(node as f64 * alignment.step_m());
            x * along[0] + y * along[1] > 0.6
        })
        .collect();
    least_first(&mut near, |it| it.1);
    let mut offsets: Vec<f64> = Vec::new();
    for (node, _) in near {
        let offset = node as f64 * alignment.step_m() - recording.travelled_m[fix.row];
        if offsets.iter().all(|known| (known - offset).abs() > 2.0 * WINDOW_M) {
            offsets.push(offset);
        }
    }
    Some(offsets)
}

/// Distance in m between fixes along the path above which the path between them is open.
pub const GAP_MAX_M: f64 = 150.0;
/// Greatest length of a path that fills a gap, as a multiple of the straight line between its ends.
const DETOUR_MAX: f64 = 3.0;

/// A point on the path of a part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TracePoint {
    /// East and north in m.
    pub at_m: [f64; 2],
    /// True where no fix shows the point, only a straight line over a gap.
    pub is_open: bool,
}

/// Points every `step_m` along a part.
pub fn trace(part: &RecordingPart, recordings: &[SurveyRecording], step_m: f64) -> Vec<TracePoint> {
    let recording = &recordings[part.recording];
    let silences: Vec<(f64, f64)> = recording
        .fixes
        .windows(2)
        .map(|pair| (recording.travelled_m[pair[0].row], recording.travelled_m[pair[1].row]))
        .filter(|(from_m, to_m)| to_m - from_m > GAP_MAX_M)
        .collect();
    let is_open = |travelled_m: f64| {
        let next = silences.partition_point(|silence| silence.1 <= travelled_m);
        silences.get(next).is_some_and(|silence| silence.0 < travelled_m)
    };
    let points = recording.points(step_m).into_iter();
    let within = points.filter(|point| (part.from_m..=part.to_m).contains(&point.0));
    within.map(|(travelled_m, at_m)| TracePoint { at_m, is_open: is_open(travelled_m) }).collect()
}

/// Returns the path of one trace, with its gaps filled from the other traces by the shortest path between the ends of
/// each gap. A gap that no other trace covers stays a straight line.
pub fn filled(one: usize, traces: &[Vec<TracePoint>]) -> Vec<[f64; 2]> {
    let own = &traces[one];
    let mut path: Vec<[f64; 2]> = Vec::with_capacity(own.len());
    let mut next = 0;
    while next < own.len() {
        let end = (next..own.len()).find(|&at| !own[at].is_open).unwrap_or(own.len());
        let straight = own[next..end].iter().map(|point| point.at_m);
        if end > next && next > 0 && end < own.len() {
            let ends = [own[next - 1].at_m, own[end].at_m];
            let others = traces.iter().enumerate().filter(|(other, _)| *other != one);
            let paths = others.filter_map(|(_, trace)| between(ends, trace));
            let shortest = paths.min_by(|one, other| one.0.total_cmp(&other.0));
            match shortest {
                Some((_, inside)) => path.extend(inside),
                None => path.extend(straight),
            }
        } else {
            path.extend(straight);
        }
        path.extend(own.get(end).map(|point| point.at_m));
        next = end + 1;
    }
    path
}

/// Returns the length in m and the points of a trace's path between two places, driven in either direction; `None`
/// where the trace itself has a gap there.
fn between(ends: [[f64; 2]; 2], trace: &[TracePoint]) -> Option<(f64, Vec<[f64; 2]>)> {
    let nearest = |place: [f64; 2]| {
        let distances =
            trace.iter().enumerate().map(|(at, it)| (at, distance_squared(it.at_m, place)));
        let (at, squared) = distances.min_by(|one, other| one.1.total_cmp(&other.1))?;
        (squared < SAME_ALIGNMENT_M * SAME_ALIGNMENT_M).then_some(at)
    };
    let (from, to) = (nearest(ends[0])?, nearest(ends[1])?);
    let inside = &trace[from.min(to)..=from.max(to)];
    if inside.iter().any(|point| point.is_open) {
        return None;
    }
    let mut points: Vec<[f64; 2]> = inside.iter().map(|point| point.at_m).collect();
    if to < from {
        points.reverse();
    }
    let length_m: f64 =
        points.windows(2).map(|pair| distance_squared(pair[0], pair[1]).sqrt()).sum();
    let straight_m = distance_squared(ends[0], ends[1]).sqrt();
    (length_m < DETOUR_MAX * straight_m).then_some((length_m, points))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a quarter of a circle with a radius of 1 km less `left_m`, about 20 m from point to point.
    fn quarter(left_m: f64, open: std::ops::Range<usize>) -> Vec<TracePoint> {
        let point = |k: usize| {
            let angle = 0.02 * k as f64;
            let radius_m = 1000.0 - left_m;
            let at_m = [radius_m * angle.sin(), radius_m * (1.0 - angle.cos())];
            TracePoint { at_m, is_open: open.contains(&k) }
        };
        (0..79).map(point).collect()
    }

    /// Returns the same with a straight line over the open points.
    fn silent(open: std::ops::Range<usize>) -> Vec<TracePoint> {
        let mut trace = quarter(0.0, open.clone());
        let (from, to) = (trace[open.start - 1].at_m, trace[open.end].at_m);
        for k in open.clone() {
            let share = (k + 1 - open.start) as f64 / (open.len() + 1) as f64;
            trace[k].at_m = [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis]));
        }
        trace
    }

    fn farthest_from_circle_m(path: &[[f64; 2]]) -> f64 {
        let off = |at: &[f64; 2]| (at[0].hypot(1000.0 - at[1]) - 1000.0).abs();
        path.iter().map(off).fold(0.0, f64::max)
    }

    #[test]
    fn a_silence_is_filled_from_a_pass_of_either_direction_that_heard_more() {
        let mut back = quarter(4.0, 60..70);
        back.reverse();
        let traces = [silent(20..50), quarter(2.0, 40..45), back];
        assert!(farthest_from_circle_m(&silent(20..50).map_at()) > 40.0);
        let path = filled(0, &traces);
        assert!(farthest_from_circle_m(&path) < 5.0, "{}", farthest_from_circle_m(&path));
        let steps = path.windows(2).map(|pair| distance_squared(pair[0], pair[1]).sqrt());
        assert!(steps.fold(0.0, f64::max) < 45.0, "no jump");
    }

    #[test]
    fn where_nobody_heard_the_straight_line_stays() {
        let traces = [silent(20..50), quarter(0.0, 30..35)];
        assert_eq!(filled(0, &traces), traces[0].map_at());
    }

    trait MapAt {
        fn map_at(&self) -> Vec<[f64; 2]>;
    }

    impl MapAt for Vec<TracePoint> {
        fn map_at(&self) -> Vec<[f64; 2]> {
            self.iter().map(|point| point.at_m).collect()
        }
    }
}
