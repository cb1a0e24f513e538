//! Information of positions on the measured speed: its scale, which gives the wheel diameter, and its delay.
//!
//! Where the measured speed is late, the distance by position is ahead of the distance by integrated speed by the
//! distance that the train drives in the delay: more, the faster it is. An odometer that is as late as the speed does
//! not show this, so that only a position ahead of the speed says something.

use dynocar_model::simulate::{OpenLoopRecording, STANDING_MPS};
use dynocar_model::terms::speed_delay;
use nalgebra::{Matrix3, Vector3};

use super::bins::SEGMENT_GAP_MAX_S;
use crate::dataset::chainage;

/// Distance by position over distance by integrated speed, and its standard deviation.
///
/// Balises correct the position, while the odometer shares the error of the wheel diameter, so that the ratio over many
/// kilometres shows the diameter. Between two corrections the odometer drifts by this error: the parts before the first
/// correction and after the last one say nothing, and would show a wheel nearer to the declared one than it is.
pub(super) fn distance_ratio(recording: &OpenLoopRecording) -> Option<(f64, f64)> {
    let steps = distances(recording);
    let total = |steps: &[Distances]| {
        steps.iter().fold(Distances::default(), |sum, step| Distances {
            by_position_m: sum.by_position_m + step.by_position_m,
            by_speed_m: sum.by_speed_m + step.by_speed_m,
            ..sum
        })
    };
    let between = total(between_corrections(&steps));
    let compared = if between.by_speed_m < DISTANCE_MIN_M { total(&steps) } else { between };
    if compared.by_speed_m < DISTANCE_MIN_M || compared.by_position_m < 0.5 * compared.by_speed_m {
        return None;
    }
    Some((
        compared.by_position_m / compared.by_speed_m,
        END_ERROR_M * std::f64::consts::SQRT_2 / compared.by_speed_m,
    ))
}

/// A position that leaves the integrated speed by more than this in m was corrected.
pub(super) const CORRECTION_MIN_M: f64 = chainage::CORRECTION_MIN_M;
/// Usual error of a position in m where a run begins and ends, and at a balise.
pub(super) const END_ERROR_M: f64 = 10.0;
/// A shorter way in m shows nothing of the wheels.
pub(super) const DISTANCE_MIN_M: f64 = 1500.0;

/// A way in m by position and by integrated speed.
#[derive(Clone, Copy, Default)]
pub(super) struct Distances {
    /// Number of the sample where it ends.
    pub to: usize,
    pub by_position_m: f64,
    pub by_speed_m: f64,
}

impl Distances {
    /// By how many m the position is ahead of the speed.
    pub fn missed_m(&self) -> f64 {
        self.by_position_m - self.by_speed_m
    }

    /// Returns whether a balise corrected the position.
    pub fn is_corrected(&self) -> bool {
        self.missed_m().abs() > CORRECTION_MIN_M
    }
}

/// The steps from the first correction to the last.
pub(super) fn between_corrections(steps: &[Distances]) -> &[Distances] {
    let first = steps.iter().position(Distances::is_corrected).map_or(0, |at| at + 1);
    let end = steps.iter().rposition(Distances::is_corrected).map_or(0, |at| at + 1);
    steps.get(first..end).unwrap_or_default()
}

/// The distances between samples with a position, without those over a break of the chainage.
pub(super) fn distances(recording: &OpenLoopRecording) -> Vec<Distances> {
    let all = all_distances(recording);
    let breaks = breaks(&all);
    let kept = all.iter().enumerate().filter(|(place, _)| breaks.binary_search(place).is_err());
    kept.map(|(_, step)| *step).collect()
}

/// The places among all distances over which the chainage breaks.
fn breaks(all: &[Distances]) -> Vec<usize> {
    let steps_m: Vec<(f64, f64)> = all.iter().map(|it| (it.by_position_m, it.by_speed_m)).collect();
    chainage::breaks(&steps_m)
}

/// The distances between samples with a position.
fn all_distances(recording: &OpenLoopRecording) -> Vec<Distances> {
    let (samples, time_s) = (recording.samples(), recording.time_s());
    let mut distances = Vec::with_capacity(samples.len());
    let mut last: Option<(usize, f64)> = None;
    for (i, sample) in samples.iter().enumerate() {
        let Some(position_m) = sample.position_m else { continue };
        if let Some((k, before_m)) = last
            && time_s[i] - time_s[k] <= SEGMENT_GAP_MAX_S
        {
            let mean_mps = 0.5 * (sample.speed_mps + samples[k].speed_mps);
            distances.push(Distances {
                to: i,
                by_position_m: sample.direction * (position_m - before_m),
                by_speed_m: mean_mps * (time_s[i] - time_s[k]),
            });
        }
        last = Some((i, position_m));
    }
    distances
}

