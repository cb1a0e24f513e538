//! Brakings to standstill in a run, in full or by the driver's choice, and the moment at which the traction ended.

use std::ops::RangeInclusive;

use dynocar_model::terms::wheel::STANDING_MPS;
use dynocar_model::train::EffortCurve;
use dynocar_shared::{SampleField, TrainSample};
use serde::Serialize;

use crate::dataset::ForceSource;
use crate::statistics::{middle, span};

/// Speed in m/s below which a driver may release the brake for a soft stop.
const SOFT_MPS: f64 = 2.0;
/// Least loss of speed in m/s² of a braking train, where there is no record of the brake.
const BRAKING_MPS2: f64 = 0.2;
/// Time in s over which the loss of speed is measured.
const LOOK_BACK_S: f64 = 3.0;
/// Share of the brake's effort above which it counts as applied.
const APPLIED_AT_ALL: f64 = 0.1;
/// Without a record of the brake, a driver may ease and renew it on the way down and creep to the mark: the stop began
/// earlier if the train was faster by this rate in m/s²...
const FALLING_MPS2: f64 = 0.08;
/// ... and a step of a coarse recorder in m/s...
const STEP_MPS: f64 = 0.3;
/// ... within this time in s before...
const EASED_S: f64 = 15.0;
/// ... or, while it creeps below this speed in m/s, faster by the step alone within this time in s.
const CREEPING: (f64, f64) = (2.5, 40.0);
/// Longest time in s between two samples of a stop, and the same in usual intervals; the greater counts.
const GAP_MAX: (f64, f64) = (3.0, 1.6);
/// A recorder that pauses while a slow train stands may leave out the standstill: the train could come to it
/// in the pause at this deceleration in m/s².
const COMES_TO_STAND_MPS2: f64 = 0.5;

/// Conditions of a stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FindSettings {
    /// Least share of the brake's effort that counts as applied.
    pub share_min: f64,
    /// Slowest speed in m/s that a train has to reach before it stops again.
    pub from_mps: f64,
}

impl Default for FindSettings {
    fn default() -> Self {
        FindSettings { share_min: 0.85, from_mps: 5.0 }
    }
}

/// Sign that the brake was applied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FoundBy {
    /// The recorded force or command of the brake.
    Brake,
    /// The loss of speed: no brake is recorded.
    Speed,
}

/// A stop: from the first sample under the brake to the first that stands.
#[derive(Clone, Debug, PartialEq)]
pub struct StopSpan {
    /// Its samples in the run, from the last application of the brake on.
    pub samples: RangeInclusive<usize>,
    /// The sample from which on the brake was applied in full; `None` where it never was.
    pub full_from: Option<usize>,
    /// Sign that the brake was applied.
    pub found_by: FoundBy,
}

/// Returns the samples with a speed, without those at the places of outliers, each later than the one before, with the
/// standstills that a pausing recorder left out.
pub fn usable(samples: &[TrainSample], outliers: &[usize]) -> Vec<TrainSample> {
    let mut usable: Vec<TrainSample> = Vec::with_capacity(samples.len());
    let is_outlier = |place: usize| outliers.binary_search(&place).is_ok();
    let regular = samples.iter().enumerate().filter(|(place, _)| !is_outlier(*place));
    for sample in
        regular.map(|(_, sample)| sample).filter(|it| it.get(SampleField::Speed).is_some())
    {
        if let Some(&last) = usable.last() {
            if sample.time_ns <= last.time_ns {
                continue;
            }
            let pause_s = 1e-9 * (sample.time_ns - last.time_ns) as f64;
            let stops_s = last.speed_mps / COMES_TO_STAND_MPS2;
            let is_slow = last.speed_mps.max(sample.speed_mps) <= CREEPING.0;
            if is_slow && last.speed_mps > STANDING_MPS && pause_s > GAP_MAX.0.max(2.0 * stops_s) {
                let time_ns = last.time_ns + (1e9 * stops_s) as i64;
                usable.push(TrainSample { time_ns, speed_mps: 0.0, ..last });
            }
        }
        usable.push(*sample);
    }
    usable
}

