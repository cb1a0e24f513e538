//! Following a recording along an alignment: a chainage for each fix.

use super::alignment::{Alignment, Foot, distance_squared};
use super::recording::{Fix, SAME_ALIGNMENT_M, SurveyRecording};
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
