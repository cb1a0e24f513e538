//! The state before the first sample, everything that samples teach but an unexplained braking must not, and the times
//! at which the load may have changed.

use dynocar_model::force::ResolvedSample;
use dynocar_model::train::{Davis, TrainModel};
use nalgebra::{Matrix3, Vector3};

use super::TrainKalmanSettings;
use super::brake::BrakeErrors;
use super::motion_bank::{MotionBank, SpeedLikelihood};
use super::motion_filter::{
    BRAKE_ERROR, BRAKE_SCALE, COEFFICIENTS, FORCE_DELAY, LOAD, MotionState, RESISTANCE, SPEED,
    StateCovariance, TRACTION_SCALE, WIND,
};
use super::weigher::{LoadChange, Weigher};
use crate::pipeline::InnovationMonitor;
use crate::pipeline::momentum::{regressors, scaled, unscaling};
use crate::pipeline::motion::{SpeedNoise, StopWatch, is_same_mass};

/// Innovations that the published statistics look back over.
const INNOVATION_MEMORY: u32 = 1000;

/// State, noise and the record of innovations.
#[derive(Clone, Debug)]
pub struct LearnedState {
    /// The filters.
    pub bank: MotionBank,
    /// Noise of the measured speed.
    pub noise: SpeedNoise,
    /// Contribution of forces that jump between two samples.
    pub jumps: JumpShare,
    /// How late and how strong brakes are.
    pub brake: BrakeErrors,
    /// Innovations so far.
    pub monitor: InnovationMonitor,
}

impl LearnedState {
    /// Before any sample.
    pub fn new(settings: &TrainKalmanSettings, first: &ResistanceBelief) -> Self {
        LearnedState {
            bank: first.bank(settings),
            noise: SpeedNoise::guessed(settings.speed_noise_mps),
            jumps: JumpShare::default(),
            brake: BrakeErrors::new(settings.brake_scale_std, settings.brake_lag_s),
            monitor: InnovationMonitor::new(INNOVATION_MEMORY),
        }
    }
}

/// Weight that the first share counts for, and the weight of the memory.
const WEIGHT_FIRST: f64 = 3.0;
const WEIGHT_MAX: f64 = 300.0;
/// Share of an innovation's variance from which it says something of jumps.
const SEEN_SHARE: f64 = 0.1;
/// Limits of the logarithm of a single innovation's variance, and of the shares.
const SEEN: (f64, f64) = (-4.0, 12.0);
const SHARES: (f64, f64) = (1e-3, 12.0);

/// The share of [`crate::pipeline::motion::jump_variance`] that the forces of a train bring, by the
/// innovations at changes of force: 1 where nobody knows when within a step a force changed, hardly
/// anything where it runs straight between samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JumpShare {
    /// The share.
    pub share: f64,
    weight: f64,
}

impl Default for JumpShare {
    fn default() -> Self {
        JumpShare { share: 1.0, weight: WEIGHT_FIRST }
    }
}

impl JumpShare {
    /// Takes in an innovation: its square has the mean of the rest of its variance and the share of the
    /// jump's.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn learn(&mut self, measured: &SpeedLikelihood) {
        let of_variance = measured.jump_variance / measured.variance;
        if !(of_variance > SEEN_SHARE * self.share.min(1.0)) {
            return;
        }
        let whole = measured.jump_variance / self.share;
        let rest = measured.variance - measured.jump_variance;
        let seen = ((measured.innovation_mps.powi(2) - rest) / whole).clamp(SEEN.0, SEEN.1);
        let weight = (whole / measured.variance).powi(2).min(1.0);
        self.weight = (self.weight + weight).min(WEIGHT_MAX);
        self.share += (seen - self.share) * weight / self.weight;
        self.share = self.share.clamp(SHARES.0, SHARES.1);
    }
}

/// No declared coefficient is taken for known better than one that makes this share of w0 at 20 m/s: a
/// declared zero is no knowledge.
const FLOOR_SHARE: f64 = 0.2;