/// Returns the stops of a run of usable samples, in order.
pub fn find(
    samples: &[TrainSample],
    brake: Option<&EffortCurve>,
    settings: &FindSettings,
) -> Vec<StopSpan> {
    let full = applied(samples, brake, settings.share_min);
    let at_all = applied(samples, brake, APPLIED_AT_ALL.min(settings.share_min));
    let found_by = if full.is_some() { FoundBy::Brake } else { FoundBy::Speed };
    let gap_max_s = GAP_MAX.0.max(GAP_MAX.1 * usual_interval_s(samples));
    let start = |end: usize, applied: &Option<Vec<bool>>| match applied {
        Some(applied) => start(samples, end, gap_max_s, |index| {
            applied[index] || samples[index].speed_mps < SOFT_MPS
        }),
        None => start(samples, end, gap_max_s, |index| loses_speed(samples, index)),
    };
    let ends = (1..samples.len()).filter(|&index| {
        samples[index].speed_mps <= STANDING_MPS && samples[index - 1].speed_mps > STANDING_MPS
    });
    let is_fast = |index: &usize| samples[*index].speed_mps >= settings.from_mps;
    let stop = |end: usize| {
        let mut full_from = Some(start(end, &full)).filter(is_fast);
        let from = match &at_all {
            Some(_) => Some(start(end, &at_all)).filter(is_fast),
            None => None,
        };
        let from = match from {
            Some(from) => from,
            None => {
                let from = fall(samples, end, gap_max_s);
                // A brake that was eased before it was applied in full is the driver's.
                let soon_s = time_s(samples, from) + gap_max_s;
                let is_soon = |it: &usize| at_all.is_some() || time_s(samples, *it) <= soon_s;
                full_from = full_from.filter(is_soon);
                from
            }
        };
        let from = full_from.map_or(from, |full| full.min(from));
        StopSpan { samples: from..=end, full_from, found_by }
    };
    // A train that only moved up has not stopped again.
    let runs = ends.filter(|&end| {
        let since = samples[..end].iter().rev().take_while(|it| it.speed_mps > STANDING_MPS);
        since.map(|it| it.speed_mps).fold(0.0, f64::max) >= settings.from_mps
    });
    runs.map(stop).collect()
}

/// Returns the time in s between most samples.
fn usual_interval_s(samples: &[TrainSample]) -> f64 {
    let mut intervals: Vec<f64> =
        samples.windows(2).map(|it| 1e-9 * (it[1].time_ns - it[0].time_ns) as f64).collect();
    middle(&mut intervals).unwrap_or(0.0)
}

/// Returns the first sample from which on the brake is applied until the end of a stop.
fn start(
    samples: &[TrainSample],
    end: usize,
    gap_max_s: f64,
    is_braking: impl Fn(usize) -> bool,
) -> usize {
    let mut from = end;
    while from > 0 && follows(samples, from, gap_max_s) && is_braking(from - 1) {
        from -= 1;
    }
    from
}

/// Returns whether a sample goes on with the motion that the one before it belongs to.
fn follows(samples: &[TrainSample], index: usize, gap_max_s: f64) -> bool {
    let is_moving = samples[index - 1].speed_mps > STANDING_MPS;
    is_moving && time_s(samples, index) - time_s(samples, index - 1) <= gap_max_s
}

