//! One-way trips along the line, the places where they stop, and the parts of the recordings that are not trips.

use std::ops::Range;

use dynocar_model::terms::wheel::STILL_MPS;
use serde::Serialize;

use super::centring::SurveyPass;
use super::chainage::{Chained, WheelsAndLag, chain};
use super::driven_line::Alignments;
use super::recording::{RawRecording, SurveyRecording};
use super::tracking::{PlacedFix, follow};
use crate::explain::answer::WithStd;
use crate::parallel;
use crate::statistics::least_first;

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

/// Least time in s of a stop without open doors.
const STAND_MIN_S: f64 = 8.0;
/// Greatest distance in m between stands at the same stop.
const SAME_STOP_M: f64 = 25.0;
/// Least share of the passes that stand at a stop.
const SHARE_MIN: f64 = 0.5;

/// A stop of the line.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SurveyedStop {
    /// Mean chainage in m.
    pub chainage_m: f64,
    /// Name, empty where not known.
    pub name: String,
    /// Standard deviation in m of the stands; absent for one stand.
    pub std_m: Option<f64>,
    /// Direction of travel.
    pub direction: i8,
    /// Number of stands.
    pub stands: usize,
}

/// Returns the chainages in m at which a trip stands: for some seconds, or with a door open where doors are
/// recorded.
pub fn stands(raw: &RawRecording, first_row: usize, chainage_m: &[f64]) -> Vec<f64> {
    let has_doors = raw.door_open.iter().any(|door| *door > 0.5);
    let mut found = Vec::new();
    let mut from: Option<usize> = None;
    for index in 0..=chainage_m.len() {
        let row = first_row + index;
        let stands = index < chainage_m.len() && raw.speed_mps[row] < STILL_MPS;
        match (stands, from) {
            (true, None) => from = Some(index),
            (false, Some(start)) => {
                let rows = first_row + start..row;
                let stood_s = raw.time_s[row - 1] - raw.time_s[first_row + start];
                let is_stop = match has_doors {
                    true => raw.door_open[rows].iter().any(|door| *door > 0.5),
                    false => stood_s >= STAND_MIN_S,
                };
                if is_stop {
                    found.push(chainage_m[(start + index - 1) / 2]);
                }
                from = None;
            }
            _ => {}
        }
    }
    found
}

/// The stops of a direction from the stands of its passes.
pub fn stops(direction: i8, passes: &[Vec<f64>]) -> Vec<SurveyedStop> {
    let mut all: Vec<(f64, usize)> = passes
        .iter()
        .enumerate()
        .flat_map(|(pass, stands)| stands.iter().map(move |stand| (*stand, pass)))
        .collect();
    least_first(&mut all, |it| it.0);
    let mut stops = Vec::new();
    for cluster in all.chunk_by(|one, other| other.0 - one.0 < SAME_STOP_M) {
        let mut standing: Vec<usize> = cluster.iter().map(|stand| stand.1).collect();
        standing.sort_unstable();
        standing.dedup();
        if (standing.len() as f64) < SHARE_MIN * passes.len() as f64 {
            continue;
        }
        let count = cluster.len() as f64;
        let mean = cluster.iter().map(|stand| stand.0).sum::<f64>() / count;
        let squares: f64 = cluster.iter().map(|stand| (stand.0 - mean).powi(2)).sum();
        let std_m = (count > 1.0).then(|| (squares / (count - 1.0)).sqrt());
        let (name, stands) = (String::new(), cluster.len());
        stops.push(SurveyedStop { chainage_m: mean, name, std_m, direction, stands });
    }
    stops
}

impl SurveyedStop {
    /// Returns the chainage in m beyond which no train stands here.
    pub fn end_m(&self) -> f64 {
        self.chainage_m + self.std_m.map_or(SAME_STOP_M, |std_m| (2.0 * std_m).max(1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stop_is_where_most_passes_stand() {
        let passes = [vec![100.0, 500.0], vec![101.0, 340.0], vec![99.0, 503.0]];
        let stops = stops(1, &passes);
        let at: Vec<f64> = stops.iter().map(|stop| stop.chainage_m).collect();
        assert_eq!(at, [100.0, 501.5]);
        assert!((stops[0].std_m.unwrap() - 1.0).abs() < 1e-12);
    }
}
