//! A train driven by forces: force in, speed out, by the law of the open-loop prediction, with each part of the force.
//!
//! The forces of a moment come from [`ForceResolver`] and [`SampleForces`], as in `explain` over a recorded run, and
//! each step is [`advance`]: the train drives as the updated model predicts. Only the speed at which a resistance is
//! evaluated is the train's own, and not a measured one.

use std::sync::Arc;

use dynocar_model::force::{ForceResolver, ValidSample};
use dynocar_model::simulate::is_pulled;
use dynocar_model::simulate::motion::{STEP_MAX_S, SimulatedMotion, advance};
use dynocar_model::terms::delay::DelayLine;
use dynocar_model::track::Track;
use dynocar_model::train::{Corrections, Davis, TrainModel};
use dynocar_shared::{SampleField, TrainSample};

use crate::explain::evidence::SampleForces;

/// State in which a train begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beginning {
    /// Chainage of its centre in m.
    pub position_m: f64,
    /// True speed in m/s, never negative.
    pub speed_mps: f64,
    /// Whether a standing train that is not pulled is held by a brake, reported or not.
    pub is_held_at_rest: bool,
}

/// A train on a line, moved by the acting forces.
#[derive(Clone, Debug)]
pub struct DrivenTrain {
    train: Arc<TrainModel>,
    forces: ForceResolver,
    is_held_at_rest: bool,
    position_m: f64,
    speed_mps: f64,
    /// Response of a late sensor to the true speed in m/s.
    sensor: Option<LateSensor>,
    balance: Option<AccelerationBalance>,
}

/// A speed sensor that is late.
#[derive(Clone, Debug)]
struct LateSensor {
    line: DelayLine<1>,
    time_ns: i64,
    shown_mps: f64,
}

impl LateSensor {
    /// Of a train that has this speed in m/s; `None` where its sensor is on time.
    fn new(train: &TrainModel, speed_mps: f64) -> Option<Self> {
        let Corrections { speed_delay_s, speed_lag_s, .. } = train.corrections;
        let is_late = speed_delay_s > 0.0 || speed_lag_s > 0.0;
        is_late.then(|| {
            let mut line = DelayLine::new(speed_delay_s, speed_lag_s);
            line.acting((0, 1), Some([speed_mps]));
            LateSensor { line, time_ns: 0, shown_mps: speed_mps }
        })
    }

    fn take(&mut self, step_s: f64, speed_mps: f64) {
        self.time_ns += (step_s * 1e9).round() as i64;
        if let Some([shown_mps]) = self.line.acting((self.time_ns, 1), Some([speed_mps])) {
            self.shown_mps = shown_mps;
        }
    }
}

impl DrivenTrain {
    /// Returns a train at its beginning; without a line the gradient comes with the acting forces.
    pub fn new(train: Arc<TrainModel>, track: Option<Arc<Track>>, beginning: Beginning) -> Self {
        let Beginning { position_m, speed_mps, is_held_at_rest } = beginning;
        let sensor = LateSensor::new(&train, speed_mps);
        // The forces that act now drive the train, however late its sensor shows the speed.
        let on_time = Corrections { speed_delay_s: 0.0, speed_lag_s: 0.0, ..train.corrections };
        let acting = TrainModel { corrections: on_time, ..TrainModel::clone(&train) };
        let forces = ForceResolver::new(Arc::new(acting), track);
        DrivenTrain { train, forces, is_held_at_rest, position_m, speed_mps, sensor, balance: None }
    }

    /// Returns the chainage of the train's centre in m, by its own motion.
    pub fn position_m(&self) -> f64 {
        self.position_m
    }

    /// True speed in m/s.
    pub fn speed_mps(&self) -> f64 {
        self.speed_mps
    }

    /// Returns the speed in m/s as the train's own sensor shows it.
    pub fn measured_speed_mps(&self) -> f64 {
        let shown_mps = self.sensor.as_ref().map_or(self.speed_mps, |sensor| sensor.shown_mps);
        shown_mps * self.train.corrections.speed_scale
    }

