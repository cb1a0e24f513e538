//! A point-mass simulator as a first user writes one.

use std::sync::Arc;

use dynocar_model::train::{BrakeGear, Davis, EffortCurve, TrainModel};
use dynocar_shared::{SampleField, TrainId, TrainSample};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Mass in kg, declared and true.
pub const MASS_KG: f64 = 278_000.0;
/// Friction between pad and disc, declared and true.
pub const FRICTION: f64 = 0.28;
/// Resistance, declared and true.
pub const DAVIS: Davis = Davis { a: 1.53, b: 0.0, c: 0.0111 };
/// Rotating mass over mass.
const ROTATING: f64 = 0.05;
/// Tick of the simulation in s.
const TICK_S: f64 = 1e-3 * TICK_MS as f64;
/// The same in ms: a divisor of every step between samples.
const TICK_MS: u32 = 2;
/// Brake-cylinder pressure in Pa over the brake force in N.
const PA_PER_N: f64 = 2.0;
const GRAVITY: f64 = 9.81;
/// Gradients in ‰, each 250 m long.
const GRADIENTS: [f64; 12] = [-2.0, -3.0, 10.4, 3.0, -8.0, 3.0, -2.0, 8.2, -20.0, 0.0, 5.0, -3.0];

/// Behaviour of the speed sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sensor {
    /// The speed itself.
    Exact,
    /// White noise of a standard deviation in m/s.
    Noisy(f64),
    /// Steps of a size in m/s.
    Quantised(f64),
}

/// How forces change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Forces {
    /// At once, at any moment between two samples.
    Jumping,
    /// At a sample, which gives the force that is held until the next.
    Held,
    /// At a sample, which gives the force that was held since the one before.
    Past,
    /// At 150 kN/s, as actuators do.
    Ramped,
}

impl Forces {
    pub const ALL: [Forces; 4] = [Forces::Jumping, Forces::Held, Forces::Past, Forces::Ramped];
}

/// Phase of the train's motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    Standing,
    Pulling,
    Coasting,
    Cruising,
    Braking,
}

impl Phase {
    pub const ALL: [Phase; 5] =
        [Phase::Standing, Phase::Pulling, Phase::Coasting, Phase::Cruising, Phase::Braking];
}

/// A drive of three legs that is first seen in the middle of a phase.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive {
    pub start: Phase,
    /// In ms.
    pub step_ms: u32,
    pub sensor: Sensor,
    pub forces: Forces,
    pub seed: u64,
}

pub fn train() -> Arc<TrainModel> {
    let gear = BrakeGear {
        cylinder_diameter_mm: Some(203.0),
        disc_radius_mm: Some(297.6),
        wheel_radius_mm: Some(460.0),
        efficiency: Some(0.85),
        ratio: Some(2.55),
        friction: Some(FRICTION),
        pads: Some(1.0 / (PA_PER_N * force_n_per_pa_and_pad())),
        ..BrakeGear::default()
    };
    Arc::new(TrainModel {
        name: "metro".into(),
        mass_kg: MASS_KG,
        length_m: 1.0,
        cars: 6,
        full_mass_kg: None,
        passenger_mass_kg: 70.0,
        rotating_mass_factor: ROTATING,
        resistance: DAVIS,
        curve_constant_n_per_kn_m: 0.0,
        tunnel_constant_n_per_kn_m: 0.0,
        traction: EffortCurve::new(vec![(0.0, 310_000.0), (22.0, 110_000.0)]),
        brake: None,
        drive: None,
        brake_gear: gear,
        corrections: Default::default(),
        extra: Vec::new(),
    })
}

fn force_n_per_pa_and_pad() -> f64 {
    std::f64::consts::FRAC_PI_4 * 0.203 * 0.203 * (297.6 / 460.0) * 0.85 * 2.55 * FRICTION
}

/// The state of the simulation.
struct Simulation {
    speed_mps: f64,
    position_m: f64,
    /// Traction positive, in N.
    force_n: f64,
    phase: Phase,
    since_s: f64,
    /// Drawn for each leg: top speed in m/s, coasting and cruising in s, brake force in N, and
    /// how long the force stays at a first share of its full value, in s.
    plan: [f64; 6],
    /// Share of [`GRADIENTS`]: lines of even seeds are level.
    hilliness: f64,
    random: ChaCha8Rng,
}

impl Simulation {
    fn new(seed: u64) -> Self {
        let random = ChaCha8Rng::seed_from_u64(seed);
        let mut simulation = Simulation {
            speed_mps: 0.0,
            position_m: 100.0,
            force_n: 0.0,
            phase: Phase::Standing,
            since_s: 0.0,
            plan: [0.0; 6],
            hilliness: if seed.is_multiple_of(2) { 0.0 } else { 1.0 },
            random,
        };
        simulation.draw_plan();
        simulation
    }

    fn draw_plan(&mut self) {
        let mut draw = |low, high| self.random.random_range(low..high);
        self.plan = [
            draw(13.0, 22.0),
            draw(15.0, 90.0),
            draw(10.0, 40.0),
            draw(60_000.0, 260_000.0),
            draw(0.0, 2.0),
            draw(0.0, 1.0),
        ];
    }

