//! Where in a run the brake was applied until the train stood: in full, or as a driver wanted.

use std::ops::RangeInclusive;

use dynocar_model::terms::wheel::STANDING_MPS;
use dynocar_model::train::EffortCurve;
use dynocar_shared::{SampleField, TrainSample};
use serde::Serialize;

/// Below this speed in m/s a driver may let the brake go, so that the stop is soft.
const SOFT_MPS: f64 = 2.0;
/// Without a record of the brake, a train that loses less than this in m/s² is not braking.
const BRAKING_MPS2: f64 = 0.2;
/// Time in s over which the loss of speed is taken.
const LOOK_BACK_S: f64 = 3.0;
/// Share of the brake's effort from which on it is applied at all.
const APPLIED_AT_ALL: f64 = 0.1;
/// Without a record of the brake, a driver eases and renews it at a platform: it is applied as long as
/// the train loses this much in m/s²...
const EASED_MPS2: f64 = 0.1;
/// ... over this time in s.
const EASED_LOOK_S: f64 = 10.0;
/// A longer time in s between two samples ends a stop.
const GAP_MAX_S: f64 = 3.0;

/// What counts as a stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FindSettings {
    /// Least share of the brake's effort that counts as applied.
    pub share_min: f64,
    /// Slowest speed in m/s that a stop starts from.
    pub from_mps: f64,
}

impl Default for FindSettings {
    fn default() -> Self {
        FindSettings { share_min: 0.85, from_mps: 5.0 }
    }
}

/// What showed that the brake was applied.
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
pub struct Stop {
    /// Its samples in the run, from the last application of the brake on.
    pub samples: RangeInclusive<usize>,
    /// The sample from which on the brake was applied in full; `None` where it never was.
    pub full_from: Option<usize>,
    /// What showed that the brake was applied.
    pub found_by: FoundBy,
}

/// The stops of a run, in order. Recorders may pause while the train stands.
pub fn find(
    samples: &[TrainSample],
    brake: Option<&EffortCurve>,
    settings: &FindSettings,
) -> Vec<Stop> {
    let full = applied(samples, brake, settings.share_min);
    let at_all = applied(samples, brake, APPLIED_AT_ALL.min(settings.share_min));
    let found_by = if full.is_some() { FoundBy::Brake } else { FoundBy::Speed };
    let is_applied =
        |applied: &Option<Vec<bool>>, index: usize, look_s: f64, least_mps2: f64| match applied {
            Some(applied) => applied[index] || samples[index].speed_mps < SOFT_MPS,
            None => loses_speed(samples, index, look_s, least_mps2),
        };
    let is_full = |index: usize| is_applied(&full, index, LOOK_BACK_S, BRAKING_MPS2);
    let is_any = |index: usize| is_applied(&at_all, index, EASED_LOOK_S, EASED_MPS2);
    let ends = (1..samples.len()).filter(|&index| {
        samples[index].speed_mps <= STANDING_MPS && samples[index - 1].speed_mps > STANDING_MPS
    });
    let is_fast = |index: &usize| samples[*index].speed_mps >= settings.from_mps;
    let stop = |end: usize| {
        let full_from = Some(start(samples, end, is_full)).filter(is_fast);
        let mut from = start(samples, end, is_any);
        // A long look sees the brake before it comes.
        while at_all.is_none() && from < end && !is_full(from) {
            from += 1;
        }
        let from = full_from.map_or(from, |full| full.min(from));
        is_fast(&from).then_some(Stop { samples: from..=end, full_from, found_by })
    };
    ends.filter_map(stop).collect()
}

/// The first sample from which on the brake is applied until the end of a stop.
fn start(samples: &[TrainSample], end: usize, is_braking: impl Fn(usize) -> bool) -> usize {
    let follows = |index: usize| time_s(samples, index) - time_s(samples, index - 1) <= GAP_MAX_S;
    let mut from = end;
    while from > 0 && follows(from) && is_braking(from - 1) {
        from -= 1;
    }
    // What is left of an earlier stop at the same place belongs to that.
    let stood = (from..end).rev().find(|&at| samples[at].speed_mps <= STANDING_MPS);
    stood.map_or(from, |stood| stood + 1)
}

/// Whether the brake is applied at each sample; `None` where no sample shows it.
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

/// Whether a train loses so much in m/s² over a time in s after a sample, or until it stands.
fn loses_speed(samples: &[TrainSample], index: usize, look_s: f64, least_mps2: f64) -> bool {
    let lost = |from: usize, to: usize| {
        let over_s = time_s(samples, to) - time_s(samples, from);
        over_s > 0.0 && samples[from].speed_mps - samples[to].speed_mps >= least_mps2 * over_s
    };
    let now_s = time_s(samples, index);
    let later = (index..samples.len()).find(|&it| time_s(samples, it) >= now_s + look_s);
    let later = later.unwrap_or(samples.len() - 1);
    let stands = (index..=later).find(|&it| samples[it].speed_mps <= STANDING_MPS);
    lost(index, stands.unwrap_or(later))
}

fn time_s(samples: &[TrainSample], index: usize) -> f64 {
    1e-9 * samples[index].time_ns as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynocar_shared::TrainId;

    /// A minute at 20 m/s, a stop at 1 m/s², ten seconds of standing; the brake as given.
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

    fn found(samples: &[TrainSample]) -> Vec<Stop> {
        let brake = EffortCurve::new(vec![(0.0, 100e3)]);
        find(samples, brake.as_ref(), &FindSettings::default())
    }

    /// Where the brake was applied in full, in s.
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
        let [Stop { samples, full_from: None, .. }] = &found(&half)[..] else { panic!("one stop") };
        assert!((time_s(&half, *samples.start()) - 60.0).abs() < 0.3);
        let soft = run(|time_s| Some(if (59.9..78.5).contains(&time_s) { 100e3 } else { 0.0 }));
        assert_eq!(starts_s(&soft).len(), 1);
        let released = run(|time_s| Some(if (59.9..70.0).contains(&time_s) { 100e3 } else { 0.0 }));
        assert!(found(&released).is_empty());
    }
}