/// Returns the last sample at which the speed began to fall to a standstill, with the brake eased on the way or not.
fn fall(samples: &[TrainSample], end: usize, gap_max_s: f64) -> usize {
    let mut from = end;
    loop {
        let (now_s, speed_mps) = (time_s(samples, from), samples[from].speed_mps);
        let eased_s = if speed_mps <= CREEPING.0 { CREEPING.1 } else { EASED_S };
        let (mut at, mut before) = (from, None);
        while at > 0 && before.is_none() && follows(samples, at, gap_max_s) {
            at -= 1;
            let over_s = now_s - time_s(samples, at);
            let gained_mps = samples[at].speed_mps - speed_mps;
            if over_s > eased_s || gained_mps < -2.0 * STEP_MPS {
                break;
            }
            let rate_mps2 = if speed_mps <= CREEPING.0 { 0.0 } else { FALLING_MPS2 };
            before = (gained_mps >= rate_mps2 * over_s + STEP_MPS).then_some(at);
        }
        match before {
            Some(at) => from = at,
            None => break,
        }
    }
    while from > 0
        && follows(samples, from, gap_max_s)
        && samples[from - 1].speed_mps > samples[from].speed_mps
    {
        from -= 1;
    }
    from
}

/// Returns where between its first two samples a stop began, that goes on as it is seen from the second one on: its
/// time in ns.
pub fn began_ns(samples: &[TrainSample]) -> i64 {
    let [first, second, .., _] = samples else { return samples[0].time_ns };
    let over_s = 1e-9 * (second.time_ns - first.time_ns) as f64;
    let until_s = 1e-9 * second.time_ns as f64 + GAP_MAX.0.max(1.5 * over_s);
    let later = samples[2..].iter().find(|it| 1e-9 * it.time_ns as f64 >= until_s);
    let later = later.unwrap_or(&samples[samples.len() - 1]);
    let rate_mps2 =
        (second.speed_mps - later.speed_mps) / (1e-9 * (later.time_ns - second.time_ns) as f64);
    let fell_s = (first.speed_mps - second.speed_mps) / rate_mps2;
    let late_s = if fell_s.is_finite() { (over_s - fell_s).clamp(0.0, 0.99 * over_s) } else { 0.0 };
    first.time_ns + (1e9 * late_s) as i64
}

/// Returns whether the brake is applied at each sample; `None` where no sample shows it.
fn applied(
    samples: &[TrainSample],
    brake: Option<&EffortCurve>,
    share_min: f64,
) -> Option<Vec<bool>> {
    let brake = brake?;
    let (mut is_applied, mut is_known) = (false, false);
    let applied = samples.iter().map(|sample| {
        if let Some(force_n) = sample.get(SampleField::BrakeForce) {
            is_applied = force_n >= share_min * brake.force_n(sample.speed_mps);
            is_known = true;
        }
        is_applied
    });
    let applied = applied.collect();
    is_known.then_some(applied)
}

/// Returns whether a train brakes in the time after a sample, or until it stands.
fn loses_speed(samples: &[TrainSample], index: usize) -> bool {
    let later_s = time_s(samples, index) + LOOK_BACK_S;
    let is_over =
        |it: &usize| time_s(samples, *it) >= later_s || samples[*it].speed_mps <= STANDING_MPS;
    let later = (index..samples.len()).find(is_over).unwrap_or(samples.len() - 1);
    let over_s = time_s(samples, later) - time_s(samples, index);
    let lost_mps = samples[index].speed_mps - samples[later].speed_mps;
    over_s > 0.0 && lost_mps >= BRAKING_MPS2 * over_s
}

fn time_s(samples: &[TrainSample], index: usize) -> f64 {
    1e-9 * samples[index].time_ns as f64
}

/// Share of a run's greatest traction force from which on a train is driven...
const DRIVEN: f64 = 0.1;
/// ... and share of the force at the brake's command below which it is gone.
const GONE: f64 = 0.05;

/// T_traction_cut_off of some stops.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CutOff {
    /// Stops under whose command the train was still driven.
    pub stops: usize,
    /// Shortest time in s.
    pub least_s: f64,
    /// Longest time in s.
    pub greatest_s: f64,
}