/// a, b, c (scaled, N/kN) with their covariance, declared or kept from earlier.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResistanceBelief {
    mean: Vector3<f64>,
    covariance: Matrix3<f64>,
}

impl ResistanceBelief {
    /// As declared, each coefficient to a share of itself.
    pub fn declared(davis: &Davis, relative_std: f64) -> Self {
        let mean = scaled(davis);
        let floor = FLOOR_SHARE * davis.w0_n_per_kn(20.0).abs();
        let stds = mean.map(|value| relative_std * value.abs().max(floor));
        ResistanceBelief { mean, covariance: Matrix3::from_diagonal(&stds.component_mul(&stds)) }
    }

    /// Standard deviation of a in N/kN.
    pub fn a_std(&self) -> f64 {
        self.covariance[(0, 0)].sqrt()
    }

    /// As kept from earlier: Davis a, b, c and their covariance.
    pub fn kept(davis: &Vector3<f64>, covariance: &Matrix3<f64>) -> Self {
        let scale = Matrix3::from_diagonal(&unscaling().map(|factor| 1.0 / factor));
        ResistanceBelief { mean: scale * davis, covariance: scale * covariance * scale }
    }

    /// c, scaled.
    pub fn air_resistance(&self) -> f64 {
        self.mean[2]
    }

    /// Returns the addition of a headwind of 1 m/s at a speed in m/s, in N/kN.
    pub fn by_wind(&self, speed_mps: f64) -> f64 {
        let square = |mps: f64| regressors(mps)[2];
        0.5 * self.mean[2] * (square(speed_mps + 1.0) - square(speed_mps - 1.0))
    }

    /// Returns the addition of the square of a wind of 1 m/s, in N/kN.
    pub fn by_wind_square(&self) -> f64 {
        self.mean[2] * regressors(1.0)[2]
    }

    /// Filters that believe this, and forces and load as the settings trust them.
    pub fn bank(&self, settings: &TrainKalmanSettings) -> MotionBank {
        let mut mean = MotionState::zeros();
        mean[LOAD] = 1.0;
        mean.fixed_rows_mut::<COEFFICIENTS>(RESISTANCE).copy_from(&self.mean);
        let mut all = StateCovariance::zeros();
        all[(SPEED, SPEED)] = 1.0;
        all[(LOAD, LOAD)] = (0.01 * settings.load_std_percent).powi(2);
        all.fixed_view_mut::<COEFFICIENTS, COEFFICIENTS>(RESISTANCE, RESISTANCE)
            .copy_from(&self.covariance);
        all[(TRACTION_SCALE, TRACTION_SCALE)] = settings.force_scale_std.powi(2);
        all[(BRAKE_ERROR, BRAKE_ERROR)] = 1.0;
        all[(BRAKE_SCALE, BRAKE_SCALE)] = settings.brake_scale_std.powi(2);
        all[(FORCE_DELAY, FORCE_DELAY)] = settings.force_delay_std_s.powi(2);
        all[(WIND, WIND)] = settings.wind_std_mps.powi(2);
        let weigher = Weigher::new((0.01 * settings.mass_std_percent).powi(2));
        MotionBank::new(&mean, &all, weigher)
    }
}

/// Standard deviation in N/kN of the declared a before any sample, by default.
pub fn declared_a_std(train: &dynocar_model::train::TrainModel) -> f64 {
    let relative_std = TrainKalmanSettings::default().prior_relative_std;
    ResistanceBelief::declared(&train.resistance, relative_std).a_std()
}

/// Share by which a learned mass may lie outside a declared range from tare to full: crowded trains, forces a little
/// off.
const OUTSIDE_RANGE_MAX: f64 = 0.12;
/// Share by which a learned mass may differ from a weighed one: scales that are off, or a constant in their place.
const OFF_WEIGHED_MAX: f64 = 0.2;
/// Standard deviations by which a learned mass may differ from one that is declared without a range.
const DECLARED_STDS_MAX: f64 = 4.0;

