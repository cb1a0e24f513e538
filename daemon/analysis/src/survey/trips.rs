//! One-way trips along the line, and the parts of the recordings that are not trips.

use std::ops::Range;

use serde::Serialize;

use super::centring::SurveyPass;
use super::chainage::{Chained, WheelsAndLag, chain};
use super::driven_line::Alignments;
use super::recording::SurveyRecording;
use super::tracking::{PlacedFix, follow};
use crate::explain::answer::WithStd;
use crate::parallel;

/// Distance in m and time in s by which a trip reaches beyond its first and last fix, where the train stands.
const REACH: (f64, f64) = (30.0, 60.0);
/// Shortest unused part in s that is reported.
const NOT_USED_MIN_S: f64 = 5.0;
/// Standard deviation of the wheels' scale between passes of one vehicle.
const SCALE_SPREAD: f64 = 0.001;

/// A one-way trip along the line.
#[derive(Clone, Debug, PartialEq)]
pub struct Trip {
    /// Number of the recording.
    pub recording: usize,
    /// True when models may be fitted to it.
    pub is_fit: bool,
    /// 1 while the chainage grows, -1 while it falls.
    pub direction: i8,
    /// Place in m along the alignment of its direction, from its first row on.
    pub along: Chained,
}

impl Trip {
    /// Returns its rows in the recording.
    pub fn rows(&self) -> std::ops::Range<usize> {
        self.along.first_row..self.along.first_row + self.along.chainage_m.len()
    }

    /// Returns the length in m.
    pub fn length_m(&self) -> f64 {
        let along = &self.along.chainage_m;
        along.last().copied().unwrap_or(0.0) - along.first().copied().unwrap_or(0.0)
    }
}

/// A part of a recording that is no trip.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NotUsed {
    /// The recording.
    pub source: String,
    /// Time in s where it starts.
    pub from_s: f64,
    /// Time in s where it ends.
    pub to_s: f64,
    /// Why it is not used.
    pub reason: &'static str,
}

/// A pass on its alignment, with the scale and the lag that it shows by itself.
struct PlacedPass {
    rows: Range<usize>,
    fixes: Vec<PlacedFix>,
    learned: WheelsAndLag,
}

/// Gives every pass its chainage; returns the trips, and the scale and the lag by the fit runs.
pub fn trips(
    passes: &[SurveyPass],
    alignments: &Alignments,
    recordings: &[SurveyRecording],
) -> (Vec<Trip>, WheelsAndLag) {
    let placed = parallel::of_each(passes, |pass| {
        let recording = &recordings[pass.recording];
        let alignment = alignments.of(pass.direction)?;
        let fixes = follow(recording, pass.rows.clone(), alignment);
        let rows = with_stands(recording, pass.rows.clone());
        let alone = chain(recording, rows.clone(), &fixes, WheelsAndLag::UNKNOWN)?;
        Some(PlacedPass { rows, fixes, learned: alone.learned })
    });
    let is_fit = |pass: &SurveyPass| recordings[pass.recording].raw.is_fit;
    let has_fit = passes.iter().any(is_fit);
    let learned: Vec<WheelsAndLag> = passes
        .iter()
        .zip(&placed)
        .filter(|(pass, _)| is_fit(pass) || !has_fit)
        .filter_map(|(_, placed)| placed.as_ref().map(|it| it.learned))
        .collect();
    let together = WheelsAndLag::together(&learned, SCALE_SPREAD).unwrap_or(WheelsAndLag::UNKNOWN);
    let of_pass = |index: usize, placed: Option<PlacedPass>| {
        let (pass, PlacedPass { rows, fixes, .. }) = (&passes[index], placed?);
        let recording = &recordings[pass.recording];
        let is_fit = recording.raw.is_fit;
        // Another day's wheels may be worn or new.
        let scale = match is_fit || !has_fit {
            true => WithStd { value: together.scale.value, std: 2.0 * SCALE_SPREAD },
            false => WheelsAndLag::UNKNOWN.scale,
        };
        let lag_s = WithStd { std: together.lag_s.std.max(0.05), ..together.lag_s };
        let along = chain(recording, rows, &fixes, WheelsAndLag { scale, lag_s })?;
        Some(Trip { recording: pass.recording, is_fit, direction: pass.direction, along })
    };
    let trips = parallel::of_each_owned(placed, of_pass);
    let mut trips: Vec<Trip> = trips.into_iter().flatten().collect();
    trips.sort_by_key(|trip| (trip.recording, trip.along.first_row));
    for index in 1..trips.len() {
        let end = trips[index - 1].rows().end;
        let (before, trip) = (trips[index - 1].recording, &mut trips[index]);
        if before == trip.recording && trip.along.first_row < end {
            let over = end - trip.along.first_row;
            trip.along.chainage_m.drain(..over.min(trip.along.chainage_m.len()));
            trip.along.first_row = end;
        }
    }
    trips.retain(|trip| !trip.along.chainage_m.is_empty());
    (trips, together)
}

/// The rows with the stands before and after them.
fn with_stands(
    recording: &SurveyRecording,
    rows: std::ops::Range<usize>,
) -> std::ops::Range<usize> {
    let near = |row: usize, from: usize| {
        let (travelled_m, time_s) = (&recording.travelled_m, &recording.raw.time_s);
        (travelled_m[row] - travelled_m[from]).abs() < REACH.0
            && (time_s[row] - time_s[from]).abs() < REACH.1
    };
    let (mut first, mut last) = (rows.start, rows.end - 1);
    while first > 0 && near(first - 1, rows.start) {
        first -= 1;
    }
    while last + 1 < recording.travelled_m.len() && near(last + 1, rows.end - 1) {
        last += 1;
    }
    first..last + 1
}

/// Returns the parts of the recordings outside the trips, and the reasons.
pub fn not_used(trips: &[Trip], recordings: &[SurveyRecording]) -> Vec<NotUsed> {
    let mut found = Vec::new();
    for (number, recording) in recordings.iter().enumerate() {
        let rows = recording.raw.time_s.len();
        let mut from = 0;
        let own = trips.iter().filter(|trip| trip.recording == number).map(Trip::rows);
        for trip in own.chain(std::iter::once(rows..rows)) {
            if trip.start > from {
                let (from_s, to_s) =
                    (recording.raw.time_s[from], recording.raw.time_s[trip.start - 1]);
                if to_s - from_s >= NOT_USED_MIN_S {
                    let reason = reason(recording, from..trip.start);
                    let source = recording.raw.source.clone();
                    found.push(NotUsed { source, from_s, to_s, reason });
                }
            }
            from = trip.end;
        }
    }
    found
}

fn reason(recording: &SurveyRecording, rows: std::ops::Range<usize>) -> &'static str {
    let moved_m = recording.travelled_m[rows.end - 1] - recording.travelled_m[rows.start];
    let fixes = recording.fixes.iter().filter(|fix| rows.contains(&fix.row)).count();
    match (moved_m < 50.0, fixes < 10) {
        (true, _) => "stands at an end of the line",
        (false, true) => "no position by GNSS",
        (false, false) => "not along the line that is driven repeatedly",
    }
}