/// Least time in s and range of speeds in m/s of a part from stand to stand that says.
const PART_MIN_S: f64 = 20.0;
const RANGE_MIN_MPS: f64 = 5.0;
/// Fewer parts do not show how they differ.
const PARTS_MIN: usize = 5;
/// Stamps and filters of a position are common to all runs: a delay below this in s is not reported.
const COMMON_S: f64 = 0.05;
/// Number of standard deviations that is more than chance.
const AHEAD_STDS: f64 = 2.0;

/// Seconds by which the speed is late by the positions of a recording, one for each part from stand to
/// stand.
pub(super) fn by_part_s(recording: &OpenLoopRecording) -> Vec<f64> {
    let (samples, time_s) = (recording.samples(), recording.time_s());
    let all = all_distances(recording);
    let breaks: Vec<usize> = breaks(&all).into_iter().map(|place| all[place].to).collect();
    let mut parts = Vec::new();
    let mut from = 0;
    for i in 1..=samples.len() {
        let is_end = i == samples.len()
            || breaks.binary_search(&i).is_ok()
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

/// Returns by how many s the speed is late in a part: the share of the missed distance that follows the speed, and not
/// the distance as with a wrong wheel diameter.
fn late_s(recording: &OpenLoopRecording, from: usize, end: usize) -> Option<f64> {
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
    use dynocar_model::force::ResolvedSample;

    use super::super::coasting;
    use super::*;

    const SCALE: f64 = 1.02;

    /// A train at 20 m/s whose wheels count 2 % too much, with balises at some chainages.
    fn recording(balises_m: &[f64]) -> OpenLoopRecording {
        let mut odometer_m = 0.0;
        let sample = |k: i32| {
            let (time_s, true_m) = (0.2 * f64::from(k), 4.0 * f64::from(k));
            odometer_m += 4.0 * SCALE;
            if balises_m.iter().any(|at_m| (true_m - 4.0..true_m).contains(at_m)) {
                odometer_m = true_m;
            }
            ResolvedSample {
                time_ns: (time_s * 1e9).round() as i64,
                speed_mps: 20.0 * SCALE,
                position_m: Some(odometer_m),
                ..coasting()
            }
        };
        OpenLoopRecording::new((0..2500).map(sample).collect()).unwrap()
    }

    #[test]
    fn between_the_first_and_the_last_balise_the_ratio_is_that_of_the_wheels() {
        // 3 km before the first and 2.5 km behind the last, of 10 km.
        let (ratio, _) = distance_ratio(&recording(&[3001.0, 5001.0, 7501.0])).unwrap();
        assert!((ratio * SCALE - 1.0).abs() < 1e-9, "{ratio}");
    }

    #[test]
    fn a_break_of_the_chainage_shows_nothing_of_the_wheels() {
        for jump_m in [-400.0, 200.0, 3000.0] {
            let mut samples = recording(&[]).samples().to_vec();
            for sample in &mut samples[1700..] {
                sample.position_m = sample.position_m.map(|it| it + jump_m);
            }
            let (ratio, _) = distance_ratio(&OpenLoopRecording::new(samples).unwrap()).unwrap();
            assert!((ratio - 1.0).abs() < 1e-9, "{jump_m} m: {ratio}");
        }
    }

    #[test]
    fn an_odometer_that_nothing_corrects_says_what_its_wheels_say() {
        let (ratio, deviation) = distance_ratio(&recording(&[])).unwrap();
        assert!((ratio - 1.0).abs() < 1e-9, "{ratio}");
        assert!(deviation > 1e-3, "{deviation}");
    }

    /// Speed and distance of a train that goes from stand to stand in 120 s.
    fn true_motion(time_s: f64) -> (f64, f64) {
        let angle = std::f64::consts::TAU * time_s.clamp(0.0, 120.0) / 120.0;
        (10.0 * (1.0 - angle.cos()), 10.0 * (time_s.clamp(0.0, 120.0) - angle.sin() * 19.098_593))
    }

    fn late_recording(late_s: f64, odometer_late_s: f64, scale: f64) -> OpenLoopRecording {
        let sample = |k: i32| {
            let time_s = 0.2 * f64::from(k);
            ResolvedSample {
                time_ns: (time_s * 1e9).round() as i64,
                speed_mps: scale * true_motion(time_s - late_s).0,
                position_m: Some(500.0 + true_motion(time_s - odometer_late_s).1),
                ..coasting()
            }
        };
        OpenLoopRecording::new((0..620).map(sample).collect()).unwrap()
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
            let [found_s] = by_part_s(&late_recording(late_s, odometer_late_s, scale))[..] else {
                panic!("one part")
            };
            let expected_s = late_s - odometer_late_s;
            assert!((found_s - expected_s).abs() < 0.03, "{found_s} s, not {expected_s}");
        }
    }
}
