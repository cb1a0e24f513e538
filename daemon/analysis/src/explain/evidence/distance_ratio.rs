//! The distance by position against the distance by integrated speed: what shows a wheel's diameter.

use dynocar_model::simulate::Recording;

use super::bins::SEGMENT_GAP_MAX_S;

/// Distance by position over distance by integrated speed, and its standard deviation.
///
/// Balises correct the position while the odometer shares the error of the wheel diameter, so
/// that the ratio over many kilometres shows the diameter. Between two corrections the odometer
/// drifts by that error, so that what lies before the first and behind the last says nothing, and
/// would show a wheel nearer to the declared one than it is.
pub(super) fn distance_ratio(recording: &Recording) -> Option<(f64, f64)> {
    const END_ERROR_M: f64 = 10.0;
    const CORRECTION_MIN_M: f64 = 1.0;
    const DISTANCE_MIN_M: f64 = 1500.0;
    let steps = distances(recording);
    let is_corrected =
        |step: &Distances| (step.by_position_m - step.by_speed_m).abs() > CORRECTION_MIN_M;
    let first = steps.iter().position(is_corrected).map_or(0, |at| at + 1);
    let end = steps.iter().rposition(is_corrected).map_or(0, |at| at + 1);
    let total = |steps: &[Distances]| {
        steps.iter().fold(Distances::default(), |sum, step| Distances {
            by_position_m: sum.by_position_m + step.by_position_m,
            by_speed_m: sum.by_speed_m + step.by_speed_m,
        })
    };
    let between = total(steps.get(first..end).unwrap_or_default());
    let compared = if between.by_speed_m < DISTANCE_MIN_M { total(&steps) } else { between };
    if compared.by_speed_m < DISTANCE_MIN_M || compared.by_position_m < 0.5 * compared.by_speed_m {
        return None;
    }
    Some((
        compared.by_position_m / compared.by_speed_m,
        END_ERROR_M * std::f64::consts::SQRT_2 / compared.by_speed_m,
    ))
}

/// A way in m by position and by integrated speed.
#[derive(Clone, Copy, Default)]
struct Distances {
    by_position_m: f64,
    by_speed_m: f64,
}

/// The distances between samples with a position.
fn distances(recording: &Recording) -> Vec<Distances> {
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
                by_position_m: sample.direction * (position_m - before_m),
                by_speed_m: mean_mps * (time_s[i] - time_s[k]),
            });
        }
        last = Some((i, position_m));
    }
    distances
}

#[cfg(test)]
mod tests {
    use super::super::coasting;
    use super::*;
    use dynocar_model::force::ResolvedSample;
    use dynocar_model::simulate::BridgeLimits;

    const SCALE: f64 = 1.02;

    /// A train at 20 m/s whose wheels count 2 % too much, with balises at some chainages.
    fn recording(balises_m: &[f64]) -> Recording {
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
        Recording::new((0..2500).map(sample).collect(), BridgeLimits::default()).unwrap()
    }

    #[test]
    fn between_the_first_and_the_last_balise_the_ratio_is_that_of_the_wheels() {
        // 3 km before the first and 2.5 km behind the last, of 10 km.
        let (ratio, _) = distance_ratio(&recording(&[3001.0, 5001.0, 7501.0])).unwrap();
        assert!((ratio * SCALE - 1.0).abs() < 1e-9, "{ratio}");
    }

    #[test]
    fn an_odometer_that_nothing_corrects_says_what_its_wheels_say() {
        let (ratio, deviation) = distance_ratio(&recording(&[])).unwrap();
        assert!((ratio - 1.0).abs() < 1e-9, "{ratio}");
        assert!(deviation > 1e-3, "{deviation}");
    }
}
