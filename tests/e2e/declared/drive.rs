//! A drive whose forces are all known, as samples that declare none of them but the gradient.

use dynocar_model::track::Track;
use dynocar_model::train::{Davis, TrainModel};
use dynocar_shared::{SampleField, TrainId, TrainSample};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The train of all samples.
pub const TRAIN: TrainId = TrainId(3);
/// Time in s between samples.
pub const PERIOD_S: f64 = 0.2;
/// Dead time in s of the actuators, a multiple of the period, and their lag in s.
pub const DELAY_S: f64 = 1.0;
/// First-order lag in s of the actuators.
pub const LAG_S: f64 = 0.6;
/// Delay in s of a speed sensor that is late, a multiple of the period.
pub const SPEED_DELAY_S: f64 = 0.8;
/// Standard deviation of the measured speed in m/s.
const NOISE_MPS: f64 = 0.01;
/// Steps of integration between two samples.
const SUBSTEPS: u32 = 20;
/// Time in s between the starts of the two runs: long enough for cold bearings under any rule.
const RUN_EVERY_S: f64 = 20_000.0;
/// Commanded force over weight, positive for traction, and its duration in s.
const LEG: [(f64, f64); 6] =
    [(0.0, 10.0), (0.075, 35.0), (0.0, 60.0), (0.05, 18.0), (0.0, 50.0), (-0.09, 40.0)];
/// Legs of each of the two runs.
const LEGS: usize = 3;
/// Fastest change of the commanded force over weight, per s.
const SLEW_PER_S: f64 = 0.05;

/// True values at a sample.
#[derive(Clone, Copy, Debug)]
pub struct Instant {
    /// Time in s since the start of the run.
    pub time_s: f64,
    /// +1 or -1.
    pub direction: f64,
    /// Chainage of the train's centre in m.
    pub position_m: f64,
    /// Speed in m/s.
    pub speed_mps: f64,
    /// dv/dt in m/s².
    pub acceleration_mps2: f64,
    /// Commanded force in N.
    pub commanded_n: f64,
    /// Outside temperature in °C.
    pub degc: f64,
    /// Speed in m/s by a sensor that is [`SPEED_DELAY_S`] late.
    pub late_mps: f64,
}

/// Both runs.
pub struct Drive {
    /// True values at each sample.
    pub instants: Vec<Instant>,
    /// Recorded samples: the acting forces, the measured speed, the gradient.
    pub samples: Vec<TrainSample>,
}

/// Returns the commanded force over weight at each second after the start of a run, slewed.
fn commands() -> Vec<f64> {
    let mut command = 0.0;
    let mut all = Vec::new();
    for (share, duration_s) in (0..LEGS).flat_map(|_| LEG) {
        for _ in 0..(duration_s / PERIOD_S).round() as usize {
            let change = SLEW_PER_S * PERIOD_S;
            all.push(command);
            command = f64::clamp(share, command - change, command + change);
        }
    }
    all
}

/// The force that acts behind commands that are linear between samples: late, then lagged.
struct Actuator<'a> {
    commands: &'a [f64],
    acting: f64,
}

impl Actuator<'_> {
    fn late(&self, time_s: f64) -> f64 {
        let at = ((time_s - DELAY_S) / PERIOD_S).max(0.0);
        let before = (at.floor() as usize).min(self.commands.len() - 1);
        let after = (before + 1).min(self.commands.len() - 1);
        self.commands[before] + (at - at.floor()) * (self.commands[after] - self.commands[before])
    }

    /// Moves on to a time by a step within which the late command is linear.
    fn advance(&mut self, time_s: f64, step_s: f64) -> f64 {
        let (from, to) = (self.late(time_s - step_s), self.late(time_s));
        let slope = (to - from) / step_s;
        let settled = |late: f64| late - slope * LAG_S;
        self.acting = settled(to) + (self.acting - settled(from)) * (-step_s / LAG_S).exp();
        self.acting
    }
}

/// Beginning of a run.
struct Departure {
    run: usize,
    direction: f64,
    start_m: f64,
}

