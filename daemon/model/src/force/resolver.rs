//! The known forces on the train at a valid sample.

use std::sync::Arc;

use dynocar_shared::resistance::GRAVITY_MPS2;
use dynocar_shared::sample::FLAG_WHEEL_SLIDE;
use dynocar_shared::{SampleField, TrainSample};

use crate::terms::bearings::WarmUp;
use crate::terms::delay::DelayLine;
use crate::terms::extra::Covariate;
use crate::terms::speed_delay::LateSpeed;
use crate::terms::{
    Resistance, ambient, bearings, curve, extra, gradient, place, rotating, traction, tunnel,
    wheel, wind,
};
use crate::track::Track;
use crate::train::{Corrections, TrainModel};

/// A sample that passed validation, with its relation to the samples before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValidSample<'a> {
    /// The sample as it came.
    pub sample: &'a TrainSample,
    /// Time in s since the accepted sample before it; 0 when it starts a segment.
    pub step_s: f64,
    /// Number of the motion segment; integrals never cross its change.
    pub segment: u32,
}

impl ValidSample<'_> {
    /// Returns whether the controller's wheel-slide protection is active.
    pub fn is_sliding(&self) -> bool {
        self.sample.flags & FLAG_WHEEL_SLIDE != 0
    }
}

/// A sample with the forces that the declared model knows.
///
/// Forces and gradients are signed along the direction of travel: a positive gradient climbs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResolvedSample {
    /// Measurement time, controller's clock, in ns.
    pub time_ns: i64,
    /// Time in s since the sample before it in the motion segment; 0 for the first.
    pub step_s: f64,
    /// Number of the motion segment; integrals never cross its change.
    pub segment: u32,
    /// +1 while the chainage grows in the direction of travel, -1 while it falls.
    pub direction: f64,
    /// Chainage of the train's centre in m.
    pub position_m: Option<f64>,
    /// Speed in m/s.
    pub speed_mps: f64,
    /// Gross mass in kg: the sample's, else the declared one.
    pub mass_kg: f64,
    /// True when the sample carries it: weighed, or known in another way.
    pub is_mass_measured: bool,
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
    /// Standard deviation in ‰ of that gradient at one place, as a survey states it; 0 where none does.
    pub gradient_std_permille: f64,
    /// Mean of 1/R along the train in 1/m, when curves are known.
    pub curvature_per_m: Option<f64>,
    /// Resistances beyond the declared basic resistance, part by part.
    pub resistance: Resistance,
    /// All of it in N/kN at this speed. Negative where something pushes.
    pub extra_n_per_kn: f64,
    /// Share of the train inside tunnels, when tunnels are known.
    pub tunnel_share: Option<f64>,
    /// Brake-cylinder pressure in Pa.
    pub brake_cylinder_pressure_pa: Option<f64>,
    /// Outside temperature in °C: the sample's, else the last that was measured.
    pub ambient_temperature_degc: Option<f64>,
    /// Time in s since the bearings were cold.
    pub since_cold_s: f64,
    /// True while the controller's wheel-slide protection is active.
    pub is_sliding: bool,
}

impl ResolvedSample {
    /// Returns the traction minus brake in N; `None` while either is not measured.
    #[inline]
    pub fn control_force_n(&self) -> Option<f64> {
        Some(self.traction_force_n? - self.brake_force_n?)
    }

    /// gamma, of the declaration.
    #[inline]
    pub fn rotating_mass_factor(&self) -> f64 {
        self.inertial_mass_kg / self.mass_kg - 1.0
    }

    /// Returns the value of a covariate, where it is known.
    #[inline]
    pub fn covariate(&self, of: Covariate) -> Option<f64> {
        match of {
            Covariate::Speed => Some(self.speed_mps),
            Covariate::Chainage => self.position_m,
            Covariate::TimeSinceStart => Some(self.since_cold_s),
            Covariate::TractionForce => self.traction_force_n,
            Covariate::BrakeForce => self.brake_force_n,
            Covariate::Temperature => self.ambient_temperature_degc,
        }
    }

