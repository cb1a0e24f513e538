//! Quantities derived from a declared train: forces, weights, loads and speeds.

use dynocar_shared::resistance::GRAVITY_MPS2;

use super::EffortCurve;
use super::numbers::{DRIVE_EFFICIENCY, Davis, FrictionBrake, PowerTrain, TrainModel};

impl Davis {
    /// w0 in N/kN at a speed in m/s.
    pub fn w0_n_per_kn(&self, speed_mps: f64) -> f64 {
        self.a + speed_mps * (self.b + speed_mps * self.c)
    }
}

impl FrictionBrake {
    /// Retarding force in N at a pressure in Pa.
    pub fn force_n(&self, pressure_pa: f64) -> f64 {
        self.force_per_pressure_n_per_pa * (pressure_pa - self.release_pressure_pa).max(0.0)
    }
}

impl TrainModel {
    /// Returns a train of which only mass and basic resistance are declared: a point without rotating mass or any other
    /// resistance. Simulations set everything else that they need.
    pub fn bare(name: &str, mass_kg: f64, resistance: Davis) -> Self {
        TrainModel {
            name: name.into(),
            mass_kg,
            resistance,
            curve_constant_n_per_kn_m: 0.0,
            ..TrainModel::UNDECLARED
        }
    }

    /// Middle and standard deviation in kg of a mass that is anything between tare and full, where both are
    /// declared.
    pub fn load_range(&self) -> Option<(f64, f64)> {
        let full_kg = self.full_mass_kg?;
        Some((0.5 * (self.mass_kg + full_kg), (full_kg - self.mass_kg) / 12_f64.sqrt()))
    }

    /// Returns the weight in kN of a mass in kg.
    pub fn weight_kn(mass_kg: f64) -> f64 {
        mass_kg * GRAVITY_MPS2 / 1000.0
    }

    /// Returns the highest speed in m/s of the effort curves; `None` without curves.
    pub fn speed_max_mps(&self) -> Option<f64> {
        let last =
            |curve: &Option<EffortCurve>| curve.as_ref()?.points().last().map(|point| point.0);
        match (last(&self.traction), last(&self.brake)) {
            (Some(traction), Some(brake)) => Some(traction.max(brake)),
            (one, other) => one.or(other),
        }
    }
}

impl PowerTrain {
    /// Standard deviation of an efficiency that nobody declares: from transformers and gears under a light load to
    /// power that is recorded at the wheels.
    pub const EFFICIENCY_STD: f64 = 0.1;
    /// Efficiencies that make sense.
    pub const EFFICIENCIES: std::ops::RangeInclusive<f64> =
        DRIVE_EFFICIENCY.rule.range[0]..=DRIVE_EFFICIENCY.rule.range[1];

    /// Mechanical power in W at the rims, braking negative, of a recorded power in W.
    pub fn mechanical_w(&self, recorded_w: f64) -> f64 {
        let drive_w = recorded_w - self.auxiliary_power_w;
        if drive_w >= 0.0 { self.efficiency * drive_w } else { drive_w / self.efficiency }
    }

    /// Returns the traction minus brake force of the drive in N at a speed in m/s; `None` where it turns too
    /// slowly for its power to determine the force.
    pub fn force_n(&self, recorded_w: f64, speed_mps: f64) -> Option<f64> {
        let is_known = recorded_w.is_finite() && speed_mps >= self.speed_min_mps;
        is_known.then(|| self.mechanical_w(recorded_w) / speed_mps)
    }

    /// Returns the difference of the traction and the brake force in N, from a recorded power in W at a speed in
    /// m/s, between this drive and another; `None` where either determines none.
    pub fn beyond_n(&self, other: PowerTrain, recorded_w: f64, speed_mps: f64) -> Option<[f64; 2]> {
        let at = |drive: &PowerTrain| drive.force_n(recorded_w, speed_mps);
        let (own_n, other_n) = at(self).zip(at(&other))?;
        Some([own_n.max(0.0) - other_n.max(0.0), other_n.min(0.0) - own_n.min(0.0)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRIVE: PowerTrain =
        PowerTrain { efficiency: 0.8, auxiliary_power_w: 10e3, speed_min_mps: 2.0 };

    #[test]
    fn a_drive_loses_on_the_way_to_the_wheels_and_on_the_way_back() {
        // 100 kW for the drive: 80 kW at 10 m/s.
        assert_eq!(DRIVE.force_n(110e3, 10.0), Some(8000.0));
        // 80 kW come back of 100 kW that the wheels feed.
        assert!((DRIVE.force_n(-70e3, 10.0).unwrap() + 10e3).abs() < 1e-9);
        assert_eq!(DRIVE.force_n(10e3, 10.0), Some(0.0), "auxiliaries alone pull nothing");
    }

    #[test]
    fn a_better_drive_pulls_more_and_brakes_less_for_the_same_power() {
        let better = PowerTrain { efficiency: 1.0, ..DRIVE };
        assert_eq!(better.beyond_n(DRIVE, 110e3, 10.0), Some([2000.0, 0.0]));
        let [traction_n, brake_n] = better.beyond_n(DRIVE, -70e3, 10.0).unwrap();
        assert!(traction_n == 0.0 && (brake_n + 2000.0).abs() < 1e-9, "{brake_n}");
        assert_eq!(better.beyond_n(DRIVE, 110e3, 1.0), None);
    }

    #[test]
    fn a_drive_that_hardly_turns_shows_no_force() {
        assert_eq!(DRIVE.force_n(110e3, 1.99), None);
        assert_eq!(DRIVE.force_n(110e3, f64::NAN), None);
        assert_eq!(DRIVE.force_n(f64::NAN, 10.0), None);
    }
}