impl Drive {
    /// Drives a train over a surveyed line, there and back.
    pub fn new(train: &TrainModel, survey: &Track, pressure_pa_per_n: f64) -> Self {
        let mut drive = Drive { instants: Vec::new(), samples: Vec::new() };
        let mut noise = ChaCha8Rng::seed_from_u64(17);
        let mut start_m = 500.0;
        for (run, direction) in [1.0, -1.0].into_iter().enumerate() {
            drive.run(train, survey, Departure { run, direction, start_m });
            start_m = drive.instants[drive.instants.len() - 1].position_m;
        }
        for (instant, sample) in drive.instants.iter().zip(&mut drive.samples) {
            // Sum of twelve uniforms: close to normal, variance 1.
            let normal = (0..12).map(|_| noise.random::<f64>()).sum::<f64>() - 6.0;
            let measured = if instant.speed_mps > 0.0 { NOISE_MPS * normal } else { 0.0 };
            sample.set(SampleField::Speed, (instant.speed_mps + measured).max(0.0));
            let brake_n = sample.brake_force_n;
            sample.set(SampleField::BrakeCylinderPressure, pressure_pa_per_n * brake_n);
        }
        // Every run begins with a stand that is longer.
        let late = (SPEED_DELAY_S / PERIOD_S).round() as usize;
        for (instant, sample) in drive.instants[late..].iter_mut().zip(&drive.samples) {
            instant.late_mps = if instant.time_s < SPEED_DELAY_S { 0.0 } else { sample.speed_mps };
        }
        drive
    }

    fn run(
        &mut self,
        train: &TrainModel,
        survey: &Track,
        Departure { run, direction, start_m }: Departure,
    ) {
        let commands = commands();
        let mut actuator = Actuator { commands: &commands, acting: 0.0 };
        let weight_n = 1000.0 * TrainModel::weight_kn(train.mass_kg);
        let Davis { a, b, c } = train.resistance;
        let (mut position_m, mut speed_mps) = (start_m, 0.0_f64);
        for (k, &command) in commands.iter().enumerate() {
            let gradient = |at_m: f64| {
                survey.gradient_permille(at_m, train.length_m).expect("a surveyed gradient")
            };
            let rate = |acting: f64, at_m: f64, speed: f64| {
                let w0 = a + b * speed + c * speed * speed;
                let per_weight = acting - 1e-3 * (w0 + direction * gradient(at_m));
                9.81 * per_weight / (1.0 + train.rotating_mass_factor)
            };
            let time_s = k as f64 * PERIOD_S;
            let acceleration_mps2 =
                if speed_mps > 0.0 { rate(actuator.acting, position_m, speed_mps) } else { 0.0 };
            let time_ns = ((run as f64 * RUN_EVERY_S + time_s) * 1e9).round() as i64;
            self.instants.push(Instant {
                time_s,
                direction,
                position_m,
                speed_mps,
                acceleration_mps2,
                commanded_n: command * weight_n,
                degc: 3.0 + 0.004 * time_s,
                late_mps: 0.0,
            });
            let acting_n = actuator.acting * weight_n;
            let sample = TrainSample {
                time_ns,
                sequence: self.samples.len() as u64 + 1,
                direction: direction as i8,
                run: run as u32,
                ..TrainSample::empty(TRAIN)
            }
            .with(SampleField::Position, position_m)
            .with(SampleField::Mass, train.mass_kg)
            .with(SampleField::TractionForce, acting_n.max(0.0))
            .with(SampleField::BrakeForce, (-acting_n).max(0.0))
            .with(SampleField::AmbientTemperature, 3.0 + 0.004 * time_s)
            .with(SampleField::Gradient, gradient(position_m));
            self.samples.push(sample);
            let step_s = PERIOD_S / f64::from(SUBSTEPS);
            for j in 1..=SUBSTEPS {
                let before = actuator.acting;
                let after = actuator.advance(time_s + f64::from(j) * step_s, step_s);
                let slope = rate(0.5 * (before + after), position_m, speed_mps);
                let next_mps = (speed_mps + step_s * slope).max(0.0);
                position_m += 0.5 * direction * step_s * (speed_mps + next_mps);
                speed_mps = next_mps;
            }
        }
    }
}
