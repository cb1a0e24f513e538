//! What the estimate is worth, and how it stands in a snapshot.

use dynocar_shared::{Manoeuvre, Parameter, ParameterSnapshot, Quantity};
use nalgebra::{Matrix4, Vector4};

use super::bank::Published;
use super::motion_filter::COEFFICIENTS;
use super::systematic::Systematic;
use crate::pipeline::momentum::{regressors, unscaling};
use crate::pipeline::motion::SpeedRange;
use crate::pipeline::output::write_parameters;

/// Index of the load factor among what is published.
const LOAD: usize = COEFFICIENTS;

/// A judgement with hysteresis: what is known becomes unknown only well beyond where it became known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    enter_below: f64,
    leave_above: f64,
    is_known: bool,
}

impl Level {
    /// Known from a relative standard deviation on, until another one is passed.
    pub const fn new(enter_below: f64, leave_above: f64) -> Self {
        Level { enter_below, leave_above, is_known: false }
    }

    /// Takes in a relative standard deviation.
    pub fn see(&mut self, relative_std: f64) {
        let bound = if self.is_known { self.leave_above } else { self.enter_below };
        self.is_known = relative_std <= bound;
    }

    /// The judgement.
    pub fn is_known(&self) -> bool {
        self.is_known
    }
}

/// The estimate as it is published.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Report {
    /// a, b, c (scaled, N/kN) and the declared mass over the true one.
    mean: Vector4<f64>,
    covariance: Matrix4<f64>,
    /// Disturbance in N/kN with its standard deviation.
    disturbance: (f64, f64),
    resistance: Level,
    mass: Level,
}

/// Standard deviation of w0 at the speeds driven, as a share of it: known below the first, unknown
/// again above the second.
const RESISTANCE_LEVEL: Level = Level::new(0.15, 0.22);
/// Standard deviation of the mass as a share of it. A load that changed at a stop does not make the
/// mass unknown: its interval says how much may have boarded.
const MASS_LEVEL: Level = Level::new(0.025, 0.12);
/// Share of w0 that a coefficient's standard deviation may reach while it counts as excited.
const EXCITED_SHARE: f64 = 0.25;

impl Report {
    /// Before any sample.
    pub fn new(published: &Published) -> Self {
        Report {
            mean: published.mean,
            covariance: published.covariance,
            disturbance: published.disturbance,
            resistance: RESISTANCE_LEVEL,
            mass: MASS_LEVEL,
        }
    }

    /// Takes over what is believed now, its covariance times a factor and widened by what is
    /// systematic, and judges it at the speeds driven.
    pub fn take(
        &mut self,
        published: &Published,
        inflation: f64,
        systematic: &Systematic,
        speeds: &SpeedRange,
    ) {
        self.mean = published.mean;
        self.covariance = published.covariance * inflation;
        systematic.widen(&self.mean, &mut self.covariance);
        self.disturbance = published.disturbance;
        self.resistance.see(self.resistance_std_share(speeds));
        self.mass.see(self.covariance[(LOAD, LOAD)].max(0.0).sqrt() / self.mean[LOAD]);
    }

    /// The greatest standard deviation of w0 as a share of it, at the middle and near the top of the
    /// speeds driven.
    fn resistance_std_share(&self, speeds: &SpeedRange) -> f64 {
        let Some((low, high)) = speeds.get() else { return f64::INFINITY };
        [0.5, 0.9].map(|share| self.w0(low + share * (high - low))).into_iter().fold(
            0.0,
            |greatest: f64, (w0, std)| match w0 > 0.0 {
                true => greatest.max(std / w0),
                false => f64::INFINITY,
            },
        )
    }

    /// w0 in N/kN at a speed in m/s with its standard deviation.
    fn w0(&self, speed_mps: f64) -> (f64, f64) {
        let [one, linear, square] = regressors(speed_mps);
        let row = Vector4::new(one, linear, square, 0.0);
        (row.dot(&self.mean), row.dot(&(self.covariance * row)).max(0.0).sqrt())
    }

    /// The quantities whose intervals are narrow enough.
    pub fn known(&self) -> u32 {
        let bit = |level: &Level, quantity: Quantity| u32::from(level.is_known) * quantity.bit();
        bit(&self.resistance, Quantity::Resistance) | bit(&self.mass, Quantity::Mass)
    }

    /// Variance of the declared mass over the true one.
    pub fn load_variance(&self) -> f64 {
        self.covariance[(LOAD, LOAD)]
    }

    /// Writes values, covariance, excitation and the unexplained force; `declared_kg` is the mass
    /// that the load factor refers to.
    pub fn write(&self, declared_kg: f64, speeds: &SpeedRange, snapshot: &mut ParameterSnapshot) {
        let factors = unscaling();
        let mass_kg = declared_kg / self.mean[LOAD];
        let to_units = Vector4::new(factors[0], factors[1], factors[2], -mass_kg / self.mean[LOAD]);
        let mut values = self.mean.component_mul(&to_units);
        values[LOAD] = mass_kg;
        let scale = Matrix4::from_diagonal(&to_units);
        write_parameters(
            snapshot,
            [Parameter::DavisA, Parameter::DavisB, Parameter::DavisC, Parameter::Mass],
            &values,
            &(scale * self.covariance * scale),
        );
        self.write_excitation(speeds, snapshot);
        let weight_kn = dynocar_model::train::TrainModel::weight_kn(mass_kg);
        snapshot.unexplained_force_n = self.disturbance.0 * weight_kn;
        snapshot.unexplained_force_std_n = self.disturbance.1 * weight_kn;
        speeds.write(snapshot);
    }

    fn write_excitation(&self, speeds: &SpeedRange, snapshot: &mut ParameterSnapshot) {
        let top_mps = speeds.get().map_or(0.0, |(_, high)| high);
        let powers = regressors(top_mps);
        let w0 = self.w0(top_mps).0;
        let is_excited = |i: usize| match i {
            LOAD => self.mass.is_known(),
            _ => self.covariance[(i, i)].max(0.0).sqrt() * powers[i] < EXCITED_SHARE * w0,
        };
        let manoeuvres = [
            Manoeuvre::CoastSlow,
            Manoeuvre::VarySpeed,
            Manoeuvre::CoastFast,
            Manoeuvre::Accelerate,
        ];
        snapshot.excited = 0;
        snapshot.missing_manoeuvres = 0;
        for (i, manoeuvre) in manoeuvres.into_iter().enumerate() {
            match is_excited(i) {
                true => snapshot.excited |= 1 << i,
                false => snapshot.missing_manoeuvres |= manoeuvre.bit(),
            }
        }
    }
}
