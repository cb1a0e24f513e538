//! The line that is driven repeatedly, and the parts of recordings that are passes of it.

use super::alignment::{Alignment, distance_squared};
use super::both_directions::{Compared, compare};
use super::centring::{SurveyPass, align};
use super::recording::{RecordingPart, SAME_ALIGNMENT_M, SurveyRecording};
use super::tracking::{TracePoint, filled, follow, trace};
use crate::parallel;

/// Greatest number of parts that are tried as the line, and of parts with which each is compared.
const TRIED_MAX: usize = 12;
/// Greatest number of passes through which the alignment is laid: more make it no better than GNSS itself.
const ALIGNED_MAX: usize = 60;
/// Greatest number of parts among which the line is sought.
const SOUGHT_MAX: usize = 10 * ALIGNED_MAX;
/// Distance in m between the points of a part.
const POINT_STEP_M: f64 = 20.0;
/// Least share of the line that a pass covers, unless it covers `PASS_MIN_M`.
const PASS_SHARE_MIN: f64 = 0.25;
/// Length in m of a pass that is useful on a line of any length.
const PASS_MIN_M: f64 = 1000.0;

/// The alignments of a line, each in its direction of travel.
#[derive(Clone, Debug, PartialEq)]
pub struct Alignments {
    /// For growing chainage; chainage and distance in m are the same.
    pub growing: Alignment,
    /// For falling chainage, where it is driven.
    pub falling: Option<FallingAlignment>,
    /// Metres of chainage for each metre on the plane: 1, unless the wheels are the better measure.
    pub chainage_per_m: f64,
}

/// The alignment for falling chainage.
#[derive(Clone, Debug, PartialEq)]
pub struct FallingAlignment {
    /// The alignment from its own start.
    pub alignment: Alignment,
    /// Chainage in m on the plane at its start.
    pub start_chainage_m: f64,
    /// True when it is the growing alignment the other way round: the same track.
    pub is_same: bool,
}

impl Alignments {
    /// Returns the alignment of a direction.
    pub fn of(&self, direction: i8) -> Option<&Alignment> {
        match direction {
            1 => Some(&self.growing),
            _ => self.falling.as_ref().map(|falling| &falling.alignment),
        }
    }

    /// Returns the chainage in m of a place along the alignment of a direction.
    pub fn chainage_m(&self, direction: i8, along_m: f64) -> f64 {
        let on_plane_m = match (&self.falling, direction) {
            (Some(falling), -1) => falling.start_chainage_m - along_m,
            _ => along_m,
        };
        self.chainage_per_m * on_plane_m
    }

    /// Returns the place in m along the alignment of a direction of a chainage in m: [`Alignments::chainage_m`] turned
    /// round.
    pub fn along_m(&self, direction: i8, chainage_m: f64) -> f64 {
        let on_plane_m = chainage_m / self.chainage_per_m;
        match (&self.falling, direction) {
            (Some(falling), -1) => falling.start_chainage_m - on_plane_m,
            _ => on_plane_m,
        }
    }

    /// Returns the length in m of the line by its chainage.
    pub fn length_m(&self) -> f64 {
        self.chainage_per_m * self.growing.length_m()
    }

    /// Returns whether both directions share one profile.
    pub fn is_one_track(&self) -> bool {
        self.falling.as_ref().is_none_or(|falling| falling.is_same)
    }
}

