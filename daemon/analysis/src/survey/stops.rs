//! Places where the passes stop.

use dynocar_model::terms::wheel::STILL_MPS;
use serde::Serialize;

use super::recording::RawRecording;
use crate::statistics::least_first;

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