    fn gradient_permille(&self) -> f64 {
        self.hilliness * GRADIENTS[(self.position_m / 250.0) as usize % GRADIENTS.len()]
    }

    fn drag_n(&self) -> f64 {
        let w0 = DAVIS.w0_n_per_kn(self.speed_mps);
        1e-3 * GRAVITY * MASS_KG * (w0 + self.gradient_permille())
    }

    /// Changes the phase when it is time to; gives the force that is wanted in N.
    fn control(&mut self) -> f64 {
        let [top_mps, coasting_s, cruising_s, brake_n, first_s, first_share] = self.plan;
        let next = match self.phase {
            Phase::Standing if self.since_s > 12.0 => Phase::Pulling,
            Phase::Pulling if self.speed_mps >= top_mps || self.since_s > 60.0 => Phase::Coasting,
            Phase::Coasting if self.since_s > coasting_s || self.speed_mps < 7.0 => Phase::Cruising,
            Phase::Cruising if self.since_s > cruising_s => Phase::Braking,
            Phase::Braking if self.speed_mps <= 0.0 => Phase::Standing,
            same => same,
        };
        if next != self.phase {
            (self.phase, self.since_s) = (next, 0.0);
            if next == Phase::Standing {
                self.draw_plan();
            }
        }
        let share = if self.since_s < first_s { first_share } else { 1.0 };
        match self.phase {
            Phase::Standing => -40_000.0,
            Phase::Pulling => share * (2.4e6 / self.speed_mps.max(1.0)).min(310_000.0),
            Phase::Coasting => 0.0,
            Phase::Cruising => self.drag_n().clamp(-200_000.0, 200_000.0),
            Phase::Braking => -share * brake_n,
        }
    }

    fn tick(&mut self) {
        let push = self.force_n - self.drag_n();
        let after_mps = self.speed_mps + TICK_S * push / (MASS_KG * (1.0 + ROTATING));
        let is_held = self.phase == Phase::Standing && self.force_n < 0.0;
        let after_mps = if is_held { 0.0 } else { after_mps.max(0.0) };
        self.position_m += 0.5 * TICK_S * (self.speed_mps + after_mps);
        self.speed_mps = after_mps;
        self.since_s += TICK_S;
    }
}

impl Drive {
    /// The samples, each with the phase it was taken in.
    pub fn samples(&self) -> Vec<(TrainSample, Phase)> {
        let mut simulation = Simulation::new(self.seed);
        let mut noise = ChaCha8Rng::seed_from_u64(self.seed ^ 0x5eed);
        let mut all = Vec::new();
        let ramp_n = 150_000.0 * TICK_S;
        for now_ms in (0..420_000_u32).step_by(TICK_MS as usize) {
            let is_sampled = now_ms.is_multiple_of(self.step_ms);
            let before = simulation.force_n;
            match self.forces {
                Forces::Jumping => simulation.force_n = simulation.control(),
                Forces::Held if is_sampled => simulation.force_n = simulation.control(),
                Forces::Held | Forces::Past => {}
                Forces::Ramped => {
                    let wanted = simulation.control();
                    simulation.force_n = wanted.clamp(before - ramp_n, before + ramp_n);
                }
            }
            if is_sampled {
                all.push((self.measure(&simulation, now_ms, &mut noise), simulation.phase));
            }
            if self.forces == Forces::Past && is_sampled {
                simulation.force_n = simulation.control();
            }
            simulation.tick();
        }
        let is_there = |it: &(TrainSample, Phase)| it.1 == self.start;
        let first = all.iter().position(is_there).unwrap_or(0);
        let count = all[first..].iter().take_while(|it| is_there(it)).count();
        all.drain(..first + count / 2);
        for (sequence, (sample, _)) in (1..).zip(&mut all) {
            sample.sequence = sequence;
        }
        all
    }

    fn measure(&self, simulation: &Simulation, now_ms: u32, noise: &mut ChaCha8Rng) -> TrainSample {
        let mut sample = TrainSample::empty(TrainId(1));
        sample.time_ns = 1_000_000_000 + i64::from(now_ms) * 1_000_000;
        sample.direction = 1;
        sample.run = 1;
        let true_mps = simulation.speed_mps;
        let speed_mps = match self.sensor {
            _ if true_mps == 0.0 => 0.0,
            Sensor::Exact => true_mps,
            Sensor::Noisy(std_mps) => {
                // Sum of twelve uniforms: close to normal, variance 1.
                let normal = (0..12).map(|_| noise.random::<f64>()).sum::<f64>() - 6.0;
                (true_mps + std_mps * normal).max(0.0)
            }
            Sensor::Quantised(step_mps) => (true_mps / step_mps).round() * step_mps,
        };
        let brake_n = (-simulation.force_n).max(0.0);
        for (field, value) in [
            (SampleField::Position, simulation.position_m),
            (SampleField::Speed, speed_mps),
            (SampleField::TractionForce, simulation.force_n.max(0.0)),
            (SampleField::BrakeForce, brake_n),
            (SampleField::BrakeCylinderPressure, PA_PER_N * brake_n),
            (SampleField::Gradient, simulation.gradient_permille()),
            (SampleField::Mass, MASS_KG),
        ] {
            sample.set(field, value);
        }
        sample
    }
}
