//! The position against the integrated speed, in time: what shows a speed that is late.
//!
//! Behind a speed that is late by some time, the distance by position is ahead of the distance by integrated
//! speed by as much as the train drives in that time: more, the faster it is. An odometer that is late
//! with the speed does not show it, so that only a position ahead says something.

use dynocar_model::simulate::{Recording, STANDING_MPS};
use dynocar_model::terms::speed_delay;
use nalgebra::{Matrix3, Vector3};

use super::bins::SEGMENT_GAP_MAX_S;

/// Least time in s and range of speeds in m/s of a part from stand to stand that says.
const PART_MIN_S: f64 = 20.0;
const RANGE_MIN_MPS: f64 = 5.0;
/// Fewer parts do not show how they differ.
const PARTS_MIN: usize = 5;
/// Stamps and filters of a position are common to all runs: below this in s nothing is told.
const COMMON_S: f64 = 0.05;
/// So many standard deviations make it more than chance.
const AHEAD_STDS: f64 = 2.0;

/// Seconds by which the speed is late by the positions of a recording, one for each part from stand to
/// stand.
pub(super) fn by_part_s(recording: &Recording) -> Vec<f64> {
    let (samples, time_s) = (recording.samples(), recording.time_s());
    let mut parts = Vec::new();
    let mut from = 0;
    for i in 1..=samples.len() {
        let is_end = i == samples.len()
            || samples[i].speed_mps <= STANDING_MPS
            || samples[i].position_m.is_none()
            || time_s[i] - time_s[i - 1] > SEGMENT_GAP_MAX_S;
        if is_end {
            parts.extend(late_s(recording, from, i));
            from = i;
        }
    }
    parts
}

/// By how many s the speed is late in a part: what of the distance that it misses goes with the speed, and
/// not with the way as a wheel's diameter does.
fn late_s(recording: &Recording, from: usize, end: usize) -> Option<f64> {
    let (samples, time_s) = (&recording.samples()[from..end], &recording.time_s()[from..end]);
    let speeds = samples.iter().map(|sample| sample.speed_mps);
    let range_mps = speeds.clone().fold(0.0, f64::max) - speeds.fold(f64::INFINITY, f64::min);
    if time_s.last()? - time_s.first()? < PART_MIN_S || range_mps < RANGE_MIN_MPS {
        return None;
    }
    let start_m = samples[0].position_m?;
    let (mut square, mut product) = (Matrix3::zeros(), Vector3::zeros());
    let mut by_speed_m = 0.0;
    for (i, sample) in samples.iter().enumerate() {
        if i > 0 {
            let mean_mps = 0.5 * (sample.speed_mps + samples[i - 1].speed_mps);
            by_speed_m += mean_mps * (time_s[i] - time_s[i - 1]);
        }
        let missed_m = sample.direction * (sample.position_m? - start_m) - by_speed_m;
        let shape = Vector3::new(1.0, sample.speed_mps, by_speed_m);
        square += shape * shape.transpose();
        product += shape * missed_m;
    }
    let late_s = (square.try_inverse()? * product)[1];
    late_s.is_finite().then_some(late_s)
}

/// By how many s positions show that the speed is late, with the standard deviation; `None` where too few
/// parts say.
///
/// A speed is late against the line, where the train is by its position. A position that is not clearly
/// ahead of the speed shows that the speed is not late, or that both are late together: then the line is
/// felt on time by it, and only the forces seem to act late.
pub(super) fn pooled_s(parts: &[f64]) -> Option<(f64, f64)> {
    if parts.len() < PARTS_MIN {
        return None;
    }
    let count = parts.len() as f64;
    let mean_s = parts.iter().sum::<f64>() / count;
    let variance = parts.iter().map(|it| (it - mean_s).powi(2)).sum::<f64>() / (count - 1.0);
    let std_s = (variance / count).sqrt().hypot(COMMON_S);
    let is_ahead = mean_s - AHEAD_STDS * std_s > speed_delay::LEAST_S;
    Some((if is_ahead { mean_s } else { 0.0 }, std_s))
}

#[cfg(test)]
mod tests {
    use super::super::coasting;
    use super::*;
    use dynocar_model::force::ResolvedSample;
    use dynocar_model::simulate::BridgeLimits;

    /// Speed and distance of a train that goes from stand to stand in 120 s.
    fn true_motion(time_s: f64) -> (f64, f64) {
        let angle = std::f64::consts::TAU * time_s.clamp(0.0, 120.0) / 120.0;
        (10.0 * (1.0 - angle.cos()), 10.0 * (time_s.clamp(0.0, 120.0) - angle.sin() * 19.098_593))
    }

    fn recording(late_s: f64, odometer_late_s: f64, scale: f64) -> Recording {
        let sample = |k: i32| {
            let time_s = 0.2 * f64::from(k);
            ResolvedSample {
                time_ns: (time_s * 1e9).round() as i64,
                speed_mps: scale * true_motion(time_s - late_s).0,
                position_m: Some(500.0 + true_motion(time_s - odometer_late_s).1),
                ..coasting()
            }
        };
        Recording::new((0..620).map(sample).collect(), BridgeLimits::default()).unwrap()
    }

    #[test]
    fn a_position_that_runs_with_the_speed_shows_no_late_speed() {
        let (late_s, _) = pooled_s(&[0.8, 0.7, 0.9, 0.8, 0.8]).unwrap();
        assert!((late_s - 0.8).abs() < 1e-9, "{late_s}");
        for together in [[0.0, 0.05, -0.05, 0.02, -0.02], [-0.4, -0.5, -0.3, -0.4, -0.4]] {
            let (late_s, deviation_s) = pooled_s(&together).unwrap();
            assert_eq!(late_s, 0.0);
            assert!((0.05..0.1).contains(&deviation_s), "{deviation_s}");
        }
        assert_eq!(pooled_s(&[0.8; 4]), None);
    }

    #[test]
    fn a_position_of_its_own_shows_how_late_a_speed_is_whatever_the_wheel() {
        for (late_s, odometer_late_s, scale) in
            [(0.8, 0.0, 1.0), (0.8, 0.0, 1.02), (0.0, 0.0, 1.0), (0.8, 0.8, 1.0), (0.0, 0.4, 1.0)]
        {
            let [found_s] = by_part_s(&recording(late_s, odometer_late_s, scale))[..] else {
                panic!("one part")
            };
            let expected_s = late_s - odometer_late_s;
            assert!((found_s - expected_s).abs() < 0.03, "{found_s} s, not {expected_s}");
        }
    }
}
