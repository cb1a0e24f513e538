//! Wheels that slip or slide without a report of it: their speed leaves, for a few seconds, the one that the forces
//! explain, upwards under strong traction and downwards under strong braking.
//!
//! A train's own speed differs from the integral of its control force and of the declared gradient by resistances and
//! errors of the map, which change slowly, and by forces that act late, which stays. Only a wheel comes back to where it
//! was.

use dynocar_model::force::ResolvedSample;

use super::bins::{MOVING_MPS, SEGMENT_GAP_MAX_S};
use crate::statistics::middle;

/// Half the time in s over which a speed is compared with its surroundings, and the least such half near an end.
const HALF_WINDOW_S: f64 = 4.0;
const HALF_WINDOW_LEAST_S: f64 = 2.0;
/// Half the time in s over which the noise of a speed is averaged.
const HALF_MEAN_S: f64 = 0.5;
/// Least share of the greatest force at which wheels slip.
const STRONG_SHARE: f64 = 0.4;
/// Least departure in m/s of a wheel that slips, and the same in usual departures.
const LEAST_MPS: f64 = 0.25;
const LEAST_SPREADS: f64 = 6.0;
/// Share of the usual departures that are smaller than one spread.
const SPREAD_QUANTILE: f64 = 0.75;
/// Least number of samples with a strong force that show the usual departures.
const SAMPLES_MIN: usize = 50;
/// Greatest share of a run in which wheels slip: more is another effect.
const SHARE_MAX: f64 = 0.05;
/// Greatest number of departures the other way, as a share of these: cars on couplings swing both ways.
const BACK_SHARE_MAX: f64 = 0.25;

/// Marks the samples at which wheels slip or slide.
pub(super) fn mark_slides(samples: &mut [ResolvedSample]) {
    let Some(first_ns) = samples.first().map(|sample| sample.time_ns) else { return };
    let since_s = |sample: &ResolvedSample| (sample.time_ns - first_ns) as f64 * 1e-9;
    let time_s: Vec<f64> = samples.iter().map(since_s).collect();
    let efforts_mps2: Vec<f64> = samples.iter().map(effort_mps2).collect();
    let strong_mps2 = STRONG_SHARE * greatest(&efforts_mps2);
    let mut departures = Vec::new();
    for stretch in stretches(samples, &time_s, &efforts_mps2) {
        let (first, times_s) = (stretch.start, &time_s[stretch.clone()]);
        let efforts_mps2 = &efforts_mps2[stretch.clone()];
        let left_mps =
            averaged(&unexplained_mps(&samples[stretch], times_s, efforts_mps2), times_s);
        let mut window = Vec::new();
        for (i, effort_mps2) in efforts_mps2.iter().enumerate() {
            if effort_mps2.abs() > strong_mps2
                && let Some(departure) = departure_mps(&left_mps, times_s, i, &mut window)
            {
                departures.push((first + i, departure * effort_mps2.signum()));
            }
        }
    }
    if departures.len() < SAMPLES_MIN {
        return;
    }
    let mut sizes: Vec<f64> = departures.iter().map(|(_, mps)| mps.abs()).collect();
    let at = (SPREAD_QUANTILE * sizes.len() as f64) as usize;
    let spread = *sizes.select_nth_unstable_by(at, f64::total_cmp).1;
    let bound = LEAST_MPS.max(LEAST_SPREADS * spread);
    let found = || departures.iter().filter(|(_, mps)| *mps > bound);
    let count = found().count() as f64;
    let back = departures.iter().filter(|(_, mps)| *mps < -bound).count() as f64;
    if count <= SHARE_MAX * samples.len() as f64 && back <= BACK_SHARE_MAX * count {
        found().for_each(|(i, _)| samples[*i].is_sliding = true);
    }
}

/// Acceleration in m/s² by the control force; `NaN` where that is not known.
fn effort_mps2(sample: &ResolvedSample) -> f64 {
    sample.control_force_n().map_or(f64::NAN, |force_n| force_n / sample.inertial_mass_kg)
}

/// The size that one in a hundred exceeds.
fn greatest(values: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = values.iter().map(|it| it.abs()).filter(|it| !it.is_nan()).collect();
    let at = sizes.len() * 99 / 100;
    if sizes.is_empty() { 0.0 } else { *sizes.select_nth_unstable_by(at, f64::total_cmp).1 }
}

/// Returns the stretches of motion without a gap whose forces are known.
fn stretches(
    samples: &[ResolvedSample],
    time_s: &[f64],
    efforts_mps2: &[f64],
) -> Vec<std::ops::Range<usize>> {
    let is_usable = |i: usize| samples[i].speed_mps > MOVING_MPS && !efforts_mps2[i].is_nan();
    let mut stretches: Vec<std::ops::Range<usize>> = Vec::new();
    for i in (0..samples.len()).filter(|&i| is_usable(i)) {
        match stretches.last_mut() {
            Some(last) if last.end == i && time_s[i] - time_s[i - 1] <= SEGMENT_GAP_MAX_S => {
                last.end += 1;
            }
            _ => stretches.push(i..i + 1),
        }
    }
    stretches
}

