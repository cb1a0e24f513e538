//! A raw recording, the quantities computed from it once, and its division where it turns back on its own path.

use std::collections::HashMap;

use dynocar_model::terms::wheel::STILL_MPS;

use super::alignment::{LocalPlane, between, distance_squared};
use crate::statistics::middle;

/// Least time in s between fixes that are used: closer ones have the same error, which fades over seconds.
const FIX_STEP_MIN_S: f64 = 0.95;

/// Rows of a recorder in order of time; a missing value is `NaN`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawRecording {
    /// Path of its file, as the dataset names it.
    pub source: String,
    /// True when models may be fitted to it.
    pub is_fit: bool,
    /// Time in s.
    pub time_s: Vec<f64>,
    /// Speed in m/s in the direction of travel.
    pub speed_mps: Vec<f64>,
    /// Traction minus brake force in N, as far as recorded.
    pub control_n: Vec<f64>,
    /// Pressure in Pa of a friction brake whose force is not recorded; empty when there is none.
    pub friction_pa: Vec<f64>,
    /// Latitude in degrees.
    pub latitude_deg: Vec<f64>,
    /// Longitude in degrees.
    pub longitude_deg: Vec<f64>,
    /// Altitude in m; empty when not recorded.
    pub altitude_m: Vec<f64>,
    /// 1 while a door is open; empty when not recorded.
    pub door_open: Vec<f64>,
    /// Declared gross mass in kg, weighed or with counted passengers; `NaN` while the count is not known.
    pub mass_kg: Vec<f64>,
    /// Number of passengers; empty when not counted.
    pub passengers: Vec<f64>,
}

/// A position by GNSS.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fix {
    /// Row of the recording.
    pub row: usize,
    /// East and north in m.
    pub at_m: [f64; 2],
}

/// A recording with its distance by the wheels and its fixes on the plane.
#[derive(Clone, Debug)]
pub struct SurveyRecording<'r> {
    /// Recorded rows.
    pub raw: &'r RawRecording,
    /// Distance in m by integrating the speed, from 0 at the first row.
    pub travelled_m: Vec<f64>,
    /// Its fixes, thinned to one a second.
    pub fixes: Vec<Fix>,
}

impl<'r> SurveyRecording<'r> {
    /// Integrates the speed and projects the fixes.
    pub fn new(raw: &'r RawRecording, plane: &LocalPlane) -> Self {
        let mut travelled_m = Vec::with_capacity(raw.time_s.len());
        let (mut travelled, mut last) = (0.0, None);
        for (&time_s, &speed_mps) in raw.time_s.iter().zip(&raw.speed_mps) {
            if !speed_mps.is_nan() {
                if let Some((before_s, before_mps)) = last {
                    let step: f64 = time_s - before_s;
                    travelled += 0.5 * step * (speed_mps + before_mps);
                }
                last = Some((time_s, speed_mps));
            }
            travelled_m.push(travelled);
        }
        let mut fixes: Vec<Fix> = Vec::new();
        for row in 0..raw.time_s.len() {
            let (latitude, longitude) = (raw.latitude_deg[row], raw.longitude_deg[row]);
            let is_new = fixes.last().is_none_or(|last| {
                let moved = raw.latitude_deg[last.row] != latitude
                    || raw.longitude_deg[last.row] != longitude;
                moved && raw.time_s[row] - raw.time_s[last.row] >= FIX_STEP_MIN_S
            });
            if is_new && latitude.abs() <= 90.0 && longitude.abs() <= 180.0 {
                fixes.push(Fix { row, at_m: plane.project(latitude, longitude) });
            }
        }
        SurveyRecording { raw, travelled_m, fixes }
    }

    /// Returns the first row at or past a distance in m.
    pub fn row_at(&self, travelled_m: f64) -> usize {
        self.travelled_m
            .partition_point(|&travelled| travelled < travelled_m)
            .min(self.travelled_m.len().saturating_sub(1))
    }

    /// Returns the length in m of the whole distance.
    pub fn length_m(&self) -> f64 {
        self.travelled_m.last().copied().unwrap_or(0.0)
    }

    /// Points every `step_m` of the distance: (distance in m, east and north in m), straight between fixes.
    pub fn points(&self, step_m: f64) -> Vec<(f64, [f64; 2])> {
        let mut points = Vec::new();
        let mut next_m = self.fixes.first().map_or(0.0, |fix| self.travelled_m[fix.row]);
        for pair in self.fixes.windows(2) {
            let (from_m, to_m) = (self.travelled_m[pair[0].row], self.travelled_m[pair[1].row]);
            while next_m < to_m {
                let share = (next_m - from_m) / (to_m - from_m);
                points.push((next_m, between(pair[0].at_m, pair[1].at_m, share)));
                next_m += step_m;
            }
        }
        points
    }
}

/// Returns the plane around the middle of all fixes; `None` without any.
pub fn plane_of(recordings: &[RawRecording]) -> Option<LocalPlane> {
    let median = |values: fn(&RawRecording) -> &Vec<f64>| {
        let all = recordings.iter().flat_map(values);
        let mut all: Vec<f64> = all.copied().filter(|value| value.is_finite()).collect();
        middle(&mut all)
    };
    let height_m = median(|recording| &recording.altitude_m).unwrap_or(0.0);
    Some(LocalPlane::around(
        median(|recording| &recording.latitude_deg)?,
        median(|recording| &recording.longitude_deg)?,
        height_m,
    ))
}

