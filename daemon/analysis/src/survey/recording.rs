//! A raw recording, and what is computed from it once.

use super::geodesy::{LocalPlane, between};
use crate::statistics::middle;

/// Fixes closer in time than this many s say the same: their errors fade over seconds.
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
    /// Declared gross mass in kg with what is counted or weighed; `NaN` where the count is not known
    /// yet.
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
    pub fn of(raw: &'r RawRecording, plane: &LocalPlane) -> Self {
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

    /// The first row at or past a distance in m.
    pub fn row_at(&self, travelled_m: f64) -> usize {
        self.travelled_m
            .partition_point(|&travelled| travelled < travelled_m)
            .min(self.travelled_m.len().saturating_sub(1))
    }

    /// Length in m of the whole distance.
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

/// The plane around the middle of all fixes; `None` without any.
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