    /// Returns everything known that retards the train in proportion to its weight, in N/kN: gradient
    /// and every declared resistance beyond the basic one; `None` while no gradient is known.
    ///
    /// An estimator looks for the part of the motion beyond this sum.
    #[inline]
    pub fn known_n_per_kn(&self) -> Option<f64> {
        Some(self.gradient_permille? + self.extra_n_per_kn)
    }

    /// Returns the sample of the same train with another load: a mass in kg, the rotating part in proportion.
    pub fn with_mass(self, mass_kg: f64) -> Self {
        let share = mass_kg / self.mass_kg;
        ResolvedSample {
            mass_kg,
            inertial_mass_kg: share * self.inertial_mass_kg,
            weight_kn: share * self.weight_kn,
            ..self
        }
    }

    /// Returns everything that drives the train but its basic resistance, in N: traction minus brake
    /// minus all that is known to retard it.
    #[inline]
    pub fn driving_force_n(&self) -> Option<f64> {
        Some(self.control_force_n()? - self.weight_kn * self.known_n_per_kn()?)
    }

    /// Returns a train of 100 t with gamma 0.06 that coasts on the level at 20 m/s: the start of many tests.
    pub fn coasting() -> Self {
        ResolvedSample {
            time_ns: 0,
            step_s: 0.0,
            segment: 1,
            direction: 1.0,
            position_m: None,
            speed_mps: 20.0,
            mass_kg: 100e3,
            is_mass_measured: false,
            inertial_mass_kg: 106e3,
            weight_kn: TrainModel::weight_kn(100e3),
            traction_force_n: Some(0.0),
            brake_force_n: Some(0.0),
            gradient_permille: Some(0.0),
            gradient_std_permille: 0.0,
            curvature_per_m: None,
            resistance: Resistance::BASIC,
            extra_n_per_kn: 0.0,
            tunnel_share: None,
            brake_cylinder_pressure_pa: None,
            ambient_temperature_degc: None,
            since_cold_s: 0.0,
            is_sliding: false,
        }
    }
}

/// Delays everything that acts on the train by as much as the speed is late.
fn put_behind(late: &mut LateSpeed, resolved: &mut ResolvedSample) {
    let at = (resolved.time_ns, resolved.segment);
    let forces = resolved.traction_force_n.zip(resolved.brake_force_n);
    if let Some([traction_n, brake_n]) = late.forces(at, resolved.speed_mps, forces.map(Into::into))
    {
        resolved.traction_force_n = Some(traction_n);
        resolved.brake_force_n = Some(brake_n);
    }
    let now = (resolved.gradient_permille.unwrap_or(0.0), resolved.resistance);
    let (permille, resistance) = late.resisting(at, now);
    resolved.gradient_permille = resolved.gradient_permille.map(|_| permille);
    resolved.resistance = resistance;
    resolved.position_m = late.position_m(at, resolved.position_m);
    resolved.brake_cylinder_pressure_pa =
        late.cylinder_pressure_pa(at, resolved.brake_cylinder_pressure_pa);
}

/// Looks up the forces that the declared model gives at a sample.
#[derive(Clone, Debug)]
pub struct ForceResolver {
    train: Arc<TrainModel>,
    track: Option<Arc<Track>>,
    brake_delay: Option<DelayLine<2>>,
    delay: Option<DelayLine<2>>,
    late_speed: Option<LateSpeed>,
    warm_up: WarmUp,
    ambient_temperature_degc: Option<f64>,
    last: Option<(u32, f64)>,
}

impl ForceResolver {
    /// Returns a resolver for one train on one line; without a line the gradient comes from the sample.
    pub fn new(train: Arc<TrainModel>, track: Option<Arc<Track>>) -> Self {
        let Corrections { actuator_delay_s, actuator_lag_s, speed_delay_s, speed_lag_s, .. } =
            train.corrections;
        let Corrections { brake_delay_s, brake_lag_s, .. } = train.corrections;
        let line = |delay_s: f64, lag_s: f64| {
            (delay_s > 0.0 || lag_s > 0.0).then(|| DelayLine::new(delay_s, lag_s))
        };
        let is_speed_late = speed_delay_s > 0.0 || speed_lag_s > 0.0;
        ForceResolver {
            train,
            track,
            brake_delay: line(brake_delay_s, brake_lag_s),
            delay: line(actuator_delay_s, actuator_lag_s),
            late_speed: is_speed_late.then(|| LateSpeed::new(speed_delay_s, speed_lag_s)),
            warm_up: WarmUp::default(),
            ambient_temperature_degc: None,
            last: None,
        }
    }

