//! One run as it truly happened.

use dynocar_model::simulate::motion::autoregressed;
use dynocar_model::simulate::motion::{SimulatedMotion, advance};
use dynocar_model::terms::delay::DelayLine;
use dynocar_model::train::TrainModel;

use super::actuators::{Actuators, LateForces};
use super::driver::TrainDriver;
use super::driving::{Controls, Driver};
use super::dynamics::{SimulatedMoment, SimulatedResistance, TruePhysics};
use super::random::{SimulatorRandom, Stream};
use super::settings::{ForceSampling, SimulatorSettings};

/// Step in s of the true motion.
pub const TRUE_STEP_S: f64 = 0.05;

/// Greatest duration of a run, after which it is cut off, in multiples of the duration aimed at.
const DURATION_FACTOR_MAX: f64 = 2.5;

/// True values at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueState {
    /// Time in s from the run's first sample.
    pub time_s: f64,
    /// Chainage in m of the train's centre.
    pub position_m: f64,
    /// Distance travelled in m.
    pub distance_m: f64,
    /// Speed in m/s.
    pub speed_mps: f64,
    /// Speed in m/s of the wheel that carries the tacho; it differs while the wheel slips.
    pub wheel_speed_mps: f64,
    /// Forces before the sensors' noise.
    pub reported: Controls,
    /// Forces that act on the train.
    pub acting: Controls,
    /// Resisting forces.
    pub resistance: SimulatedResistance,
    /// Brake-cylinder pressure in Pa.
    pub cylinder_pressure_pa: f64,
    /// Outside temperature in °C.
    pub temperature_degc: f64,
    /// Headwind in m/s, gusts included.
    pub headwind_mps: f64,
    /// True mass in kg.
    pub mass_kg: f64,
    /// True mass with its rotating part in kg.
    pub inertial_mass_kg: f64,
}

/// Drives a run to its last stop.
pub fn drive_run(physics: &TruePhysics<'_>, settings: &SimulatorSettings) -> Vec<TrueState> {
    let (train, plan, disturbances) = (physics.train, physics.plan, physics.disturbances);
    let stream = |stream: Stream| SimulatorRandom::new(settings.seed, stream);
    let mut driver =
        TrainDriver::new(train, physics.line, plan, stream(Stream::Driver(plan.number)));
    let held_n = TrainDriver::holding_force_n(train);
    let held = Controls { traction_force_n: 0.0, brake_force_n: held_n };
    let mut actuators = Actuators::new(train, plan.mass_kg, TRUE_STEP_S, held_n);
    let mut late = LateForces::new(disturbances.delay_s, disturbances.lag_s, TRUE_STEP_S, held);
    let [brake_delay_s, brake_lag_s] = disturbances.brake_late_s;
    let mut late_brake = DelayLine::new(brake_delay_s, brake_lag_s);
    let mut slip = WheelSlip::new(settings, stream(Stream::Slip(plan.number)));
    let mut weather = Weather::new(physics, stream(Stream::Gusts(plan.number)));
    let mut motion = SimulatedMotion { distance_m: 0.0, speed_mps: 0.0 };
    let held_steps = (settings.sample_period_s / TRUE_STEP_S).round().max(1.0) as usize;
    let mut held_on = held;
    let steps_max = (DURATION_FACTOR_MAX * settings.duration_s / TRUE_STEP_S) as usize;
    let mut states = Vec::with_capacity(steps_max);
    for step in 0..steps_max {
        let time_s = step as f64 * TRUE_STEP_S;
        let Some(wanted) = driver.controls(time_s, motion) else { break };
        let mut forces = actuators.advance(train, wanted, motion.speed_mps);
        let slip_mps = slip.advance(&mut forces, train.traction_max_n(0.0), motion.speed_mps);
        if settings.force_sampling == ForceSampling::Held {
            if step % held_steps == 0 {
                held_on = forces;
            }
            forces = held_on;
        }
        let position_m = plan.start_m + plan.direction * motion.distance_m;
        let (headwind_mps, temperature_degc) = weather.advance();
        let mass_kg = plan.mass_kg * disturbances.mass_factor(time_s, position_m);
        let now = SimulatedMoment { time_s, headwind_mps, temperature_degc, mass_kg };
        let brake_force_n = acting_brake_n(&mut late_brake, time_s, forces.brake_force_n);
        let mut acting = late.advance(Controls { brake_force_n, ..forces });
        if let Some(cap) = &disturbances.adhesion {
            let weight_n = 1000.0 * TrainModel::weight_kn(mass_kg);
            acting.brake_force_n = cap.carried_n(acting.brake_force_n, weight_n, position_m);
        }
        let reported = Controls {
            traction_force_n: disturbances.traction_gain * forces.traction_force_n,
            brake_force_n: disturbances.brake_gain * forces.brake_force_n,
        };
        let under = physics.line_under(position_m);
        let inertial_mass_kg = mass_kg * (1.0 + disturbances.rotating_mass_factor);
        let control_n = acting.traction_force_n - acting.brake_force_n;
        let dragging_pa =
            if disturbances.drag_n(time_s) > 0.0 { disturbances.residual_pressure_pa } else { 0.0 };
        states.push(TrueState {
            time_s,
            position_m,
            distance_m: motion.distance_m,
            speed_mps: motion.speed_mps,
            wheel_speed_mps: motion.speed_mps + slip_mps,
            reported,
            acting,
            resistance: physics.resistance(motion.speed_mps, &under, &now),
            cylinder_pressure_pa: actuators.cylinder_pressure_pa().max(dragging_pa),
            temperature_degc,
            headwind_mps,
            mass_kg,
            inertial_mass_kg,
        });
        motion = advance(motion, TRUE_STEP_S, |_, at| {
            (control_n - physics.resistance(at.speed_mps, &under, &now).total_n())
                / inertial_mass_kg
        });
    }
    states
}

