//! A run cleaned and thinned before anything is fitted: outliers become their neighbours' median, and samples about a
//! second apart stand for those that they replace, each as their mean.
//!
//! Speeds and forces are averaged alike, so that the mean speed is still the integral of the mean acceleration; only
//! terms that are not linear in the speed change, by the variance of the speed within a second. A mean ends where the
//! traits of the samples change (a gap, rest, a sliding wheel, a missing value).

use dynocar_model::force::ResolvedSample;
use dynocar_model::simulate::{OpenLoopRecording, STANDING_MPS};
use dynocar_model::terms::Resistance;

use super::bins::{MOVING_MPS, SEGMENT_GAP_MAX_S};
use crate::statistics::middle;

/// Time in s that one mean replaces.
pub(super) const MEAN_S: f64 = 1.0;

/// The samples of a recording, thinned.
pub(super) fn thinned(recording: &OpenLoopRecording) -> Vec<ResolvedSample> {
    let (samples, time_s) = (recording.samples(), recording.time_s());
    let mut means: Vec<ResolvedSample> = Vec::new();
    let mut first = 0;
    for i in 1..=samples.len() {
        // The small margin keeps rounded times from splitting a mean.
        let is_end = i == samples.len()
            || time_s[i] - time_s[first] >= MEAN_S * (1.0 - 1e-6)
            || time_s[i] - time_s[i - 1] > SEGMENT_GAP_MAX_S
            || recording.starts(i)
            || recording.is_simulated(i) != recording.is_simulated(i - 1)
            || traits(&samples[i]) != traits(&samples[i - 1]);
        if is_end {
            means.push(mean(&samples[first..i], means.last()));
            first = i;
        }
    }
    means.shrink_to_fit();
    means
}

/// Returns the traits that the samples of a mean share.
fn traits(sample: &ResolvedSample) -> (u32, bool, [bool; 5], [bool; 8]) {
    let speeds = [0.0, STANDING_MPS, MOVING_MPS].map(|least| sample.speed_mps > least);
    let known = [
        sample.position_m,
        sample.traction_force_n,
        sample.brake_force_n,
        sample.gradient_permille,
        sample.curvature_per_m,
        sample.tunnel_share,
        sample.brake_cylinder_pressure_pa,
        sample.ambient_temperature_degc,
    ];
    let [moves, is_off, runs] = speeds;
    let states = [moves, is_off, runs, sample.is_mass_measured, sample.is_sliding];
    (sample.segment, sample.direction > 0.0, states, known.map(|it| it.is_some()))
}

/// The mean of samples that follow each other, behind another.
fn mean(samples: &[ResolvedSample], before: Option<&ResolvedSample>) -> ResolvedSample {
    let (first, count) = (&samples[0], samples.len() as f64);
    let of = |value: fn(&ResolvedSample) -> f64| samples.iter().map(value).sum::<f64>() / count;
    let known = |value: fn(&ResolvedSample) -> Option<f64>| {
        let sum: Option<f64> = samples.iter().map(value).sum();
        sum.map(|sum| sum / count)
    };
    let since_ns: i64 = samples.iter().map(|sample| sample.time_ns - first.time_ns).sum();
    let time_ns = first.time_ns + since_ns / samples.len() as i64;
    let before = before.filter(|before| before.segment == first.segment);
    let mut parts = [0.0; Resistance::PARTS];
    for sample in samples {
        for (sum, part) in parts.iter_mut().zip(sample.resistance.parts()) {
            *sum += part / count;
        }
    }
    ResolvedSample {
        time_ns,
        step_s: before.map_or(0.0, |before| (time_ns - before.time_ns) as f64 * 1e-9),
        position_m: known(|it| it.position_m),
        speed_mps: of(|it| it.speed_mps),
        mass_kg: of(|it| it.mass_kg),
        inertial_mass_kg: of(|it| it.inertial_mass_kg),
        weight_kn: of(|it| it.weight_kn),
        traction_force_n: known(|it| it.traction_force_n),
        brake_force_n: known(|it| it.brake_force_n),
        gradient_permille: known(|it| it.gradient_permille),
        gradient_std_permille: of(|it| it.gradient_std_permille),
        curvature_per_m: known(|it| it.curvature_per_m),
        resistance: Resistance::of_parts(parts),
        extra_n_per_kn: of(|it| it.extra_n_per_kn),
        tunnel_share: known(|it| it.tunnel_share),
        brake_cylinder_pressure_pa: known(|it| it.brake_cylinder_pressure_pa),
        ambient_temperature_degc: known(|it| it.ambient_temperature_degc),
        since_cold_s: of(|it| it.since_cold_s),
        ..*first
    }
}

/// Number of samples on each side with which a value is compared.
const HALF_WINDOW: usize = 3;
/// Least deviation of an outlier from the surrounding median, in usual deviations.
const OUTLIER_SPREADS: f64 = 8.0;

