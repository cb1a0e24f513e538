//! From a valid sample to the known forces on the train.

use std::sync::Arc;

use dynocar_shared::resistance::STANDARD_GRAVITY_MPS2;
use dynocar_shared::{SampleField, TrainSample};

use super::corrections::Corrector;
use crate::track::Track;
use crate::train::TrainModel;
use crate::validation::ValidSample;

/// A sample with the forces that the declared model knows.
///
/// Forces and gradients are signed along the direction of travel: a positive gradient climbs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResolvedSample {
    /// Measurement time, controller's clock, in ns.
    pub time_ns: i64,
    /// Time in s since the sample before it in the stretch; 0 for the first.
    pub step_s: f64,
    /// Number of the stretch of unbroken motion; integrals never cross its change.
    pub stretch: u32,
    /// +1 while the chainage grows in the direction of travel, -1 while it falls.
    pub direction: f64,
    /// Chainage of the train's centre in m.
    pub position_m: Option<f64>,
    /// Speed in m/s.
    pub speed_mps: f64,
    /// Gross mass in kg: the sample's, else the declared one.
    pub mass_kg: f64,
    /// mass * (1 + gamma) in kg.
    pub inertial_mass_kg: f64,
    /// Weight in kN.
    pub weight_kn: f64,
    /// Traction force in N.
    pub traction_force_n: Option<f64>,
    /// Brake force in N, retarding.
    pub brake_force_n: Option<f64>,
    /// Mean gradient under the train in ‰ along the direction of travel.
    pub gradient_permille: Option<f64>,
    /// Declared curve resistance in N/kN.
    pub curve_n_per_kn: f64,
    /// Mean of 1/R along the train in 1/m, when curves are known.
    pub curvature_per_m: Option<f64>,
    /// Declared resistance in N/kN of tunnels and places, and what corrections add.
    pub tunnel_n_per_kn: f64,
    /// Share of the train inside tunnels, when tunnels are known.
    pub tunnel_share: Option<f64>,
    /// Brake-cylinder pressure in Pa.
    pub brake_cylinder_pressure_pa: Option<f64>,
    /// Outside temperature in °C.
    pub ambient_temperature_degc: Option<f64>,
    /// True while the controller's wheel-slide protection is active.
    pub is_sliding: bool,
}

impl ResolvedSample {
    /// Traction minus brake in N; `None` while either is not measured.
    pub fn control_force_n(&self) -> Option<f64> {
        Some(self.traction_force_n? - self.brake_force_n?)
    }

    /// Everything that drives the train but its basic resistance, in N: traction minus brake
    /// minus gradient, declared curve and declared tunnel resistance.
    pub fn driving_force_n(&self) -> Option<f64> {
        let tied_n_per_kn = self.gradient_permille? + self.curve_n_per_kn + self.tunnel_n_per_kn;
        Some(self.control_force_n()? - self.weight_kn * tied_n_per_kn)
    }
}

#[cfg(test)]
impl ResolvedSample {
    /// A train of 100 t with gamma 0.06 that coasts on the level at 20 m/s.
    pub(crate) fn coasting() -> Self {
        ResolvedSample {
            time_ns: 0,
            step_s: 0.0,
            stretch: 1,
            direction: 1.0,
            position_m: None,
            speed_mps: 20.0,
            mass_kg: 100e3,
            inertial_mass_kg: 106e3,
            weight_kn: TrainModel::weight_kn(100e3),
            traction_force_n: Some(0.0),
            brake_force_n: Some(0.0),
            gradient_permille: Some(0.0),
            curve_n_per_kn: 0.0,
            curvature_per_m: None,
            tunnel_n_per_kn: 0.0,
            tunnel_share: None,
            brake_cylinder_pressure_pa: None,
            ambient_temperature_degc: None,
            is_sliding: false,
        }
    }
}

/// Looks up what the declared model knows of the forces at a sample.
#[derive(Clone, Debug)]
pub struct ForceResolver {
    train: Arc<TrainModel>,
    track: Option<Arc<Track>>,
    corrector: Option<Corrector>,
    last: Option<(u32, f64)>,
}