/// Distance in m between the points that are looked at.
pub const POINT_STEP_M: f64 = 20.0;
/// Two passes nearer than this many m are on the same way.
pub const SAME_ALIGNMENT_M: f64 = 40.0;
/// Points nearer than this many m along the path do not count as a return.
const RETURN_MIN_M: f64 = 200.0;
/// A return counts once this many points follow an earlier path.
const RETURN_POINTS: usize = 15;
/// The stop in a loop at the end of a line is sought this many m beyond the loop.
const TERMINAL_MARGIN_M: f64 = 100.0;

/// A part of a recording that does not come back on itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordingPart {
    /// Number of the recording.
    pub recording: usize,
    /// Distance in m by the recording's wheels where it starts.
    pub from_m: f64,
    /// Where it ends.
    pub to_m: f64,
}

/// Cuts a recording into parts: where its path follows, for 300 m, a path that it took before
/// in the same part, it has turned. The cut is where it stood longest in between.
pub fn recording_parts(number: usize, recording: &SurveyRecording) -> Vec<RecordingPart> {
    let points = recording.points(POINT_STEP_M);
    let mut found = Vec::new();
    let mut from = 0;
    while from < points.len() {
        let start_m = if from == 0 { 0.0 } else { points[from].0 };
        let Some(turn) = first_return(&points, from) else {
            let to_m = recording.length_m();
            found.push(RecordingPart { recording: number, from_m: start_m, to_m });
            break;
        };
        let (left_m, back_m) = (points[turn.left].0, points[turn.back].0);
        let cut_m = if turn.is_opposite {
            let (low, high) = (left_m - TERMINAL_MARGIN_M, back_m + TERMINAL_MARGIN_M);
            longest_stand(recording, low.max(start_m), high).unwrap_or(0.5 * (left_m + back_m))
        } else {
            back_m
        };
        found.push(RecordingPart { recording: number, from_m: start_m, to_m: cut_m });
        let next = points.partition_point(|point| point.0 <= cut_m);
        // A cut always leaves points behind, or else the search would not end.
        from = next.max(from + 1);
    }
    found
}

/// Where a part comes back on itself.
struct Return {
    /// The earlier point, where the repeated path was left.
    left: usize,
    /// The later point, from which on it is followed.
    back: usize,
    is_opposite: bool,
}

fn first_return(points: &[(f64, [f64; 2])], from: usize) -> Option<Return> {
    let mut cells: HashMap<(i64, i64), Vec<usize>> = HashMap::new();
    let cell = |at: [f64; 2]| {
        ((at[0] / SAME_ALIGNMENT_M).floor() as i64, (at[1] / SAME_ALIGNMENT_M).floor() as i64)
    };
    let mut twins: Vec<Option<usize>> = Vec::new();
    for (i, &(travelled_m, at)) in points.iter().enumerate().skip(from) {
        let (column, row) = cell(at);
        let around = (-1..=1).flat_map(|x| (-1..=1).map(move |y| (column + x, row + y)));
        let candidates = around.filter_map(|key| cells.get(&key)).flatten().copied();
        let twin = candidates
            .filter(|&j| travelled_m - points[j].0 > RETURN_MIN_M)
            .map(|j| (distance_squared(at, points[j].1), j))
            .filter(|(squared, _)| *squared < SAME_ALIGNMENT_M * SAME_ALIGNMENT_M)
            .min_by(|one, other| one.0.total_cmp(&other.0));
        twins.push(twin.map(|(_, j)| j));
        cells.entry((column, row)).or_default().push(i);
        if let Some(found) = confirmed(&twins, from) {
            return Some(found);
        }
    }
    None
}

/// A return is confirmed when the last points follow an earlier path at its pace.
fn confirmed(twins: &[Option<usize>], from: usize) -> Option<Return> {
    let recent = &twins[twins.len().checked_sub(RETURN_POINTS)?..];
    let (first, last) = (recent[0]?, recent[RETURN_POINTS - 1]?);
    let matched = recent.iter().flatten().count();
    let pace = first.abs_diff(last) as f64 / (RETURN_POINTS - 1) as f64;
    if 10 * matched < 9 * RETURN_POINTS || !(0.6..=1.4).contains(&pace) {
        return None;
    }
    let before = twins[..twins.len() - RETURN_POINTS].iter().rev();
    let further = before.take_while(|twin| twin.is_some()).count();
    let back = twins.len() - RETURN_POINTS - further;
    Some(Return { left: twins[back]?, back: from + back, is_opposite: last < first })
}

/// Returns the distance in m where a recording stood longest between two paths; `None` when it did not stand.
fn longest_stand(recording: &SurveyRecording, from_m: f64, to_m: f64) -> Option<f64> {
    let raw = recording.raw;
    let rows = recording.row_at(from_m)..recording.row_at(to_m);
    let (mut longest, mut stand): ((f64, f64), Option<(f64, f64)>) = ((0.0, 0.0), None);
    for row in rows {
        let (travelled_m, step_s) = (recording.travelled_m[row], step_after(&raw.time_s, row));
        // Moving up a little does not end a stand.
        stand = match stand {
            Some((at_m, stood_s)) if travelled_m - at_m < 5.0 => Some((at_m, stood_s)),
            _ => None,
        };
        if raw.speed_mps[row] < STILL_MPS {
            let (at_m, stood_s) = stand.unwrap_or((travelled_m, 0.0));
            stand = Some((at_m, stood_s + step_s));
            if stood_s + step_s > longest.0 {
                longest = (stood_s + step_s, at_m);
            }
        }
    }
    (longest.0 > 0.0).then_some(longest.1)
}

fn step_after(time_s: &[f64], row: usize) -> f64 {
    time_s.get(row + 1).map_or(0.0, |next| next - time_s[row])
}