impl CutOff {
    /// Returns the cut-off from the times in s at some stops; `None` without one.
    pub fn from_times(times_s: impl Iterator<Item = f64> + Clone) -> Option<Self> {
        let [least_s, greatest_s] = span(times_s.clone())?;
        Some(CutOff { stops: times_s.count(), least_s, greatest_s })
    }
}

/// Returns the time in s from a sample, that of the brake's command, to the first without traction; `None` where the
/// force is not recorded, did not act at the command, or did not go. A handle is no force.
pub fn cut_off_s(samples: &[TrainSample], command: usize, source: ForceSource) -> Option<f64> {
    if matches!(source, ForceSource::Handle | ForceSource::None) {
        return None;
    }
    let force_n = |sample: &TrainSample| sample.get(SampleField::TractionForce);
    let greatest_n = samples.iter().filter_map(force_n).fold(0.0, f64::max);
    let driven_n = force_n(&samples[command])?;
    if driven_n <= 0.0 || driven_n < DRIVEN * greatest_n {
        return None;
    }
    let gone = samples[command..]
        .iter()
        .find(|it| force_n(it).is_some_and(|force_n| force_n <= GONE * driven_n))?;
    Some(1e-9 * (gone.time_ns - samples[command].time_ns) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynocar_shared::TrainId;

    /// Returns a minute at 20 m/s, a stop at 1 m/s², ten seconds of standing; the brake as given.
    fn run(brake_n: impl Fn(f64) -> Option<f64>) -> Vec<TrainSample> {
        let sample = |k: i32| {
            let time_s = 0.2 * f64::from(k);
            let mut sample = TrainSample::empty(TrainId(1));
            sample.time_ns = (1e9 * time_s) as i64;
            sample.set(SampleField::Speed, (20.0 - (time_s - 60.0).max(0.0)).max(0.0));
            if let Some(force_n) = brake_n(time_s) {
                sample.set(SampleField::BrakeForce, force_n);
            }
            sample
        };
        (0..450).map(sample).collect()
    }

    fn found(samples: &[TrainSample]) -> Vec<StopSpan> {
        let brake = EffortCurve::new(vec![(0.0, 100e3)]);
        find(samples, brake.as_ref(), &FindSettings::default())
    }

    /// Returns where the brake was applied in full, in s.
    fn starts_s(samples: &[TrainSample]) -> Vec<(f64, FoundBy)> {
        let stops = found(samples);
        let full =
            stops.iter().filter_map(|it| Some((time_s(samples, it.full_from?), it.found_by)));
        full.collect()
    }

    #[test]
    fn a_stop_begins_with_the_command_and_without_one_where_the_speed_falls() {
        let commanded = run(|time_s| Some(if time_s > 58.9 { 100e3 } else { 0.0 }));
        let [(start_s, FoundBy::Brake)] = starts_s(&commanded)[..] else { panic!("one stop") };
        assert!((start_s - 59.0).abs() < 1e-6, "{start_s}");
        let [(start_s, FoundBy::Speed)] = starts_s(&run(|_| None))[..] else { panic!("one stop") };
        assert!((start_s - 60.0).abs() < 3.0, "{start_s}");
    }

    #[test]
    fn half_a_brake_is_no_full_stop_and_a_soft_end_is_one() {
        let half = run(|time_s| Some(if time_s > 59.9 { 50e3 } else { 0.0 }));
        assert!(starts_s(&half).is_empty());
        let [StopSpan { samples, full_from: None, .. }] = &found(&half)[..] else {
            panic!("one stop")
        };
        assert!((time_s(&half, *samples.start()) - 60.0).abs() < 0.3);
        let soft = run(|time_s| Some(if (59.9..78.5).contains(&time_s) { 100e3 } else { 0.0 }));
        assert_eq!(starts_s(&soft).len(), 1);
        let released = run(|time_s| Some(if (59.9..70.0).contains(&time_s) { 100e3 } else { 0.0 }));
        let [StopSpan { full_from: None, .. }] = found(&released)[..] else { panic!("one stop") };
    }
}
