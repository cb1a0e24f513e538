//! Brake-cylinder pressure that stays while no brake is reported.

use super::answer::RunWindow;
use super::evidence::RunData;
use crate::statistics::middle;

/// Time in s in which the cylinders empty after the brake force has gone.
const RELEASE_S: f64 = 6.0;
/// Least rise in Pa of the pressure with a released brake that counts as lasting pressure.
const STEP_MIN_PA: f64 = 2500.0;
/// Least rise, in multiples of the scatter of the pressure on either side of the step.
const STEP_SPREADS: f64 = 4.0;
/// Least number of released samples on either side of a step.
const SAMPLES_MIN: usize = 20;

/// Times in s from the run's start and pressures in Pa while the brake is released.
fn released(run: &RunData) -> Vec<(f64, f64)> {
    let (samples, time_s) = (run.samples(), run.recording.time_s());
    let strongest = samples.iter().filter_map(|sample| sample.brake_force_n).fold(0.0, f64::max);
    let mut braked_s = f64::NEG_INFINITY;
    let mut points = Vec::new();
    for (sample, &time_s) in samples.iter().zip(time_s) {
        if sample.brake_force_n.is_none_or(|force| force > 0.01 * strongest) {
            braked_s = time_s;
        } else if time_s - braked_s > RELEASE_S
            && let Some(pressure) = sample.brake_cylinder_pressure_pa
        {
            points.push((time_s, pressure));
        }
    }
    points
}

/// Returns the instant from which the pressure of one run is higher for good.
fn onset_s(points: &[(f64, f64)], baseline_pa: f64) -> Option<f64> {
    if points.len() < 2 * SAMPLES_MIN {
        return None;
    }
    // The split that leaves the least squares.
    let total: f64 = points.iter().map(|point| point.1).sum();
    let (mut sum, mut best) = (0.0, None::<(f64, usize)>);
    for (k, point) in points.iter().enumerate() {
        let (before, after) = (k as f64, (points.len() - k) as f64);
        if k >= SAMPLES_MIN && points.len() - k >= SAMPLES_MIN {
            let between = (total - sum) / after - sum / before;
            let explained = between.signum() * between * between * before * after;
            if best.is_none_or(|(most, _)| explained > most) {
                best = Some((explained, k));
            }
        }
        sum += point.1;
    }
    let (_, split) = best?;
    let (before, after) = points.split_at(split);
    let pressures =
        |points: &[(f64, f64)]| points.iter().map(|point| point.1).collect::<Vec<f64>>();
    let [mut before_pa, mut after_pa] = [before, after].map(pressures);
    let (low, high) = (middle(&mut before_pa)?, middle(&mut after_pa)?);
    let deviation = |half: &[f64], level: f64| {
        let mut away: Vec<f64> = half.iter().map(|pressure| (pressure - level).abs()).collect();
        Some(1.48 * middle(&mut away)?)
    };
    let spread = deviation(&before_pa, low)?.max(deviation(&after_pa, high)?);
    let is_step = high - low > STEP_MIN_PA.max(STEP_SPREADS * spread);
    if is_step {
        return Some(points[split].0);
    }
    // High from the start.
    let is_high = low.min(high) - baseline_pa > STEP_MIN_PA.max(STEP_SPREADS * spread);
    is_high.then_some(0.0)
}

/// Returns the windows, in the recordings' own time, in which the cylinders of some runs keep a pressure;
/// `None` when no pressure says anything.
pub fn windows<'r>(runs: impl Iterator<Item = &'r RunData> + Clone) -> Option<Vec<RunWindow>> {
    let points: Vec<(&RunData, Vec<(f64, f64)>)> = runs.map(|run| (run, released(run))).collect();
    let medians: Vec<f64> = points
        .iter()
        .filter(|(_, points)| points.len() >= SAMPLES_MIN)
        .filter_map(|(_, points)| {
            middle(&mut points.iter().map(|point| point.1).collect::<Vec<f64>>())
        })
        .collect();
    let baseline_pa = medians.iter().copied().fold(f64::INFINITY, f64::min);
    let windows: Vec<RunWindow> = points
        .iter()
        .filter_map(|(run, points)| {
            let onset_s = onset_s(points, baseline_pa)?;
            Some(RunWindow {
                run: run.file.clone(),
                t_start_s: run.offset_s + onset_s,
                t_end_s: run.offset_s + run.duration_s(),
            })
        })
        .collect();
    (!windows.is_empty()).then_some(windows)
}