impl ForceResolver {
    /// A resolver for one train on one line; without a line the gradient comes from the sample.
    pub fn new(train: Arc<TrainModel>, track: Option<Arc<Track>>) -> Self {
        let corrector = Corrector::of(&train);
        ForceResolver { train, track, corrector, last: None }
    }

    /// The known forces at a sample.
    ///
    /// The gradient is the track's at the train's position, else the sample's own, else the
    /// accelerometer's specific force minus dv/dt over the last step, else unknown.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn resolve(&mut self, valid: &ValidSample) -> ResolvedSample {
        let sample = &valid.sample;
        let train = &*self.train;
        let direction = f64::from(sample.direction);
        let position_m = sample.get(SampleField::Position);
        let mass_factor = match (self.track.as_deref(), position_m) {
            (Some(track), Some(position_m)) => track.mass_factor(position_m, direction),
            _ => 1.0,
        };
        let mass_kg = mass_factor * sample.get(SampleField::Mass).unwrap_or(train.mass_kg);
        let on_track = |look_up: fn(&Track, f64, f64) -> Option<f64>| {
            look_up(self.track.as_deref()?, position_m?, train.length_m)
        };
        let gradient_permille = self
            .stated_gradient_permille(sample)
            .or_else(|| self.accelerometer_gradient_permille(valid));
        let curvature_per_m = on_track(Track::curvature_per_m).or_else(|| {
            let radius_m = sample.get(SampleField::CurveRadius)?;
            Some(if radius_m > 0.0 { 1.0 / radius_m } else { 0.0 })
        });
        let tunnel_share = on_track(Track::tunnel_share);
        let tunnel_length_m = match train.tunnel_constant_n_per_kn_m {
            0.0 => None,
            _ => on_track(Track::tunnel_length_m),
        };
        let place_n_per_kn = on_track(Track::resistance_n_per_kn).unwrap_or(0.0);
        self.last = Some((valid.stretch, sample.speed_mps));
        let mut resolved = ResolvedSample {
            time_ns: sample.time_ns,
            step_s: valid.step_s,
            stretch: valid.stretch,
            direction,
            position_m,
            speed_mps: sample.speed_mps,
            mass_kg,
            inertial_mass_kg: mass_kg * (1.0 + train.rotating_mass_factor),
            weight_kn: TrainModel::weight_kn(mass_kg),
            traction_force_n: sample.get(SampleField::TractionForce),
            brake_force_n: sample.get(SampleField::BrakeForce),
            gradient_permille,
            curve_n_per_kn: train.curve_constant_n_per_kn_m * curvature_per_m.unwrap_or(0.0),
            curvature_per_m,
            tunnel_n_per_kn: train.tunnel_constant_n_per_kn_m * tunnel_length_m.unwrap_or(0.0)
                + place_n_per_kn,
            tunnel_share,
            brake_cylinder_pressure_pa: sample.get(SampleField::BrakeCylinderPressure),
            ambient_temperature_degc: sample.get(SampleField::AmbientTemperature),
            is_sliding: valid.is_sliding(),
        };
        if let Some(corrector) = &mut self.corrector {
            corrector.correct(train, &mut resolved);
        }
        resolved
    }

    /// Gradient in ‰ along the travel by the track at the sample's position, else by the sample.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn stated_gradient_permille(&self, sample: &TrainSample) -> Option<f64> {
        let on_track = || {
            let position_m = sample.get(SampleField::Position)?;
            self.track.as_deref()?.gradient_permille(position_m, self.train.length_m)
        };
        let gradient = on_track().or_else(|| sample.get(SampleField::Gradient))?;
        Some(f64::from(sample.direction) * gradient)
    }

    /// Gradient in ‰ along the travel from specific force = dv/dt + g * gradient, with dv/dt
    /// over the last step; its noise telescopes away when it is integrated.
    fn accelerometer_gradient_permille(&self, valid: &ValidSample) -> Option<f64> {
        let specific_force_mps2 = valid.sample.get(SampleField::SpecificForce)?;
        let (stretch, last_speed_mps) = self.last?;
        if stretch != valid.stretch || valid.step_s <= 0.0 {
            return None;
        }
        let acceleration_mps2 = (valid.sample.speed_mps - last_speed_mps) / valid.step_s;
        Some(1000.0 * (specific_force_mps2 - acceleration_mps2) / STANDARD_GRAVITY_MPS2)
    }
}