    /// Returns the dead time in s by which forces act later than reported, or by which the sensor shows the speed late,
    /// the longer of the two. The train remembers the forces and speeds of its last 1000 steps.
    pub fn dead_time_s(&self) -> f64 {
        let Corrections { actuator_delay_s, brake_delay_s, speed_delay_s, .. } =
            self.train.corrections;
        (actuator_delay_s + brake_delay_s).max(speed_delay_s)
    }

    /// Returns the balance of accelerations at the end of the newest step.
    pub fn balance(&self) -> Option<&AccelerationBalance> {
        self.balance.as_ref()
    }

    /// Balances the forces of a moment without moving.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn look(&mut self, acting: &TrainSample) {
        let here = SimulatedMotion { distance_m: 0.0, speed_mps: self.speed_mps };
        let (balance, pulled) = self.balanced(acting, here);
        let is_held = self.is_held_at_rest && self.speed_mps == 0.0 && !pulled;
        self.balance = Some(if is_held { balance.held() } else { balance });
    }

    /// Moves for a time in s; `acting` returns the acting forces a number of seconds after the step's beginning.
    ///
    /// A sample's forces, mass, temperature and, without a line, gradient and curve act; a missing force counts as
    /// zero. Its position says where on the line it acts; missing, that is where the train has come to. Its speed
    /// is not used.
    ///
    /// # Real-time
    ///
    /// No allocation; work in proportion to the time.
    pub fn drive(&mut self, step_s: f64, acting: impl Fn(f64) -> TrainSample) {
        let parts = (step_s / STEP_MAX_S).ceil();
        let part_s = step_s / parts;
        for part in 0..parts as u32 {
            self.drive_part(part_s, |at_s| acting(f64::from(part) * part_s + at_s));
        }
        if let Some(sensor) = &mut self.sensor {
            sensor.take(step_s, self.speed_mps);
        }
    }

    fn drive_part(&mut self, step_s: f64, acting: impl Fn(f64) -> TrainSample) {
        let begin = SimulatedMotion { distance_m: 0.0, speed_mps: self.speed_mps };
        let mut is_held = self.is_held_at_rest && self.speed_mps == 0.0;
        let mut direction = 1.0;
        let after = advance(begin, step_s, |at_s, motion| {
            let sample = acting(at_s);
            let (balance, pulled) = self.balanced(&sample, motion);
            is_held &= !pulled;
            direction = f64::from(sample.direction);
            self.balance = Some(balance);
            balance.unheld_mps2()
        });
        if is_held {
            self.balance = self.balance.map(AccelerationBalance::held);
            return;
        }
        self.speed_mps = after.speed_mps;
        self.position_m += direction * after.distance_m;
        // The forces were taken at the speed that the step's beginning promised.
        self.balance = self.balance.map(|balance| balance.at(after.speed_mps));
    }

    /// Returns the forces at a motion within a step, and whether the train is pulled.
    fn balanced(
        &mut self,
        acting: &TrainSample,
        motion: SimulatedMotion,
    ) -> (AccelerationBalance, bool) {
        let mut sample = *acting;
        if sample.get(SampleField::Position).is_none() {
            let travelled_m = f64::from(sample.direction) * motion.distance_m;
            sample.set(SampleField::Position, self.position_m + travelled_m);
        }
        for force in [SampleField::TractionForce, SampleField::BrakeForce] {
            sample.set(force, sample.get(force).unwrap_or(0.0));
        }
        let speed_scale = self.train.corrections.speed_scale;
        sample.set(SampleField::Speed, motion.speed_mps * speed_scale);
        let resolved =
            self.forces.resolve(&ValidSample { sample: &sample, step_s: 0.0, segment: 1 });
        let forces = SampleForces::declared(&resolved, self.train.rotating_mass_factor);
        (
            AccelerationBalance::new(forces, self.train.resistance, motion.speed_mps),
            is_pulled(&resolved),
        )
    }
}