/// Returns the brake force in N that acts behind a line when this one is reported. It changes evenly between steps: the
/// mean lateness is that of the line, to the last ms.
fn acting_brake_n(late_brake: &mut DelayLine<1>, time_s: f64, reported_n: f64) -> f64 {
    let at = ((time_s * 1e9).round() as i64, 0);
    late_brake.acting(at, Some([reported_n])).map_or(reported_n, |[acting_n]| acting_n)
}

/// Gusts and the slow change of temperature.
struct Weather {
    random: SimulatorRandom,
    mean_headwind_mps: f64,
    gust_sd_mps: f64,
    gust_mps: f64,
    temperature_degc: f64,
    warming_k_per_step: f64,
}

/// Correlation time in s of gusts.
const GUST_TIME_S: f64 = 20.0;

impl Weather {
    fn new(physics: &TruePhysics<'_>, random: SimulatorRandom) -> Self {
        let mut random = random;
        // The first number of this stream is the wind of the day.
        random.gaussian();
        let gust_sd_mps = physics.disturbances.gust_sd_mps;
        Weather {
            mean_headwind_mps: physics.disturbances.headwind_mps,
            gust_sd_mps,
            gust_mps: gust_sd_mps * random.gaussian(),
            temperature_degc: physics.plan.temperature_degc,
            warming_k_per_step: random.uniform(-1.0, 1.0) * TRUE_STEP_S / 900.0,
            random,
        }
    }

    /// Headwind in m/s and temperature in °C of this step.
    fn advance(&mut self) -> (f64, f64) {
        let now = (self.mean_headwind_mps + self.gust_mps, self.temperature_degc);
        let kept = (-TRUE_STEP_S / GUST_TIME_S).exp();
        self.gust_mps =
            autoregressed(self.gust_mps, kept, self.gust_sd_mps, self.random.gaussian());
        self.temperature_degc += self.warming_k_per_step;
        now
    }
}

/// Short slips of the driven wheels under strong traction at low speed.
struct WheelSlip {
    random: SimulatorRandom,
    probability_per_step: f64,
    /// Steps done, steps in all, greatest slip in m/s.
    active: Option<(u32, u32, f64)>,
}

/// Time in s per run, roughly, in which slip is possible.
const SLIPPERY_S_PER_RUN: f64 = 60.0;

impl WheelSlip {
    fn new(settings: &SimulatorSettings, random: SimulatorRandom) -> Self {
        let probability_per_step = settings.wheel_slips_per_run * TRUE_STEP_S / SLIPPERY_S_PER_RUN;
        WheelSlip { random, probability_per_step, active: None }
    }

    /// Lowers the traction that a slipping wheel transmits; returns its excess speed in m/s.
    fn advance(&mut self, forces: &mut Controls, traction_max_n: f64, speed_mps: f64) -> f64 {
        let is_possible =
            forces.traction_force_n > 0.5 * traction_max_n && (0.5..15.0).contains(&speed_mps);
        if self.active.is_none() && is_possible && self.random.chance(self.probability_per_step) {
            let steps = self.random.uniform(1.0, 3.0) / TRUE_STEP_S;
            self.active = Some((0, steps as u32, self.random.uniform(0.3, 1.5)));
        }
        if forces.traction_force_n == 0.0 {
            self.active = None;
        }
        let Some((done, steps, greatest_mps)) = self.active else { return 0.0 };
        let rise = (std::f64::consts::PI * f64::from(done) / f64::from(steps)).sin();
        self.active = (done + 1 < steps).then_some((done + 1, steps, greatest_mps));
        forces.traction_force_n *= 1.0 - 0.5 * rise;
        greatest_mps * rise * rise
    }
}