/// Returns the speeds in m/s less the integral of the acceleration by the control force and the declared gradient.
fn unexplained_mps(samples: &[ResolvedSample], time_s: &[f64], efforts_mps2: &[f64]) -> Vec<f64> {
    let declared_mps2 = |i: usize| {
        let sample = &samples[i];
        let slope_n = sample.weight_kn * sample.gradient_permille.unwrap_or(0.0);
        efforts_mps2[i] - slope_n / sample.inertial_mass_kg
    };
    let mut gained_mps = 0.0;
    let gained = (0..samples.len()).map(|i| {
        if i > 0 {
            let mean_mps2 = 0.5 * (declared_mps2(i - 1) + declared_mps2(i));
            gained_mps += mean_mps2 * (time_s[i] - time_s[i - 1]);
        }
        samples[i].speed_mps - gained_mps
    });
    gained.collect()
}

/// Returns the samples within some s of a sample.
fn within(time_s: &[f64], i: usize, half_s: f64) -> std::ops::Range<usize> {
    let near = |at_s: f64| at_s - time_s[i];
    let first = time_s[..i].partition_point(|&at_s| near(at_s) < -half_s - 1e-9);
    first..i + time_s[i..].partition_point(|&at_s| near(at_s) <= half_s + 1e-9)
}

fn averaged(values: &[f64], time_s: &[f64]) -> Vec<f64> {
    let mean = |i: usize| {
        let around = &values[within(time_s, i, HALF_MEAN_S)];
        around.iter().sum::<f64>() / around.len() as f64
    };
    (0..values.len()).map(mean).collect()
}

/// Returns by how much a value leaves the median around it; `None` too near an end.
fn departure_mps(values: &[f64], time_s: &[f64], i: usize, window: &mut Vec<f64>) -> Option<f64> {
    let to_ends_s = (time_s[i] - time_s[0]).min(time_s[time_s.len() - 1] - time_s[i]);
    let half_s = HALF_WINDOW_S.min(to_ends_s);
    if half_s < HALF_WINDOW_LEAST_S {
        return None;
    }
    window.clear();
    window.extend_from_slice(&values[within(time_s, i, half_s)]);
    Some(values[i] - middle(window)?)
}

#[cfg(test)]
mod tests {
    use super::super::coasting;
    use super::*;

    /// Pulls of 12 s with 0.8 m/s² every 30 s, which act late by a time in s, on a gradient of 30 ‰ that grows without a
    /// declaration; speeds with a little noise, and with an addition.
    fn marked(late_s: f64, added_mps: impl Fn(f64) -> f64) -> Vec<f64> {
        let is_pulled = |at_s: f64| at_s > 0.0 && at_s % 30.0 < 12.0;
        let pulled_s = |at_s: f64| {
            let at_s = at_s.max(0.0);
            12.0 * (at_s / 30.0).floor() + (at_s % 30.0).min(12.0)
        };
        let gradient_permille = 30.0;
        let weight_kn = 9.81e-3;
        let slope_mps =
            |at_s: f64| -weight_kn * gradient_permille * at_s - 0.15 * (at_s - 66.0).max(0.0);
        let samples = (0..600).map(|k| {
            let at_s = 0.2 * f64::from(k);
            let noise_mps = 0.03 * ((k * 7919 % 13) as f64 / 6.0 - 1.0);
            let own_mps = 40.0 + 0.8 * pulled_s(at_s - late_s) + slope_mps(at_s);
            ResolvedSample {
                time_ns: (at_s * 1e9).round() as i64,
                speed_mps: own_mps + noise_mps + added_mps(at_s),
                traction_force_n: Some(if is_pulled(at_s) { 0.8 } else { 0.0 }),
                brake_force_n: Some(0.0),
                gradient_permille: Some(gradient_permille),
                weight_kn,
                inertial_mass_kg: 1.0,
                ..coasting()
            }
        });
        let mut samples: Vec<ResolvedSample> = samples.collect();
        mark_slides(&mut samples);
        let sliding = samples.iter().filter(|sample| sample.is_sliding);
        sliding.map(|sample| sample.time_ns as f64 * 1e-9).collect()
    }

    fn slip_mps(at_s: f64) -> f64 {
        let share = (at_s - 65.0) / 2.0;
        if (0.0..1.0).contains(&share) {
            0.8 * (std::f64::consts::PI * share).sin().powi(2)
        } else {
            0.0
        }
    }

    #[test]
    fn a_slip_without_a_report_is_seen_where_it_is() {
        let marked = marked(0.0, slip_mps);
        assert!(marked.len() >= 3, "{marked:?}");
        assert!(marked.iter().all(|at_s| (65.0..67.0).contains(at_s)), "{marked:?}");
    }

    #[test]
    fn late_forces_gradients_and_noise_are_no_slip() {
        for late_s in [0.0, 0.3, 0.6] {
            assert_eq!(marked(late_s, |_| 0.0), [0.0; 0], "{late_s}");
        }
    }

    #[test]
    fn a_car_that_swings_on_its_coupling_does_not_slip() {
        let swings_mps = |at_s: f64| slip_mps(at_s) - slip_mps(at_s - 2.0);
        assert_eq!(marked(0.0, swings_mps), [0.0; 0]);
    }

    #[test]
    fn what_happens_without_traction_is_no_slip() {
        assert_eq!(marked(0.0, |at_s| slip_mps(at_s - 12.0)), [0.0; 0]);
    }
}