    /// Returns the known forces at a sample.
    ///
    /// The brake force is the sample's own, else the one that the friction brake makes of its pressure where that is
    /// declared. The gradient is the track's at the train's position, else the sample's own, else the
    /// accelerometer's specific force minus dv/dt over the last step, else unknown.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn resolve(&mut self, valid: &ValidSample) -> ResolvedSample {
        let sample = valid.sample;
        let stated_permille = self.stated_gradient_permille(sample);
        let felt_permille = match stated_permille {
            Some(_) => None,
            None => self.accelerometer_gradient_permille(valid),
        };
        let train = &*self.train;
        let known = &train.corrections;
        let direction = f64::from(sample.direction);
        let position_m = sample.get(SampleField::Position);
        let track = self.track.as_deref();
        let on_track = |look_up: fn(&Track, f64, f64) -> Option<f64>| {
            look_up(track?, position_m?, train.length_m)
        };
        let mass_factor = track
            .zip(position_m)
            .map_or(1.0, |(track, position_m)| track.mass_factor(position_m, direction));
        let mass_kg = sample.get(SampleField::Mass).unwrap_or(train.mass_kg) * mass_factor;
        let curvature_per_m = on_track(Track::curvature_per_m).or_else(|| {
            let radius_m = sample.get(SampleField::CurveRadius)?;
            Some(if radius_m > 0.0 { 1.0 / radius_m } else { 0.0 })
        });
        let tunnel_share = on_track(Track::tunnel_share);
        let traction_n = sample.get(SampleField::TractionForce);
        let by_pressure_n = || {
            let friction_brake = train.brake_gear.friction_brake?;
            Some(friction_brake.force_n(sample.get(SampleField::BrakeCylinderPressure)?))
        };
        let brake_n = sample.get(SampleField::BrakeForce).or_else(by_pressure_n);
        let degc = sample.get(SampleField::AmbientTemperature).or(self.ambient_temperature_degc);
        self.ambient_temperature_degc = degc;
        self.last = Some((valid.segment, sample.speed_mps));
        let mut resolved = ResolvedSample {
            time_ns: sample.time_ns,
            step_s: valid.step_s,
            segment: valid.segment,
            direction,
            position_m,
            speed_mps: wheel::true_speed_mps(sample.speed_mps, known.speed_scale),
            mass_kg,
            is_mass_measured: sample.get(SampleField::Mass).is_some(),
            inertial_mass_kg: rotating::inertial_mass_kg(mass_kg, train.rotating_mass_factor),
            weight_kn: TrainModel::weight_kn(mass_kg),
            traction_force_n: traction_n.map(|n| traction::true_force_n(n, known.traction_gain)),
            brake_force_n: brake_n.map(|n| traction::true_force_n(n, known.brake_gain)),
            gradient_permille: stated_permille,
            gradient_std_permille: on_track(Track::gradient_std_here_permille).unwrap_or(0.0),
            curvature_per_m,
            resistance: Resistance::BASIC,
            extra_n_per_kn: 0.0,
            tunnel_share,
            brake_cylinder_pressure_pa: sample.get(SampleField::BrakeCylinderPressure),
            ambient_temperature_degc: degc,
            since_cold_s: self.warm_up.since_cold_s(sample.time_ns),
            is_sliding: valid.is_sliding(),
        };
        self.put_late(&mut resolved);
        resolved.resistance = self.declared_resistance(&resolved);
        if let Some(late) = &mut self.late_speed {
            put_behind(late, &mut resolved);
        }
        // The accelerometer was compared with the late speed itself.
        resolved.gradient_permille = resolved.gradient_permille.or(felt_permille);
        resolved.extra_n_per_kn =
            resolved.resistance.extra_n_per_kn(self.train.resistance, resolved.speed_mps);
        resolved
    }

    /// Puts the brake, and then both forces, behind their declared delays.
    fn put_late(&mut self, resolved: &mut ResolvedSample) {
        let at = (resolved.time_ns, resolved.segment);
        for (delay, is_brake_alone) in [(&mut self.brake_delay, true), (&mut self.delay, false)] {
            let Some(delay) = delay else { continue };
            let reported = resolved.traction_force_n.zip(resolved.brake_force_n);
            let Some([traction_n, brake_n]) = delay.acting(at, reported.map(Into::into)) else {
                continue;
            };
            if !is_brake_alone {
                resolved.traction_force_n = Some(traction_n);
            }
            resolved.brake_force_n = Some(brake_n);
        }
    }

    /// Returns every declared term of resistance at a sample; c and w0, which some of them scale, are left open.
    fn declared_resistance(&self, sample: &ResolvedSample) -> Resistance {
        let train = &*self.train;
        let known = &train.corrections;
        let track = self.track.as_deref();
        let on_track = |look_up: fn(&Track, f64, f64) -> Option<f64>| {
            look_up(track?, sample.position_m?, train.length_m)
        };
        let mut resistance = Resistance::BASIC;
        curve::act(train.curve_constant_n_per_kn_m, sample.curvature_per_m, &mut resistance);
        tunnel::enter(sample.tunnel_share, &mut resistance);
        if train.tunnel_constant_n_per_kn_m != 0.0 {
            let length_m = on_track(Track::tunnel_length_m);
            tunnel::act_by_length(train.tunnel_constant_n_per_kn_m, length_m, &mut resistance);
        }
        tunnel::act_by_factor(known.tunnel_c_factor, sample.tunnel_share, &mut resistance);
        tunnel::act(known.tunnel_dc_n_per_kn_per_mps2, sample.tunnel_share, &mut resistance);
        wind::act(known.wind_plus_mps, sample.direction, &mut resistance);
        ambient::act(
            known.ambient_w0_per_k,
            known.ambient_reference_k,
            sample.ambient_temperature_degc,
            &mut resistance,
        );
        if known.bearing_delta_a_n_per_kn != 0.0 {
            let Corrections { bearing_delta_a_n_per_kn, bearing_tau_s, .. } = *known;
            let since_cold_s = sample.since_cold_s;
            bearings::act(bearing_delta_a_n_per_kn, bearing_tau_s, since_cold_s, &mut resistance);
        }
        if let Some(extra_n_per_kn) = on_track(Track::resistance_n_per_kn) {
            place::act(extra_n_per_kn, &mut resistance);
        }
        let known = |of: Covariate| sample.covariate(of);
        extra::act(&train.extra, sample.speed_mps, known, &mut resistance);
        resistance
    }

    /// Returns the gradient in ‰ along the travel by the track at the sample's position, else by the sample.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn stated_gradient_permille(&self, sample: &TrainSample) -> Option<f64> {
        let direction = f64::from(sample.direction);
        let on_track = || {
            let at = (sample.get(SampleField::Position)?, direction);
            gradient::along_travel_permille(self.track.as_deref()?, at, self.train.length_m, 0.0)
        };
        on_track().or_else(|| Some(direction * sample.get(SampleField::Gradient)?))
    }

    /// Returns the gradient in ‰ along the travel from specific force = dv/dt + g * gradient, with dv/dt
    /// over the last step; its noise telescopes away when it is integrated.
    fn accelerometer_gradient_permille(&mut self, valid: &ValidSample) -> Option<f64> {
        let felt_mps2 = valid.sample.get(SampleField::SpecificForce);
        let specific_force_mps2 = match &mut self.late_speed {
            Some(late) => {
                late.specific_force_mps2((valid.sample.time_ns, valid.segment), felt_mps2)
            }
            None => felt_mps2,
        }?;
        let (segment, last_speed_mps) = self.last?;
        if segment != valid.segment || valid.step_s <= 0.0 {
            return None;
        }
        let acceleration_mps2 = (valid.sample.speed_mps - last_speed_mps) / valid.step_s;
        Some(1000.0 * (specific_force_mps2 - acceleration_mps2) / GRAVITY_MPS2)
    }
}