/// Finds the line among the parts of the fit runs; `None` when there is none.
pub fn find(
    recording_parts: &[RecordingPart],
    recordings: &[SurveyRecording],
) -> Option<Alignments> {
    let fit: Vec<RecordingPart> =
        recording_parts.iter().filter(|it| recordings[it.recording].raw.is_fit).copied().collect();
    // Both directions of a line come in turns.
    let pairs: Vec<&[RecordingPart]> = fit.chunks(2).collect();
    let fit = thinned(&pairs, SOUGHT_MAX / 2).concat();
    let template = template(&fit, recordings)?;
    let back = template.reversed()?;
    let growing = along(&template, 1, &fit, recordings);
    let falling = along(&back, 1, &fit, recordings);
    // The line's chainage grows in the direction in which it was first driven.
    let first = |along: &[(RecordingPart, SurveyPass)]| {
        along.iter().map(|(_, pass)| (pass.recording, pass.rows.start)).min()
    };
    let is_backward = match (first(&growing), first(&falling)) {
        (Some(one), Some(other)) => other < one,
        (one, _) => one.is_none(),
    };
    let [(template, ahead), (reversed_template, back)] = match is_backward {
        true => [(back, falling), (template, growing)],
        false => [(template, growing), (back, falling)],
    };
    let growing = alignment_of(&template, &ahead, recordings);
    let alone = |growing| Alignments { growing, falling: None, chainage_per_m: 1.0 };
    if back.is_empty() {
        return Some(alone(growing));
    }
    let alignment = alignment_of(&reversed_template, &back, recordings);
    let Some(Compared { start_chainage_m, joined }) = compare(&growing, &alignment) else {
        return Some(alone(growing));
    };
    let Some(joined) = joined else {
        let falling = Some(FallingAlignment { alignment, start_chainage_m, is_same: false });
        return Some(Alignments { falling, ..alone(growing) });
    };
    // One track has one alignment and one chainage, and the passes of both directions show it.
    let reversed = joined.reversed()?;
    let passes = [(&joined, 1), (&reversed, -1)]
        .map(|(alignment, direction)| passes(alignment, direction, &fit, recordings));
    let growing = align(joined, &passes.concat(), recordings);
    let alignment = growing.reversed()?;
    let start_chainage_m = alignment.length_m();
    let falling = Some(FallingAlignment { alignment, start_chainage_m, is_same: true });
    Some(Alignments { falling, ..alone(growing) })
}

/// Returns the alignment of a direction from its own parts, which show better where it differs from the other
/// direction's. A single part does not show how much of it is the line.
fn alignment_of(
    template: &Alignment,
    along: &[(RecordingPart, SurveyPass)],
    recordings: &[SurveyRecording],
) -> Alignment {
    let own: Vec<RecordingPart> = along.iter().map(|(part, _)| *part).collect();
    let first = match own.len() {
        0 | 1 => template.clone(),
        _ => self::template(&own, recordings).unwrap_or_else(|| template.clone()),
    };
    let passes = passes(&first, 1, &own, recordings);
    align(first, &passes, recordings)
}

/// Returns the passes that an alignment is laid through.
fn passes(
    alignment: &Alignment,
    direction: i8,
    recording_parts: &[RecordingPart],
    recordings: &[SurveyRecording],
) -> Vec<SurveyPass> {
    let along = along(alignment, direction, recording_parts, recordings).into_iter();
    thinned(&along.map(|(_, pass)| pass).collect::<Vec<_>>(), ALIGNED_MAX)
}

/// Returns at most `most` of them, evenly chosen, with the first.
fn thinned<T: Clone>(all: &[T], most: usize) -> Vec<T> {
    all.iter().step_by(all.len().div_ceil(most).max(1)).cloned().collect()
}

fn rows_of(part: &RecordingPart, recordings: &[SurveyRecording]) -> std::ops::Range<usize> {
    let recording = &recordings[part.recording];
    let first = recording.travelled_m.partition_point(|&alignment| alignment < part.from_m);
    let end = recording.travelled_m.partition_point(|&alignment| alignment <= part.to_m);
    first..end
}

