//! Replacement of outliers by their neighbours' median before anything is fitted.

use dynocar_model::force::ResolvedSample;

use crate::statistics::middle;

/// Number of samples on each side with which a value is compared.
const HALF_WINDOW: usize = 3;
/// Least deviation of an outlier from the surrounding median, in usual deviations.
const OUTLIER_SPREADS: f64 = 8.0;

/// Sampling period in s above which the neighbours do not show whether a value is an outlier.
const SPARSE_S: f64 = 0.5;
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
/// force, a speed by 0.25 m/s: less than that averages out. Samples more than `SPARSE_S` apart
/// cannot distinguish an outlier from a short application of the brake, or from the bend of a speed where
/// it ends: forces stay, except those next to a missing one, whose duration is unknown, and speeds
/// may bend as sharply as a train's do.
pub(super) fn clean(samples: &mut [ResolvedSample], period_s: f64) -> usize {
    let mut speeds: Vec<f64> = samples.iter().map(|sample| sample.speed_mps).collect();
    let is_sparse = period_s > SPARSE_S;
    let bend_mps = if is_sparse { SPEED_BEND_MPS2 * HALF_WINDOW as f64 * period_s } else { 0.0 };
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
        for ((&row, &value), is_open) in rows.iter().zip(&values).zip(is_open) {
            let own = field(&mut samples[row]);
            if *own != Some(value) && (is_open || !is_sparse) {
                *own = Some(value);
                replaced += 1;
            }
        }
    }
    replaced
}

#[cfg(test)]
mod tests {
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
    fn a_noisy_ramp_is_left_alone() {
        let mut values: Vec<f64> =
            (0..200).map(|k| 0.1 * f64::from(k) + 0.02 * f64::from(k * 7919 % 13)).collect();
        assert_eq!(replace_outliers(&mut values, 0.0), 0);
    }
}