/// Sampling periods in s above which a window is longer than a short application of the brake, and above which the
/// neighbours do not show at all whether a value is an outlier.
const DENSE_S: f64 = 0.25;
const SPARSE_S: f64 = 0.5;
/// How many times the steps around it a value's own steps have to be, to stand alone.
const ALONE_TIMES: f64 = 2.0;
/// Sharpest bend of a speed curve in m/s².
const SPEED_BEND_MPS2: f64 = 1.5;

/// Replaces outliers by the median around them; returns their number. `least` is the difference below which no value is
/// an outlier.
pub(super) fn replace_outliers(values: &mut [f64], least: f64) -> usize {
    if values.len() <= 2 * HALF_WINDOW {
        return 0;
    }
    let original = values.to_vec();
    let mut window = [0.0; 2 * HALF_WINDOW + 1];
    let medians: Vec<f64> = original
        .windows(window.len())
        .filter_map(|around| {
            window.copy_from_slice(around);
            middle(&mut window)
        })
        .collect();
    let mut differences: Vec<f64> =
        medians.iter().zip(&original[HALF_WINDOW..]).map(|(m, v)| (v - m).abs()).collect();
    let at = differences.len() * 3 / 4;
    let spread = *differences.select_nth_unstable_by(at, f64::total_cmp).1;
    let bound = least.max(OUTLIER_SPREADS * spread);
    let mut replaced = 0;
    for (value, middle) in values[HALF_WINDOW..].iter_mut().zip(&medians) {
        if (*value - middle).abs() > bound {
            *value = *middle;
            replaced += 1;
        }
    }
    replaced
}

/// Cleans forces, speeds and pressures of a run; returns the number of replaced values.
///
/// A force counts as an outlier when it leaves its neighbours by a tenth of the run's greatest
/// force, a speed by 0.25 m/s: less than that averages out. Where samples are more than `DENSE_S` apart, a force has
/// to stand alone, too, since the peak of a short application leaves the window's median as far, and speeds may bend
/// as sharply as a train's do. Those more than `SPARSE_S` apart cannot distinguish an outlier from such a peak:
/// forces stay, except those next to a missing one, whose duration is unknown.
pub(super) fn clean(samples: &mut [ResolvedSample], period_s: f64) -> usize {
    let mut speeds: Vec<f64> = samples.iter().map(|sample| sample.speed_mps).collect();
    let (is_dense, is_sparse) = (period_s <= DENSE_S, period_s > SPARSE_S);
    let bend_mps = if is_dense { 0.0 } else { SPEED_BEND_MPS2 * HALF_WINDOW as f64 * period_s };
    let mut replaced = replace_outliers(&mut speeds, 0.25 + bend_mps);
    for (sample, speed_mps) in samples.iter_mut().zip(speeds) {
        sample.speed_mps = speed_mps;
    }
    let fields: [fn(&mut ResolvedSample) -> &mut Option<f64>; 3] = [
        |sample| &mut sample.traction_force_n,
        |sample| &mut sample.brake_force_n,
        |sample| &mut sample.brake_cylinder_pressure_pa,
    ];
    for field in fields {
        let rows: Vec<usize> =
            (0..samples.len()).filter(|&row| field(&mut samples[row]).is_some()).collect();
        let mut values: Vec<f64> =
            rows.iter().map(|&row| field(&mut samples[row]).unwrap_or(0.0)).collect();
        let recorded = values.clone();
        let mut sorted = values.clone();
        sorted.sort_unstable_by(f64::total_cmp);
        let high = sorted.get(sorted.len() * 99 / 100).copied().unwrap_or(0.0);
        replace_outliers(&mut values, 0.1 * high.max(1.0));
        let mut is_missing =
            |row: usize| samples.get_mut(row).is_some_and(|sample| field(sample).is_none());
        let is_open: Vec<bool> = rows
            .iter()
            .map(|&row| is_missing(row + 1) || is_missing(row.wrapping_sub(1)))
            .collect();
        for (at, (&row, &value)) in rows.iter().zip(&values).enumerate() {
            let own = field(&mut samples[row]);
            let is_outlier = is_dense || is_open[at] || (!is_sparse && is_alone(&recorded, at));
            if *own != Some(value) && is_outlier {
                *own = Some(value);
                replaced += 1;
            }
        }
    }
    replaced
}

/// Returns whether a value leaves both neighbours on one side, by far more than its neighbours leave theirs.
fn is_alone(values: &[f64], at: usize) -> bool {
    let step = |from: usize| {
        let pair = values.get(from).zip(values.get(from + 1));
        pair.map_or(0.0, |(one, other)| other - one)
    };
    let Some(before) = at.checked_sub(1) else { return false };
    let (up, down) = (step(before), -step(at));
    let mut around =
        [step(at.saturating_sub(2)), step(at.saturating_sub(3)), step(at + 1), step(at + 2)]
            .map(f64::abs);
    around.sort_unstable_by(f64::total_cmp);
    // The greatest may be the step of another outlier.
    up * down > 0.0 && up.abs().min(down.abs()) > ALONE_TIMES * around[2]
}

