//! Estimate of the load, and the times at which the load may have changed.

use dynocar_model::force::ResolvedSample;
use dynocar_model::train::TrainModel;

use crate::pipeline::motion::{StopWatch, is_same_mass};

use super::TrainKalmanSettings;

/// Change by a sample of the load factor's estimate: the declared mass over the true one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LoadChange {
    /// The load factor starts anew, as well known as a new weighing or the declaration allows: a mean and a variance.
    Anew(f64, f64),
    /// The load may have changed by this variance as a share of its square, at most to the uncertainty of any load of
    /// this mean and variance.
    Opened { by: f64, mean: f64, variance: f64 },
}

/// Follows stops and the masses that samples carry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadWatch {
    stops: StopWatch,
    mass_std: f64,
    /// Mean and standard deviation where samples carry no mass.
    declared: (f64, f64),
    load_change_std: f64,
    /// Mass in kg that the load factor refers to; `None` before the first sample.
    declared_kg: Option<f64>,
    /// True when the newest samples carry a mass.
    pub is_weighed: bool,
    /// True when the train left a stop with the newest sample.
    pub has_departed: bool,
    /// True from when the load may have changed at a stop to the departure.
    is_open: bool,
    /// True when the load was weighed since the last departure.
    is_fresh: bool,
}

impl LoadWatch {
    /// Before the first sample of a train, whose load may be anything between tare and full where these are
    /// declared.
    pub fn new(settings: &TrainKalmanSettings, train: &TrainModel) -> Self {
        let load_std = 0.01 * settings.load_std_percent;
        let declared = train.load_range().map_or((1.0, load_std), |(middle_kg, std_kg)| {
            (train.mass_kg / middle_kg, train.mass_kg * std_kg / (middle_kg * middle_kg))
        });
        LoadWatch {
            stops: StopWatch::new(settings.stop_min_s),
            mass_std: 0.01 * settings.mass_std_percent,
            declared,
            load_change_std: 0.01 * settings.load_change_std_percent,
            declared_kg: None,
            is_weighed: false,
            has_departed: false,
            is_open: false,
            is_fresh: false,
        }
    }

    /// Mean and variance of the load factor according to the samples or the train's file.
    pub fn prior(&self) -> (f64, f64) {
        let (mean, std) = if self.is_weighed { (1.0, self.mass_std) } else { self.declared };
        (mean, std * std)
    }

    /// Mass in kg that the load factor refers to; the declared one before the first sample.
    pub fn declared_kg(&self, train_kg: f64) -> f64 {
        self.declared_kg.unwrap_or(train_kg)
    }

    /// Takes a sample in; returns the change that it makes to the knowledge of the load.
    pub fn see(&mut self, sample: &ResolvedSample) -> Option<LoadChange> {
        self.is_weighed = sample.is_mass_measured;
        self.has_departed = self.stops.departs(sample.time_ns, sample.segment, sample.speed_mps);
        let before_kg = self.declared_kg.replace(sample.mass_kg);
        let was_open = std::mem::replace(&mut self.is_open, self.stops.is_due());
        let (mean, variance) = self.prior();
        let anew = LoadChange::Anew(mean, variance);
        let Some(before_kg) = before_kg else { return Some(anew) };
        if self.is_weighed && !is_same_mass(before_kg, sample.mass_kg) {
            self.is_fresh = !self.has_departed;
            return Some(anew);
        }
        // At the stop, not at the departure: nobody knows who boards while the train stands.
        let opens = !was_open && (self.is_open || self.has_departed);
        let change = (opens && !self.is_fresh).then(|| self.opened()).flatten();
        self.is_fresh &= !self.has_departed;
        change
    }

    /// Returns the possible change by boarding; an unchanged weighing leaves as much open as its own error.
    fn opened(&self) -> Option<LoadChange> {
        let change = self.load_change_std.powi(2);
        let (mean, variance) = self.prior();
        let by = if self.is_weighed { change.min(2.0 * variance) } else { change };
        (variance > 0.0).then_some(LoadChange::Opened { by, mean, variance })
    }
}

#[cfg(test)]
mod tests {
    use dynocar_model::train::Davis;

    use super::*;

