//! What is known of the load, and when it may have become another one.

use dynocar_model::force::ResolvedSample;

use crate::pipeline::motion::{StopWatch, is_same_mass};

use super::TrainKalmanSettings;

/// What a sample changes in what is known of the load: the declared mass over the true one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Change {
    /// It is as far as known as a new weighing or a declaration allows: this variance about 1.
    Anew(f64),
    /// It may have become another one by this variance, up to a greatest one.
    Opened(f64, f64),
}

/// Follows stops and the masses that samples carry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadWatch {
    stops: StopWatch,
    mass_std: f64,
    load_std: f64,
    load_change_std: f64,
    /// Mass in kg that the load factor refers to, once there was a sample.
    declared_kg: Option<f64>,
    /// True when the newest samples carry a mass.
    pub is_weighed: bool,
    /// True when the train left a stop with the newest sample.
    pub has_departed: bool,
    /// True when the load was weighed since the last departure.
    is_fresh: bool,
}

impl LoadWatch {
    /// Before the first sample.
    pub fn new(settings: &TrainKalmanSettings) -> Self {
        LoadWatch {
            stops: StopWatch::new(settings.stop_min_s),
            mass_std: 0.01 * settings.mass_std_percent,
            load_std: 0.01 * settings.load_std_percent,
            load_change_std: 0.01 * settings.load_change_std_percent,
            declared_kg: None,
            is_weighed: false,
            has_departed: false,
            is_fresh: false,
        }
    }

    /// Variance of the load factor by what the samples or the train's file say of it.
    pub fn prior_variance(&self) -> f64 {
        if self.is_weighed { self.mass_std.powi(2) } else { self.load_std.powi(2) }
    }

    /// Mass in kg that the load factor refers to; the declared one before the first sample.
    pub fn declared_kg(&self, train_kg: f64) -> f64 {
        self.declared_kg.unwrap_or(train_kg)
    }

    /// Takes a sample in; what it changes in what is known of the load.
    pub fn see(&mut self, sample: &ResolvedSample) -> Option<Change> {
        self.is_weighed = sample.is_mass_measured;
        self.has_departed = self.stops.departs(sample.time_ns, sample.segment, sample.speed_mps);
        let before_kg = self.declared_kg.replace(sample.mass_kg);
        let anew = Change::Anew(self.prior_variance());
        let Some(before_kg) = before_kg else { return Some(anew) };
        if self.is_weighed && !is_same_mass(before_kg, sample.mass_kg) {
            self.is_fresh = !self.has_departed;
            return Some(anew);
        }
        let was_fresh = self.has_departed && std::mem::take(&mut self.is_fresh);
        (self.has_departed && !was_fresh).then(|| self.opened()).flatten()
    }

    /// What may have boarded; a weighing that did not change leaves as much open as it is off itself.
    fn opened(&self) -> Option<Change> {
        let change = self.load_change_std.powi(2);
        let most = self.prior_variance();
        let by = if self.is_weighed { change.min(2.0 * most) } else { change };
        (most > 0.0).then_some(Change::Opened(by, most))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND_NS: i64 = 1_000_000_000;

    /// What a train that stands from 10 to 40 s changes, with the mass that its samples carry.
    fn changes(
        settings: &TrainKalmanSettings,
        mass_kg: impl Fn(i64) -> Option<f64>,
    ) -> Vec<Change> {
        let mut load = LoadWatch::new(settings);
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
        let (weighed, declared) = (Change::Anew(0.03 * 0.03), Change::Anew(0.15 * 0.15));
        let opened = Change::Opened(0.1 * 0.1, 0.15 * 0.15);
        let weighed_again = Change::Opened(2.0 * 0.03 * 0.03, 0.03 * 0.03);
        let same = |one: &[Change], other: &[Change]| {
            assert_eq!(one.len(), other.len(), "{one:?}");
            for pair in one.iter().zip(other) {
                let (a, b) = match pair {
                    (Change::Anew(a), Change::Anew(b)) => (a, b),
                    (Change::Opened(a, most), Change::Opened(b, same)) => {
                        assert!((most / same - 1.0).abs() < 1e-12, "{pair:?}");
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
        same(&changes(&settings, boarded), &[weighed, weighed]);
    }

    #[test]
    fn a_mass_that_is_exact_is_never_opened() {
        let exact = TrainKalmanSettings { mass_std_percent: 0.0, ..Default::default() };
        assert_eq!(changes(&exact, |_| Some(100e3)), [Change::Anew(0.0)]);
    }
}
