//! What one unit of each column would retard the train at a sample, and its impulse by blocks.

use dynocar_model::force::ResolvedSample;
use dynocar_model::terms::SuspectInput;
use dynocar_model::train::Davis;
use nalgebra::SVector;

use super::place_memory::PlaceMemory;
use super::suspects::{COVARIATES, covariate};
use crate::pipeline::momentum::sample::UnitSample;

/// One value for each column that comes from samples.
pub type Covariates = SVector<f64, COVARIATES>;

/// A longer gap in s between two samples is the start of a new run.
const RUN_GAP_S: f64 = 900.0;

/// Separates one run from the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RunClock {
    last_ns: Option<i64>,
}

impl RunClock {
    /// Takes in the time of a sample; true when a run starts with it: the first sample, a clock
    /// set back, or a long gap.
    pub fn push(&mut self, time_ns: i64) -> bool {
        let last_ns = self.last_ns.replace(time_ns);
        let gap_s = last_ns.map(|last_ns| time_ns.saturating_sub(last_ns) as f64 * 1e-9);
        !gap_s.is_some_and(|gap_s| (0.0..=RUN_GAP_S).contains(&gap_s))
    }
}

/// The retarding force in N/kN of one unit of each column.
pub fn covariates(
    sample: &ResolvedSample,
    unit: &UnitSample,
    declared: &Davis,
    places: &PlaceMemory,
) -> Covariates {
    let earlier = sample.position_m.map(|m| places.earlier(m, sample.direction));
    let earlier = earlier.unwrap_or_default();
    let seen = SuspectInput {
        speed_mps: sample.speed_mps,
        direction: sample.direction,
        curvature_per_m: sample.curvature_per_m,
        tunnel_share: sample.tunnel_share,
        ambient_temperature_degc: sample.ambient_temperature_degc,
        since_cold_s: sample.since_cold_s,
        davis: *declared,
        traction: unit.traction,
        brake: unit.brake,
        driving: unit.driving,
        earlier: earlier.resistance,
        earlier_uphill: earlier.uphill,
    };
    Covariates::from_fn(|place, _| (covariate(place).unit)(&seen))
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