/// Follows stops and the masses that samples carry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadWatch {
    stops: StopWatch,
    mass_std: f64,
    /// Mean and standard deviation where samples carry no mass.
    declared: (f64, f64),
    /// Least and greatest mass in kg by a declared range from tare to full.
    range_kg: Option<(f64, f64)>,
    /// Least and greatest mass in kg where nothing but one mass is declared.
    usual_kg: (f64, f64),
    load_change_std: f64,
    /// Mass in kg that the load factor refers to; `None` before the first sample.
    declared_kg: Option<f64>,
    /// Mass in kg that was weighed last while the load could change.
    weighed_kg: Option<f64>,
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
        let (tare_kg, usual_std) = (train.mass_kg, DECLARED_STDS_MAX * load_std);
        let range_of = |full_kg: f64| {
            ((1.0 - OUTSIDE_RANGE_MAX) * tare_kg, (1.0 + OUTSIDE_RANGE_MAX) * full_kg)
        };
        LoadWatch {
            range_kg: train.full_mass_kg.map(range_of),
            usual_kg: (tare_kg / (1.0 + usual_std), tare_kg / (1.0 - usual_std).max(0.0)),
            stops: StopWatch::new(settings.stop_min_s),
            mass_std: 0.01 * settings.mass_std_percent,
            declared,
            load_change_std: 0.01 * settings.load_change_std_percent,
            declared_kg: None,
            weighed_kg: None,
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

    /// Variance of a weighing, as a share of the mass.
    pub fn weighing_variance(&self) -> f64 {
        self.mass_std * self.mass_std
    }

    /// Returns the change by which only that is known of the load.
    pub fn renewed(&self) -> LoadChange {
        let (mean, variance) = self.prior();
        match self.is_weighed {
            true => LoadChange::Weighed,
            false => LoadChange::Anew(mean, variance),
        }
    }

    /// Returns the least and the greatest mass in kg that neither the declaration nor the samples contradict: forces that
    /// show another one are not those of the whole train, or are in another unit.
    pub fn allowed_kg(&self) -> (f64, f64) {
        let weighed_kg = self.declared_kg.filter(|_| self.is_weighed);
        let near = |kg: f64| ((1.0 - OFF_WEIGHED_MAX) * kg, (1.0 + OFF_WEIGHED_MAX) * kg);
        match (self.range_kg, weighed_kg.map(near)) {
            (Some(range), Some(near)) => (range.0.max(near.0), range.1.min(near.1)),
            // A weighed train of any number of wagons has little to do with the one mass of its file.
            (Some(one), None) | (None, Some(one)) => one,
            (None, None) => self.usual_kg,
        }
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
        let anew = self.renewed();
        let Some(before_kg) = before_kg else {
            self.weighed_kg = Some(sample.mass_kg).filter(|_| self.is_weighed);
            return Some(anew);
        };
        if self.is_weighed && !is_same_mass(before_kg, sample.mass_kg) {
            let is_under_way = !(was_open || self.is_open || self.has_departed);
            let changed = sample.mass_kg / self.weighed_kg.unwrap_or(0.0) - 1.0;
            if is_under_way && changed.abs() < self.mass_std {
                return Some(LoadChange::ShownAs(sample.mass_kg / before_kg));
            }
            self.is_fresh = !self.has_departed;
            self.weighed_kg = Some(sample.mass_kg);
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
    use super::*;
    use crate::pipeline::motion::Trust;

    #[test]
    fn the_share_follows_the_squares_of_the_innovations_at_changes_of_force() {
        let learned = |innovation_mps: f64| {
            let mut jumps = JumpShare::default();
            for _ in 0..2000 {
                let jump_variance = 1e-3 * jumps.share;
                jumps.learn(&SpeedLikelihood {
                    trust: Trust::from_normalised(0.0),
                    innovation_mps,
                    variance: 1e-3 + jump_variance,
                    jump_variance,
                });
            }
            jumps.share
        };
        assert!((learned(2e-3_f64.sqrt()) - 1.0).abs() < 0.05);
        assert!((learned(1.5e-3_f64.sqrt()) - 0.5).abs() < 0.1);
        assert!(learned(0.0) < 0.15, "no jump at all");
    }
}
