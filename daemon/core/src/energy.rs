//! Traction energy of a run.

use crate::force::ResolvedSample;

/// Sums up the work of the traction force.
///
/// Wang 2022, eq. (28)-(29): E = ∫ F_t dx. The paper calls the integrand a power P(u, v); it is
/// the traction force, and with dx = v dt the same integral is ∫ F_t v dt. Braking gives nothing
/// back, auxiliaries are not part of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TractionEnergy {
    energy_j: f64,
    distance_m: f64,
    running_time_s: f64,
    unknown_time_s: f64,
    last: Option<ResolvedSample>,
}

impl TractionEnergy {
    /// Nothing driven yet.
    pub fn new() -> Self {
        TractionEnergy::default()
    }

    /// Takes the next sample in.
    ///
    /// Force and speed are linear between two samples of a stretch. A step without a traction
    /// force at either end counts as unknown time, not as coasting.
    ///
    /// # Real-time
    ///
    /// Allocates nothing.
    pub fn add(&mut self, sample: &ResolvedSample) {
        let last = self.last.replace(*sample);
        let Some(last) = last.filter(|last| last.stretch == sample.stretch) else { return };
        let step_s = sample.step_s;
        let mean_speed_mps = 0.5 * (last.speed_mps + sample.speed_mps);
        if !(step_s > 0.0 && mean_speed_mps.is_finite()) {
            return;
        }
        if mean_speed_mps > 0.0 {
            self.running_time_s += step_s;
            self.distance_m += mean_speed_mps * step_s;
        }
        match (last.traction_force_n, sample.traction_force_n) {
            (Some(from_n), Some(to_n)) if from_n.is_finite() && to_n.is_finite() => {
                self.energy_j +=
                    step_s * mean_product(from_n, to_n, last.speed_mps, sample.speed_mps);
            }
            _ => self.unknown_time_s += step_s,
        }
    }

    /// Work of the traction force in J.
    pub fn energy_j(&self) -> f64 {
        self.energy_j
    }

    /// Work of the traction force in kWh.
    pub fn energy_kwh(&self) -> f64 {
        self.energy_j / 3.6e6
    }

    /// Distance in m.
    pub fn distance_m(&self) -> f64 {
        self.distance_m
    }

    /// Time in s in motion.
    pub fn running_time_s(&self) -> f64 {
        self.running_time_s
    }

    /// Time in s for which no traction force is known.
    pub fn unknown_time_s(&self) -> f64 {
        self.unknown_time_s
    }
}

/// Mean of the product of two quantities that are linear over the same step.
fn mean_product(from_n: f64, to_n: f64, from_mps: f64, to_mps: f64) -> f64 {
    (2.0 * (from_n * from_mps + to_n * to_mps) + from_n * to_mps + to_n * from_mps) / 6.0
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use dynocar_shared::{SampleField, TrainId, TrainSample};

    use super::*;
    use crate::force::ForceResolver;
    use crate::train::{BrakeGear, Davis, TrainModel};
    use crate::validation::{ValidationLimits, Validator};

    /// Samples (speed, traction) at 5 Hz through validation and resolution.
    fn run(samples: &[(f64, Option<f64>)]) -> TractionEnergy {
        let train = TrainModel {
            name: "t".into(),
            mass_kg: 100_000.0,
            length_m: 100.0,
            cars: 4,
            rotating_mass_factor: 0.0,
            resistance: Davis { a: 2.0, b: 0.0, c: 0.0 },
            curve_constant_n_per_kn_m: 0.0,
            tunnel_constant_n_per_kn_m: 0.0,
            traction: None,
            brake: None,
            brake_gear: BrakeGear::default(),
            corrections: Default::default(),
        };
        let mut validator =
            Validator::new(TrainId(1), train.mass_kg, ValidationLimits::for_train(train.mass_kg));
        let mut resolver = ForceResolver::new(Arc::new(train), None);
        let mut energy = TractionEnergy::new();
        for (k, &(speed_mps, traction_n)) in samples.iter().enumerate() {
            let mut sample = TrainSample::empty(TrainId(1)).with(SampleField::Speed, speed_mps);
            if let Some(force_n) = traction_n {
                sample.set(SampleField::TractionForce, force_n);
            }
            sample.time_ns = k as i64 * 200_000_000;
            sample.sequence = k as u64 + 1;
            energy.add(&resolver.resolve(&validator.check(&sample).unwrap()));
        }
        energy
    }

    #[test]
    fn constant_acceleration_without_resistance_gains_the_kinetic_energy() {
        let samples: Vec<_> = (0..=100).map(|k| (0.1 * f64::from(k), Some(50_000.0))).collect();
        let energy = run(&samples);
        assert!((energy.energy_j() - 0.5 * 100_000.0 * 100.0).abs() < 1e-3);
        assert!((energy.distance_m() - 100.0).abs() < 1e-9);
        assert!((energy.running_time_s() - 20.0).abs() < 1e-9);
        assert!((energy.energy_kwh() - 5e6 / 3.6e6).abs() < 1e-9);
    }

    #[test]
    fn a_force_and_a_speed_that_both_change_are_integrated_exactly() {
        // F = 1000 t, v = t over 2 s: ∫ 1000 t² dt = 8000/3.
        let samples: Vec<_> =
            (0..=10).map(|k| (0.2 * f64::from(k), Some(200.0 * f64::from(k)))).collect();
        assert!((run(&samples).energy_j() - 8000.0 / 3.0).abs() < 1e-6);
    }

    #[test]
    fn missing_forces_are_unknown_time_and_standing_is_no_running_time() {
        let mut samples = vec![(0.0, Some(0.0)); 6];
        samples.extend([
            (0.1, Some(1000.0)),
            (0.2, None),
            (0.3, Some(1000.0)),
            (0.4, Some(1000.0)),
        ]);
        let energy = run(&samples);
        assert!((energy.unknown_time_s() - 0.4).abs() < 1e-9);
        assert!((energy.running_time_s() - 0.8).abs() < 1e-9);
        assert!(energy.energy_j() > 0.0 && energy.energy_j().is_finite());
    }
}