/// Returns the part that the others follow furthest, cut to the section that at least one other part drives too.
fn template(
    recording_parts: &[RecordingPart],
    recordings: &[SurveyRecording],
) -> Option<Alignment> {
    let mut long = recording_parts.to_vec();
    long.retain(|part| part.to_m - part.from_m > 100.0);
    let thinned = thinned(&long, TRIED_MAX);
    let traces: Vec<Vec<TracePoint>> =
        thinned.iter().map(|part| trace(part, recordings, POINT_STEP_M)).collect();
    let points: Vec<Vec<[f64; 2]>> = (0..traces.len()).map(|one| filled(one, &traces)).collect();
    let tried = points.iter().enumerate().filter_map(|(one, nodes)| {
        let alignment = Alignment::through(nodes)?;
        let counts = covered(&alignment, one, &points);
        let score: usize = counts.iter().sum();
        // Of two that the others follow as far, the shorter one holds less that is not the line.
        Some((score, std::cmp::Reverse(nodes.len()), alignment, counts))
    });
    let (_, _, alignment, counts) = tried.max_by_key(|it| (it.0, it.1))?;
    if thinned.len() < 2 {
        return Some(alignment);
    }
    let first = counts.iter().position(|&count| count > 0)?;
    let last = counts.iter().rposition(|&count| count > 0)?;
    Alignment::through(&alignment.nodes_m()[first..=last])
}

/// For each node of an alignment how many other parts drive it, each counted in the direction in
/// which it drives most of it.
fn covered(alignment: &Alignment, own: usize, recording_parts: &[Vec<[f64; 2]>]) -> Vec<usize> {
    let count = alignment.nodes_m().len();
    let mut counts = vec![0; count];
    for (_, points) in recording_parts.iter().enumerate().filter(|(other, _)| *other != own) {
        let mut marks = [vec![false; count], vec![false; count]];
        for pair in points.windows(2) {
            let step = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
            let length = distance_squared(pair[0], pair[1]).sqrt().max(1e-9);
            for (node, _) in alignment.nodes_near(pair[0], SAME_ALIGNMENT_M) {
                let [x, y] = alignment.direction(node as f64 * alignment.step_m());
                let cosine = (x * step[0] + y * step[1]) / length;
                if cosine.abs() > 0.6 {
                    marks[usize::from(cosine < 0.0)][node] = true;
                }
            }
        }
        let covers = |marks: &Vec<bool>| marks.iter().filter(|mark| **mark).count();
        let best = if covers(&marks[0]) >= covers(&marks[1]) { &marks[0] } else { &marks[1] };
        for (count, mark) in counts.iter_mut().zip(best) {
            *count += usize::from(*mark);
        }
    }
    counts
}

/// Returns the parts that run along an alignment driven in its direction, with their rows on it.
fn along(
    alignment: &Alignment,
    direction: i8,
    recording_parts: &[RecordingPart],
    recordings: &[SurveyRecording],
) -> Vec<(RecordingPart, SurveyPass)> {
    let pass =
        |part: &RecordingPart| Some((*part, pass_along(alignment, direction, part, recordings)?));
    parallel::of_each(recording_parts, pass).into_iter().flatten().collect()
}

fn pass_along(
    alignment: &Alignment,
    direction: i8,
    part: &RecordingPart,
    recordings: &[SurveyRecording],
) -> Option<SurveyPass> {
    let rows = rows_of(part, recordings);
    let placed = follow(&recordings[part.recording], rows, alignment);
    let (first, last) = (placed.first()?, placed.last()?);
    let covered_m = last.chainage_m - first.chainage_m;
    let least_m = (PASS_SHARE_MIN * alignment.length_m()).min(PASS_MIN_M);
    let pass = SurveyPass { recording: part.recording, rows: first.row..last.row + 1, direction };
    (covered_m >= least_m).then_some(pass)
}

/// Returns the pass that a part of any role is, if it is one.
pub fn pass_of(
    alignments: &Alignments,
    part: &RecordingPart,
    recordings: &[SurveyRecording],
) -> Option<SurveyPass> {
    let along = |direction: i8| pass_along(alignments.of(direction)?, direction, part, recordings);
    [along(1), along(-1)].into_iter().flatten().max_by_key(|pass| pass.rows.len())
}
