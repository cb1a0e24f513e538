//! What one unit of each suspect would retard the train at a sample, and its impulse by blocks.

use nalgebra::SVector;

use super::place_memory::PlaceMemory;
use super::suspects::{Place, SUSPECTS};
use crate::force::ResolvedSample;
use crate::pipeline::resistance::sample::UnitSample;
use crate::train::Davis;

/// One value for each suspect of the bank.
pub type Covariates = SVector<f64, SUSPECTS>;

/// Time constant in s with which bearings warm up.
const WARM_UP_S: f64 = 200.0;
/// A longer standstill in s cools the bearings and counts as the start of a new run.
const COLD_AFTER_S: f64 = 900.0;
/// Temperature in °C for which coefficients are declared.
const REFERENCE_DEGC: f64 = 15.0;

/// Since when the train has been running.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RunClock {
    start_ns: Option<i64>,
    last_ns: i64,
}

impl RunClock {
    /// Takes in the time of a sample; true when a run starts with it: the first sample, a clock
    /// set back, or a long gap.
    pub fn push(&mut self, time_ns: i64) -> bool {
        let gap_s = time_ns.saturating_sub(self.last_ns) as f64 * 1e-9;
        self.last_ns = time_ns;
        let starts = self.start_ns.is_none() || !(0.0..=COLD_AFTER_S).contains(&gap_s);
        if starts {
            self.start_ns = Some(time_ns);
        }
        starts
    }

    fn seconds(&self) -> f64 {
        self.start_ns.map_or(0.0, |start| self.last_ns.saturating_sub(start) as f64 * 1e-9)
    }
}

/// The retarding force in N/kN of one unit of each suspect.
pub fn covariates(
    sample: &ResolvedSample,
    unit: &UnitSample,
    declared: &Davis,
    clock: &RunClock,
    places: &PlaceMemory,
) -> Covariates {
    let speed = sample.speed_mps;
    let tunnel_share = sample.tunnel_share.unwrap_or(0.0);
    let w0 = declared.w0_n_per_kn(speed);
    let air = declared.c * speed * speed;
    let mut values = Covariates::zeros();
    let mut set = |place: Place, value: f64| values[place as usize] = value;
    set(Place::TunnelDrag, tunnel_share * air);
    set(Place::CurveResistance, 1000.0 * sample.curvature_per_m.unwrap_or(0.0).abs());
    set(Place::Wind, sample.direction * 2.0 * declared.c * speed * (1.0 - tunnel_share));
    set(Place::MassChange, unit.traction - unit.brake);
    set(Place::TractionGain, unit.traction);
    set(Place::RotatingMass, unit.driving - w0);
    set(Place::BearingTemperature, declared.a * (-clock.seconds() / WARM_UP_S).exp());
    let warmer_k = sample.ambient_temperature_degc.map_or(0.0, |degc| degc - REFERENCE_DEGC);
    set(Place::AmbientTemperature, w0 * 0.1 * warmer_k);
    set(Place::LocalResistance, sample.position_m.map_or(0.0, |m| places.earlier(m)));
    set(Place::LowAdhesion, unit.brake);
    values
}

/// Integrals of the covariates from the mean of one block to that of the next, weighed as the
/// momentum's own impulse is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CovariateImpulse {
    chain_start_ns: i64,
    last_ns: i64,
    last: Covariates,
    integral: Covariates,
    sum: Covariates,
    count: f64,
}

impl CovariateImpulse {
    /// Without samples.
    pub fn new() -> Self {
        CovariateImpulse {
            chain_start_ns: i64::MIN,
            last_ns: 0,
            last: Covariates::zeros(),
            integral: Covariates::zeros(),
            sum: Covariates::zeros(),
            count: 0.0,
        }
    }

    /// Takes in a sample of the chain that began at `chain_start_ns`.
    pub fn push(&mut self, chain_start_ns: i64, time_ns: i64, values: &Covariates) {
        if chain_start_ns == self.chain_start_ns && time_ns != chain_start_ns {
            let half_s = 0.5 * time_ns.saturating_sub(self.last_ns) as f64 * 1e-9;
            self.integral += (self.last + values) * half_s;
        } else {
            *self = CovariateImpulse { chain_start_ns, ..CovariateImpulse::new() };
        }
        self.sum += self.integral;
        self.count += 1.0;
        (self.last, self.last_ns) = (*values, time_ns);
    }

    /// Ends the block; gives the impulse since the mean of the one before.
    pub fn close(&mut self) -> Covariates {
        let mean = self.sum / self.count.max(1.0);
        self.integral -= mean;
        self.sum = Covariates::zeros();
        self.count = 0.0;
        mean
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_covariate_gives_the_time_between_the_means_of_blocks() {
        let mut impulse = CovariateImpulse::new();
        let ones = Covariates::repeat(2.0);
        for k in 0..10 {
            impulse.push(0, k * 1_000_000_000, &ones);
        }
        assert!((impulse.close()[0] - 2.0 * 4.5).abs() < 1e-12);
        for k in 10..20 {
            impulse.push(0, k * 1_000_000_000, &ones);
        }
        assert!((impulse.close()[0] - 2.0 * 10.0).abs() < 1e-12);
    }

    #[test]
    fn a_run_starts_when_the_clock_is_set_back() {
        let mut clock = RunClock::default();
        assert!(clock.push(5_000_000_000));
        assert!(!clock.push(6_000_000_000));
        assert!(clock.push(1_000_000_000));
        assert!(clock.push(1_000_000_000_000));
    }
}