/// A force along the travel. Retarding forces are positive; traction is positive when it drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ForcePart {
    /// Traction force that acts, after gain and delay.
    Traction,
    /// Brake force that acts, after the delay.
    Brake,
    /// Weight along the gradient.
    Gradient,
    /// Basic resistance by the Davis coefficients.
    Basic,
    /// Curve resistance.
    Curve,
    /// Tunnels, by their length, as share of c and in addition to it.
    Tunnel,
    /// Addition of the wind to the air resistance.
    Wind,
    /// Addition of the temperature to the basic resistance.
    Ambient,
    /// Cold bearings.
    Bearing,
    /// Resistance at certain places.
    Location,
    /// Forces outside the library, by their form.
    Other,
}

impl ForcePart {
    /// Every part.
    pub const ALL: [ForcePart; 11] = [
        ForcePart::Traction,
        ForcePart::Brake,
        ForcePart::Gradient,
        ForcePart::Basic,
        ForcePart::Curve,
        ForcePart::Tunnel,
        ForcePart::Wind,
        ForcePart::Ambient,
        ForcePart::Bearing,
        ForcePart::Location,
        ForcePart::Other,
    ];
}

/// Balance of the accelerations of a train at a moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AccelerationBalance {
    forces: SampleForces,
    davis: Davis,
    speed_mps: f64,
    is_held: bool,
}

impl AccelerationBalance {
    pub(super) fn new(forces: SampleForces, davis: Davis, speed_mps: f64) -> Self {
        AccelerationBalance { forces, davis, speed_mps, is_held: false }
    }

    /// Returns the same at another speed in m/s nearby.
    pub(super) fn at(self, speed_mps: f64) -> Self {
        AccelerationBalance { speed_mps, ..self }
    }

    /// Returns the same while a brake that nobody reports holds the train.
    pub(super) fn held(self) -> Self {
        AccelerationBalance { is_held: true, ..self }
    }

    /// Returns the acceleration by the forces in m/s²: negative even where they hold the train at rest.
    #[inline]
    pub(super) fn unheld_mps2(&self) -> f64 {
        let [p0, p1, p2] = self.forces.polynomial(self.davis, self.speed_mps);
        p0 + self.speed_mps * (p1 + self.speed_mps * p2)
    }

    /// dv/dt in m/s²; 0 for a train that is held at rest.
    pub fn acceleration_mps2(&self) -> f64 {
        let free_mps2 = self.unheld_mps2();
        let stays = self.is_held || (self.speed_mps == 0.0 && free_mps2 < 0.0);
        if stays { 0.0 } else { free_mps2 }
    }

    /// Returns the gross mass in kg.
    pub fn mass_kg(&self) -> f64 {
        self.forces.mass_kg
    }

    /// Returns a part in N. On a standing train it is the force that would act.
    pub fn force_n(&self, part: ForcePart) -> f64 {
        let SampleForces { resistance, .. } = &self.forces;
        let (davis, speed_mps) = (self.davis, self.speed_mps);
        let n_per_kn = match part {
            ForcePart::Traction => return self.forces.traction_n,
            ForcePart::Brake => return self.forces.brake_n,
            ForcePart::Gradient => self.forces.gradient_permille,
            ForcePart::Basic => davis.w0_n_per_kn(speed_mps),
            ForcePart::Curve => resistance.curve_n_per_kn,
            ForcePart::Tunnel => resistance.in_tunnels_n_per_kn(davis, speed_mps),
            ForcePart::Wind => resistance.by_wind_n_per_kn(davis, speed_mps),
            ForcePart::Ambient => resistance.by_factor_n_per_kn(davis, speed_mps),
            ForcePart::Bearing => resistance.bearing_n_per_kn,
            ForcePart::Location => resistance.place_n_per_kn,
            ForcePart::Other => resistance.other_at_n_per_kn(speed_mps),
        };
        self.weight_kn() * n_per_kn
    }

    /// Returns all that resists in N but brake and gradient.
    pub fn resistance_n(&self) -> f64 {
        let (davis, speed_mps) = (self.davis, self.speed_mps);
        let extra_n_per_kn = self.forces.resistance.extra_n_per_kn(davis, speed_mps);
        self.weight_kn() * (davis.w0_n_per_kn(speed_mps) + extra_n_per_kn)
    }

    fn weight_kn(&self) -> f64 {
        TrainModel::weight_kn(self.forces.mass_kg)
    }
}

#[cfg(test)]
mod tests;
