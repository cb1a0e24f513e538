//! A simulated GNSS receiver.

use dynocar_analysis::survey::alignment::LocalPlane;
use dynocar_model::simulate::motion::autoregressed;
use dynocar_shared::TrainSample;

use super::line_maker::SimulatedLine;
use super::random::SimulatorRandom;
use super::settings::{GnssReceiver, SimulatorSettings};
use super::true_run::{TRUE_STEP_S, TrueState};

/// Latitude and longitude of the start of every line.
const ORIGIN_DEG: (f64, f64) = (47.0, 9.0);
/// Altitude in m of a line's start.
const ORIGIN_M: f64 = 450.0;
/// Step in m with which the alignment is computed.
const STEP_M: f64 = 5.0;
/// Error in m of an altitude, and the time constant in s with which it fades.
const ALTITUDE_ERROR: (f64, f64) = (6.0, 60.0);

/// A position as recorded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Position {
    /// Latitude in degrees.
    pub latitude_deg: f64,
    /// Longitude in degrees.
    pub longitude_deg: f64,
    /// Altitude in m.
    pub altitude_m: f64,
}

/// Returns the alignment of a line on a plane: east, north and height in m every 5 m. Curves turn left and right
/// in turns.
pub fn alignment_m(line: &SimulatedLine) -> Vec<[f64; 3]> {
    let track = &line.track;
    let (mut heading, mut at) = (0.3f64, [0.0, 0.0, ORIGIN_M]);
    let mut alignment = Vec::new();
    let mut chainage_m = 0.0;
    while chainage_m <= line.length_m + STEP_M {
        alignment.push(at);
        let middle_m = chainage_m + 0.5 * STEP_M;
        let turns = track
            .curves()
            .iter()
            .enumerate()
            .filter(|(_, curve)| (curve.start_m..curve.end_m).contains(&middle_m));
        for (number, curve) in turns {
            heading += STEP_M / curve.radius_m * if number % 2 == 0 { 1.0 } else { -1.0 };
        }
        at[0] += STEP_M * heading.sin();
        at[1] += STEP_M * heading.cos();
        at[2] += 1e-3 * STEP_M * track.gradient_permille(middle_m, 0.0).unwrap_or(0.0);
        chainage_m += STEP_M;
    }
    alignment
}

/// Returns a position for each sample: late, with errors that fade, missing in gaps.
pub fn positions(
    samples: &[TrainSample],
    states: &[TrueState],
    line: &SimulatedLine,
    (receiver, settings): (GnssReceiver, &SimulatorSettings),
    random: &mut SimulatorRandom,
) -> Vec<Option<Position>> {
    let alignment = alignment_m(line);
    let plane = LocalPlane::around(ORIGIN_DEG.0, ORIGIN_DEG.1, ORIGIN_M);
    let mut errors = [0.0, 0.0, 0.0].map(|_: f64| random.gaussian());
    let stds = [receiver.std_m, receiver.std_m, ALTITUDE_ERROR.0];
    let fadings = [receiver.fading_s, receiver.fading_s, ALTITUDE_ERROR.1];
    let (mut last_s, mut gap_until_s) = (0.0, f64::NEG_INFINITY);
    samples
        .iter()
        .map(|sample| {
            let time_s = sample.time_ns as f64 * 1e-9 - settings.time_offset_s;
            let step_s = (time_s - last_s).max(0.0);
            last_s = time_s;
            for (error, fading_s) in errors.iter_mut().zip(fadings) {
                let kept = (-step_s / fading_s).exp();
                *error = autoregressed(*error, kept, 1.0, random.gaussian());
            }
            if random.chance(receiver.gaps_per_hour * step_s / 3600.0) {
                gap_until_s = time_s + random.uniform(10.0, 60.0);
            }
            if time_s < gap_until_s {
                return None;
            }
            let state = ((time_s - receiver.late_s) / TRUE_STEP_S).max(0.0) as usize;
            let place = states[state.min(states.len() - 1)].position_m / STEP_M;
            let node = (place.max(0.0) as usize).min(alignment.len() - 2);
            let share = place - node as f64;
            let at = |axis: usize| {
                alignment[node][axis]
                    + share * (alignment[node + 1][axis] - alignment[node][axis])
                    + stds[axis] * errors[axis]
            };
            let [latitude_deg, longitude_deg] = plane.unproject([at(0), at(1)]);
            Some(Position { latitude_deg, longitude_deg, altitude_m: at(2) })
        })
        .collect()
}

/// Returns the cells of a position at the end of a row.
pub fn row_text(position: Option<&Position>, delimiter: &str) -> String {
    match position {
        Some(Position { latitude_deg, longitude_deg, altitude_m }) => format!(
            "{delimiter}{latitude_deg:.7}{delimiter}{longitude_deg:.7}{delimiter}{altitude_m:.1}"
        ),
        None => delimiter.repeat(3),
    }
}
