//! What is known of the load, and when it may have become another one.

use crate::force::ResolvedSample;
use crate::pipeline::mass::motion::StopWatch;

use super::settings::TrainKalmanSettings;

/// A mass in a sample that differs by less than this share from the one before is the same.
const SAME_SHARE: f64 = 1e-4;

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
    is_weighed: bool,
    has_departed: bool,
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
        }
    }

    /// True when the train left a stop with the newest sample.
    pub fn departed(&self) -> bool {
        self.has_departed
    }

    /// True when the newest samples carry a mass.
    pub fn is_weighed(&self) -> bool {
        self.is_weighed
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
        self.has_departed = self.stops.departs(sample.time_ns, sample.stretch, sample.speed_mps);
        let before_kg = self.declared_kg.replace(sample.mass_kg);
        let anew = Change::Anew(self.prior_variance());
        let Some(before_kg) = before_kg else { return Some(anew) };
        let is_same = (sample.mass_kg / before_kg - 1.0).abs() <= SAME_SHARE;
        if !is_same && self.is_weighed {
            return Some(anew);
        }
        // A weighing that is exact leaves nothing open.
        let is_exact = self.is_weighed && self.mass_std == 0.0;
        (self.has_departed && !is_exact)
            .then(|| Change::Opened(self.load_change_std.powi(2), self.load_std.powi(2)))
    }
}