#[cfg(test)]
mod tests {
    use super::super::coasting;
    use super::*;

    fn at(second: f64, speed_mps: f64, traction_n: f64) -> ResolvedSample {
        ResolvedSample {
            time_ns: (second * 1e9).round() as i64,
            speed_mps,
            traction_force_n: Some(traction_n),
            ..coasting()
        }
    }

    fn thin(samples: Vec<ResolvedSample>) -> Vec<ResolvedSample> {
        thinned(&OpenLoopRecording::new(samples).unwrap())
    }

    #[test]
    fn a_mean_stands_for_a_second_and_keeps_speeds_forces_and_their_integral() {
        let samples: Vec<_> =
            (0..50).map(|k| at(0.2 * f64::from(k), 10.0 + 0.1 * f64::from(k), 1e3)).collect();
        let means = thin(samples.clone());
        assert_eq!(means.len(), 10);
        let mean_of = |samples: &[ResolvedSample]| {
            samples.iter().map(|it| it.speed_mps).sum::<f64>() / samples.len() as f64
        };
        assert!((mean_of(&means) - mean_of(&samples)).abs() < 1e-12);
        assert_eq!(means[3].time_ns, 3_400_000_000);
        assert_eq!(means[3].traction_force_n, Some(1e3));
    }

    #[test]
    fn a_stop_a_gap_and_a_missing_force_end_a_mean() {
        let mut samples: Vec<_> = (0..20).map(|k| at(0.2 * f64::from(k), 10.0, 0.0)).collect();
        samples[7].speed_mps = 0.0;
        samples[12].traction_force_n = None;
        samples.truncate(18);
        samples.push(at(30.0, 10.0, 0.0));
        let means = thin(samples);
        let at_rest: Vec<_> = means.iter().filter(|it| it.speed_mps == 0.0).collect();
        assert_eq!((at_rest.len(), at_rest[0].time_ns), (1, 1_400_000_000));
        assert_eq!(means.last().map(|it| it.time_ns), Some(30_000_000_000));
    }

    #[test]
    fn samples_a_second_apart_stay_as_they_are() {
        let samples: Vec<_> = (0..9).map(|k| at(f64::from(k), 10.0, 0.0)).collect();
        let means = thin(samples.clone());
        assert_eq!(means.len(), samples.len());
        assert!(means.iter().zip(&samples).all(|(one, other)| one.time_ns == other.time_ns));
    }
}

#[cfg(test)]
mod cleaning_tests {
    use super::super::coasting;
    use super::*;

    #[test]
    fn a_spike_is_replaced_and_a_step_is_kept() {
        let mut values: Vec<f64> = (0..60).map(|k| if k < 30 { 1.0 } else { 9.0 }).collect();
        values[12] = 40.0;
        values[13] = 35.0;
        assert_eq!(replace_outliers(&mut values, 0.25), 2);
        assert!(values[..30].iter().all(|&value| value == 1.0));
        assert!(values[30..].iter().all(|&value| value == 9.0));
    }

    #[test]
    fn a_short_application_of_the_brake_is_no_outlier_where_samples_are_sparse() {
        let brake_n = |row: usize| if row % 20 == 7 { 30e3 } else { 0.0 };
        let sample =
            |row: usize| ResolvedSample { brake_force_n: Some(brake_n(row)), ..coasting() };
        let mut dense: Vec<ResolvedSample> = (0..200).map(sample).collect();
        let mut sparse = dense.clone();
        assert_eq!(clean(&mut dense, 0.2), 10);
        assert_eq!(clean(&mut sparse, 1.0), 0);
        assert!((0..200).all(|row| sparse[row].brake_force_n == Some(brake_n(row))));
        sparse[28].brake_force_n = None;
        assert_eq!(clean(&mut sparse, 1.0), 1, "nobody knows how long it lasted");
        assert_eq!(sparse[27].brake_force_n, Some(0.0));
    }

    #[test]
    fn a_peak_half_a_second_long_is_kept_and_a_value_that_stands_alone_is_not() {
        let peak = [0.0, 30e3, 68e3, 106e3, 131e3, 103e3, 81e3, 40e3];
        let force_n = |row: usize| if row % 40 < 8 { peak[row % 40] } else { 0.0 };
        let sample =
            |row: usize| ResolvedSample { traction_force_n: Some(force_n(row)), ..coasting() };
        let mut samples: Vec<ResolvedSample> = (0..400).map(sample).collect();
        samples[110].traction_force_n = Some(150e3);
        assert_eq!(clean(&mut samples, 0.5), 1);
        assert_eq!(samples[110].traction_force_n, Some(0.0));
        assert_eq!(samples[124].traction_force_n, Some(131e3));
    }

    #[test]
    fn a_noisy_ramp_is_left_alone() {
        let mut values: Vec<f64> =
            (0..200).map(|k| 0.1 * f64::from(k) + 0.02 * f64::from(k * 7919 % 13)).collect();
        assert_eq!(replace_outliers(&mut values, 0.0), 0);
    }
}
