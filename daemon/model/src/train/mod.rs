//! Declared model of a train.

mod corrections;
mod power_train;

pub use corrections::Corrections;
use dynocar_shared::resistance::STANDARD_GRAVITY_MPS2;
pub use power_train::PowerTrain;

use crate::terms::extra::ExtraResistance;
use crate::track::along_line;

/// Davis coefficients of the unit basic resistance w0(v) = a + b v + c v² in N/kN, v in m/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Davis {
    /// Speed-independent part in N/kN.
    pub a: f64,
    /// Linear part in N/kN per m/s.
    pub b: f64,
    /// Aerodynamic part in N/kN per (m/s)².
    pub c: f64,
}

impl Davis {
    /// w0 in N/kN at a speed in m/s.
    pub fn w0_n_per_kn(&self, speed_mps: f64) -> f64 {
        self.a + speed_mps * (self.b + speed_mps * self.c)
    }
}

/// A piecewise linear curve of force over speed, held constant beyond its ends.
#[derive(Clone, Debug, PartialEq)]
pub struct EffortCurve {
    /// Points (speed in m/s, force in N), speeds strictly increasing; never empty.
    points: Vec<(f64, f64)>,
}

impl EffortCurve {
    /// A curve through points of strictly increasing, finite speed and finite force >= 0;
    /// `None` when there is no point or one breaks the order.
    pub fn new(points: Vec<(f64, f64)>) -> Option<Self> {
        let is_finite = points.iter().all(|&(v, f)| v.is_finite() && f.is_finite() && f >= 0.0);
        let is_ordered = points.windows(2).all(|pair| pair[0].0 < pair[1].0);
        (!points.is_empty() && is_finite && is_ordered).then_some(EffortCurve { points })
    }

    /// Force in N at a speed in m/s.
    pub fn force_n(&self, speed_mps: f64) -> f64 {
        along_line(&self.points, speed_mps)
    }

    /// The points (speed in m/s, force in N).
    pub fn points(&self) -> &[(f64, f64)] {
        &self.points
    }

    /// The greatest force in N.
    pub fn force_max_n(&self) -> f64 {
        self.points.iter().map(|&(_, force)| force).fold(0.0, f64::max)
    }
}

/// Brake gear, for adhesion, disc friction and braking ratio (Xie 2019, Jin 2020).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BrakeGear {
    /// Diameter of a brake cylinder in mm.
    pub cylinder_diameter_mm: Option<f64>,
    /// Mean friction radius of a brake disc in mm.
    pub disc_radius_mm: Option<f64>,
    /// Wheel radius in mm.
    pub wheel_radius_mm: Option<f64>,
    /// Efficiency of the brake rigging, 0 to 1.
    pub efficiency: Option<f64>,
    /// Braking ratio: lever ratio from cylinder to pad.
    pub ratio: Option<f64>,
    /// Friction coefficient between pad and disc.
    pub friction: Option<f64>,
    /// Number of brake pads on the train.
    pub pads: Option<f64>,
    /// Force of the friction brake from its pressure, where the force is not recorded.
    pub friction_brake: Option<FrictionBrake>,
    /// How its units differ and fail, where that is declared.
    pub components: Option<BrakeComponents>,
}

/// The units of a brake, each of which gives the same share of its force: how they differ, from one to the
/// next and from stop to stop, and how often one fails. Standard deviations are relative.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BrakeComponents {
    /// Number of units that fail one by one.
    pub units: u32,
    /// Standard deviation of a unit's friction.
    pub friction_std: f64,
    /// Standard deviation of a unit's pressure.
    pub pressure_std: f64,
    /// Standard deviation of a unit's efficiency.
    pub efficiency_std: f64,
    /// Standard deviation of what all units have in common, as weather and a batch of pads.
    pub common_std: f64,
    /// Standard deviation of the train's mass.
    pub mass_std: f64,
    /// Probability that a unit gives nothing in a stop.
    pub failure_probability: f64,
}

/// A friction brake that is known by its pressure: force = gain * (pressure - release pressure).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrictionBrake {
    /// Force of the whole train in N for each Pa above the release pressure.
    pub force_per_pressure_n_per_pa: f64,
    /// Pressure in Pa up to which the brake is released.
    pub release_pressure_pa: f64,
}

