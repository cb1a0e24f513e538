//! Time from which a brake drags in each run: by the speeds, and by a brake-cylinder pressure that stays while no brake
//! is reported.

use dynocar_model::terms::brake::{BUILD_UP_S, build_up};

use crate::explain::answer::RunWindow;
use crate::explain::evidence::RunData;
use crate::explain::scan::{Scan, Tuple};
use crate::statistics::middle;

/// Least distance in s between the onsets that are tried first, and greatest number of them in a run.
pub(super) const GRID_MIN_S: f64 = 12.0;
const GRID_PLACES: f64 = 120.0;
/// Final resolution of each onset in s.
const FINEST_S: f64 = 2.0;
/// Least motion in s after an onset.
pub(super) const TAIL_MIN_S: f64 = 40.0;
/// Least gain that a run must add beyond the choice of its onset: brakes release in nine runs of ten, and this is twice
/// the logarithm of ten.
const RUN_COST: f64 = 4.6;
/// Greatest number of changes of the onsets beyond the number of runs.
const CHANGES_BESIDE_RUNS: usize = 4;

/// The onsets of one run, by time, with their tuples.
struct Onsets {
    /// Distance in s between them.
    grid_s: f64,
    times_s: Vec<f64>,
    tuples: Vec<Tuple>,
}

pub(super) fn onset_tuple(scan: &Scan, index: usize, onset_s: f64) -> Tuple {
    scan.run_tuple(index, |run, i| {
        -build_up(run.recording.time_s()[i] - onset_s) / run.samples()[i].inertial_mass_kg
    })
}

impl Onsets {
    fn of(scan: &Scan, index: usize) -> Self {
        let run = &scan.problem.runs[index];
        let last_s = run.duration_s() - TAIL_MIN_S;
        let grid_s = GRID_MIN_S.max(last_s / GRID_PLACES);
        let count = (last_s / grid_s).floor().max(0.0) as usize;
        let first_s = run.bins.first().map_or(0.0, |bin| bin.time_s) - BUILD_UP_S;
        let times_s: Vec<f64> = std::iter::once(first_s)
            .chain((1..count).map(|k| grid_s * k as f64).filter(|&time| time > first_s))
            .collect();
        let tuples = times_s.iter().map(|&onset_s| onset_tuple(scan, index, onset_s)).collect();
        Onsets { grid_s, times_s, tuples }
    }

    /// Returns the least gain that the run must add.
    fn cost(&self) -> f64 {
        2.0 * (self.times_s.len().max(2) as f64).ln() + RUN_COST
    }
}

/// Windows from the speeds of the fit runs: a common force, an onset for each run that takes
/// part, improved by one run's onset at a time until nothing changes.
pub(super) fn by_speed(scan: &Scan) -> Option<(Vec<RunWindow>, f64, f64)> {
    let count = scan.problem.runs.len();
    let onsets: Vec<Onsets> = (0..count).map(|index| Onsets::of(scan, index)).collect();
    let mut chosen: Vec<Option<usize>> = vec![None; count];
    let mut best = 0.0;
    for _ in 0..CHANGES_BESIDE_RUNS + count {
        let Some((reached, index, choice)) = best_change(scan, &onsets, &chosen, best) else {
            break;
        };
        best = reached;
        chosen[index] = choice;
    }
    if chosen.iter().all(Option::is_none) {
        return None;
    }
    Some(refined(scan, &onsets, &chosen))
}

/// The change of one run's onset that brings most, if any brings more than `best`.
fn best_change(
    scan: &Scan,
    onsets: &[Onsets],
    chosen: &[Option<usize>],
    mut best: f64,
) -> Option<(f64, usize, Option<usize>)> {
    let taking_part = || onsets.iter().zip(chosen).filter_map(|(own, k)| Some((own, (*k)?)));
    let mut all = Tuple::zero(scan.fit.theta.len());
    taking_part().for_each(|(own, k)| all.add(&own.tuples[k]));
    let all_cost: f64 = taking_part().map(|(own, _)| own.cost()).sum();
    let mut change = None;
    for (index, own) in onsets.iter().enumerate() {
        let (mut sum, mut cost) = (all.clone(), all_cost);
        if let Some(k) = chosen[index] {
            sum.take_out(&own.tuples[k]);
            cost -= own.cost();
        }
        let mut consider = |sum: &Tuple, cost: f64, choice: Option<usize>| {
            let (gain, estimate) = scan.gain(sum);
            if estimate > 0.0 && gain - cost > best + 1e-9 {
                best = gain - cost;
                change = Some((best, index, choice));
            }
        };
        if chosen[index].is_some() {
            consider(&sum, cost, None);
        }
        for (k, tuple) in own.tuples.iter().enumerate() {
            sum.add(tuple);
            consider(&sum, cost + own.cost(), Some(k));
            sum.take_out(tuple);
        }
    }
    change
}

/// Onsets to about a bin, one run after the other.
fn refined(scan: &Scan, onsets: &[Onsets], chosen: &[Option<usize>]) -> (Vec<RunWindow>, f64, f64) {
    let mut found: Vec<(usize, f64, Tuple)> = Vec::new();
    let mut choice_cost = 0.0;
    for (index, choice) in chosen.iter().enumerate() {
        if let Some(k) = choice {
            let onsets = &onsets[index];
            found.push((index, onsets.times_s[*k], onsets.tuples[*k].clone()));
            choice_cost += onsets.cost();
        }
    }
    let count = scan.fit.theta.len();
    for at in 0..found.len() {
        let mut rest = Tuple::zero(count);
        for (other, (_, _, tuple)) in found.iter().enumerate() {
            if other != at {
                rest.add(tuple);
            }
        }
        let mut step_s = onsets[found[at].0].grid_s;
        while step_s > FINEST_S {
            step_s /= 6.0;
            let (index, middle_s, _) = found[at];
            let best = (-6..=6)
                .map(|k| {
                    let onset_s = middle_s + step_s * f64::from(k);
                    let own = onset_tuple(scan, index, onset_s);
                    let mut sum = rest.clone();
                    sum.add(&own);
                    (scan.gain(&sum).0, onset_s, own)
                })
                .max_by(|one, other| one.0.total_cmp(&other.0));
            if let Some((_, onset_s, own)) = best {
                found[at] = (index, onset_s, own);
            }
        }
    }
    let mut sum = Tuple::zero(count);
    let mut windows = Vec::new();
    for (index, onset_s, tuple) in &found {
        sum.add(tuple);
        let run = &scan.problem.runs[*index];
        windows.push(RunWindow {
            run: run.file.clone(),
            t_start_s: run.offset_s + onset_s.max(0.0),
            t_end_s: run.offset_s + run.duration_s(),
        });
    }
    (windows, scan.gain(&sum).1, choice_cost)
}

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
pub fn by_pressure<'r>(runs: impl Iterator<Item = &'r RunData> + Clone) -> Option<Vec<RunWindow>> {
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