    const SECOND_NS: i64 = 1_000_000_000;

    fn train(full_mass_kg: Option<f64>) -> TrainModel {
        TrainModel {
            full_mass_kg,
            ..TrainModel::bare("t", 100e3, Davis { a: 1.0, b: 0.0, c: 0.0 })
        }
    }

    /// Returns the changes by a train that stands from 10 to 40 s, with the mass that its samples carry.
    fn changes(
        settings: &TrainKalmanSettings,
        mass_kg: impl Fn(i64) -> Option<f64>,
    ) -> Vec<LoadChange> {
        let mut load = LoadWatch::new(settings, &train(None));
        let seen = (0..60).filter_map(|second| {
            let mass = mass_kg(second);
            load.see(&ResolvedSample {
                time_ns: second * SECOND_NS,
                speed_mps: if (10..40).contains(&second) { 0.0 } else { 15.0 },
                mass_kg: mass.unwrap_or(100e3),
                is_mass_measured: mass.is_some(),
                ..ResolvedSample::coasting()
            })
        });
        seen.collect()
    }

    #[test]
    fn a_load_is_opened_at_a_stop_and_anew_where_it_was_weighed_again() {
        let settings = TrainKalmanSettings::default();
        let (weighed, declared) =
            (LoadChange::Anew(1.0, 0.03 * 0.03), LoadChange::Anew(1.0, 0.15 * 0.15));
        let open = |by, variance| LoadChange::Opened { by, mean: 1.0, variance };
        let opened = open(0.1 * 0.1, 0.15 * 0.15);
        let weighed_again = open(2.0 * 0.03 * 0.03, 0.03 * 0.03);
        let same = |one: &[LoadChange], other: &[LoadChange]| {
            assert_eq!(one.len(), other.len(), "{one:?}");
            for pair in one.iter().zip(other) {
                let (a, b) = match pair {
                    (LoadChange::Anew(one, a), LoadChange::Anew(other, b)) => {
                        assert_eq!(one, other, "{pair:?}");
                        (a, b)
                    }
                    (
                        LoadChange::Opened { by: a, variance, .. },
                        LoadChange::Opened { by: b, variance: same, .. },
                    ) => {
                        assert!((variance / same - 1.0).abs() < 1e-12, "{pair:?}");
                        (a, b)
                    }
                    _ => panic!("{pair:?}"),
                };
                assert!((a / b - 1.0).abs() < 1e-12, "{pair:?}");
            }
        };
        same(&changes(&settings, |_| None), &[declared, opened]);
        same(&changes(&settings, |_| Some(100e3)), &[weighed, weighed_again]);
        let boarded = |second| Some(if second < 20 { 100e3 } else { 108e3 });
        same(&changes(&settings, boarded), &[weighed, weighed_again, weighed]);
    }

    #[test]
    fn a_mass_that_is_exact_is_never_opened() {
        let exact = TrainKalmanSettings { mass_std_percent: 0.0, ..Default::default() };
        assert_eq!(changes(&exact, |_| Some(100e3)), [LoadChange::Anew(1.0, 0.0)]);
    }

    #[test]
    fn between_tare_and_full_load_any_mass_is_as_likely() {
        let load = LoadWatch::new(&TrainKalmanSettings::default(), &train(Some(140e3)));
        let (mean, variance) = load.prior();
        assert!((mean - 100.0 / 120.0).abs() < 1e-12);
        let std_share = 40.0 / 12_f64.sqrt() / 120.0;
        assert!((variance.sqrt() / mean - std_share).abs() < 1e-12);
    }

    #[test]
    fn a_load_is_opened_while_the_train_stands() {
        let mut load = LoadWatch::new(&TrainKalmanSettings::default(), &train(None));
        let opened_at: Vec<i64> = (0..60)
            .filter(|&second| {
                let speed_mps = if (10..40).contains(&second) { 0.0 } else { 15.0 };
                let time_ns = second * SECOND_NS;
                let sample = ResolvedSample { time_ns, speed_mps, ..ResolvedSample::coasting() };
                matches!(load.see(&sample), Some(LoadChange::Opened { .. }))
            })
            .collect();
        assert_eq!(opened_at, [15]);
    }
}