impl FrictionBrake {
    /// Retarding force in N at a pressure in Pa.
    pub fn force_n(&self, pressure_pa: f64) -> f64 {
        self.force_per_pressure_n_per_pa * (pressure_pa - self.release_pressure_pa).max(0.0)
    }
}

/// A train as declared: the content of a `train.toml`, in SI units.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainModel {
    /// Name for people.
    pub name: String,
    /// Nominal gross mass in kg, without the rotating part.
    pub mass_kg: f64,
    /// Gross mass in kg with a full load, where it is declared; the nominal mass is the tare then.
    pub full_mass_kg: Option<f64>,
    /// Mass of a passenger in kg, where passengers are counted; the nominal mass is empty then.
    pub passenger_mass_kg: f64,
    /// Length in m.
    pub length_m: f64,
    /// Number of cars.
    pub cars: u32,
    /// Rotating-mass factor gamma: inertial mass = mass * (1 + gamma).
    pub rotating_mass_factor: f64,
    /// Declared basic resistance.
    pub resistance: Davis,
    /// k in the declared curve resistance k/R in N/kN, R in m.
    pub curve_constant_n_per_kn_m: f64,
    /// Declared tunnel resistance in N/kN per metre of tunnel length while inside.
    pub tunnel_constant_n_per_kn_m: f64,
    /// Greatest traction force over speed.
    pub traction: Option<EffortCurve>,
    /// Greatest brake force over speed.
    pub brake: Option<EffortCurve>,
    /// The drive, where it is declared by its electric power.
    pub drive: Option<PowerTrain>,
    /// Brake gear, as far as declared.
    pub brake_gear: BrakeGear,
    /// Corrections by measured runs.
    pub corrections: Corrections,
    /// Resistances of forms of their own.
    pub extra: Vec<ExtraResistance>,
}

impl TrainModel {
    /// A train of which only mass and basic resistance are declared: a point without rotating
    /// mass that nothing else holds back. Simulations set what else they need.
    pub fn bare(name: &str, mass_kg: f64, resistance: Davis) -> Self {
        TrainModel {
            name: name.into(),
            mass_kg,
            full_mass_kg: None,
            passenger_mass_kg: 70.0,
            length_m: 0.0,
            cars: 1,
            rotating_mass_factor: 0.0,
            resistance,
            curve_constant_n_per_kn_m: 0.0,
            tunnel_constant_n_per_kn_m: 0.0,
            traction: None,
            brake: None,
            drive: None,
            brake_gear: BrakeGear::default(),
            corrections: Corrections::default(),
            extra: Vec::new(),
        }
    }

    /// Middle and standard deviation in kg of a mass that is anything between tare and full, where both are
    /// declared.
    pub fn load_range(&self) -> Option<(f64, f64)> {
        let full_kg = self.full_mass_kg?;
        Some((0.5 * (self.mass_kg + full_kg), (full_kg - self.mass_kg) / 12_f64.sqrt()))
    }

    /// Weight in kN of a mass in kg.
    pub fn weight_kn(mass_kg: f64) -> f64 {
        mass_kg * STANDARD_GRAVITY_MPS2 / 1000.0
    }

    /// The highest speed in m/s of the effort curves; `None` without curves.
    pub fn speed_max_mps(&self) -> Option<f64> {
        let last = |curve: &Option<EffortCurve>| curve.as_ref()?.points.last().map(|point| point.0);
        match (last(&self.traction), last(&self.brake)) {
            (Some(traction), Some(brake)) => Some(traction.max(brake)),
            (one, other) => one.or(other),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn effort_is_linear_between_points_and_constant_beyond() {
        let curve = EffortCurve::new(vec![(0.0, 300.0), (10.0, 300.0), (20.0, 100.0)]).unwrap();
        assert_eq!(curve.force_n(-1.0), 300.0);
        assert_eq!(curve.force_n(15.0), 200.0);
        assert_eq!(curve.force_n(10.0), 300.0);
        assert_eq!(curve.force_n(99.0), 100.0);
        assert_eq!(curve.force_max_n(), 300.0);
    }

    #[test]
    fn an_unordered_or_empty_curve_is_refused() {
        assert_eq!(EffortCurve::new(vec![]), None);
        assert_eq!(EffortCurve::new(vec![(1.0, 1.0), (1.0, 2.0)]), None);
        assert_eq!(EffortCurve::new(vec![(0.0, f64::NAN)]), None);
    }
}
