//! Simulated sensors.

use dynocar_model::simulate::motion::{lagged, quantised, shown};
use dynocar_shared::sample::FLAG_WHEEL_SLIDE;
use dynocar_shared::{SampleField, TrainId, TrainSample};

use super::disturbances::Disturbances;
use super::line_maker::SimulatedLine;
use super::random::SimulatorRandom;
use super::run_maker::RunPlan;
use super::settings::{ForceSampling, SimulatorSettings};
use super::train_maker::TrueTrain;
use super::true_run::{TRUE_STEP_S, TrueState};

/// The train that the simulator's samples belong to.
pub const SIMULATED_TRAIN: TrainId = TrainId(1);

/// A sensor: constant noise, noise in proportion to the reading, and a quantum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensor {
    /// Standard deviation of the constant noise.
    pub noise: f64,
    /// Standard deviation of the noise as share of the reading.
    pub relative_noise: f64,
    /// Smallest step of the reading; 0 for none.
    pub quantum: f64,
}

impl Sensor {
    fn scaled(self, factor: f64) -> Self {
        Sensor {
            noise: factor * self.noise,
            relative_noise: factor * self.relative_noise,
            quantum: factor * self.quantum,
        }
    }

    /// Returns a reading of a true value.
    pub fn read(&self, truth: f64, random: &mut SimulatorRandom) -> f64 {
        let noise = (self.noise + self.relative_noise * truth.abs()) * random.gaussian();
        self.to_quantum(truth + noise)
    }

    /// Returns a reading of something that is never negative and exactly zero when it is off.
    fn read_positive(&self, truth: f64, random: &mut SimulatorRandom) -> f64 {
        let reading = self.read(truth, random);
        shown(truth, || reading)
    }

    fn to_quantum(self, value: f64) -> f64 {
        if self.quantum > 0.0 { quantised(value, self.quantum) } else { value }
    }
}

/// The sensors of a train.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensors {
    /// Wheel tacho, m/s.
    pub speed: Sensor,
    /// Below this speed in m/s the tacho reads zero.
    pub speed_threshold_mps: f64,
    /// Odometer, m.
    pub position: Sensor,
    /// Standard deviation of an odometer's scale from run to run.
    pub odometer_scale_sd: f64,
    /// Standard deviation in m of a fix at a balise.
    pub balise_sd_m: f64,
    /// Traction and brake force, N.
    pub force: Sensor,
    /// Brake-cylinder pressure, Pa.
    pub pressure: Sensor,
    /// Outside temperature, °C.
    pub temperature: Sensor,
}

/// Draws the sensors of a train; `factor` scales their noise and quanta.
pub fn make_sensors(train: &TrueTrain, factor: f64, random: &mut SimulatorRandom) -> Sensors {
    let force_max_n = train.traction_max_n(0.0).max(train.brake_max_n(0.0));
    let force_quantum_n = if force_max_n > 400e3 { 200.0 } else { 50.0 };
    let sensor = |noise: f64, relative_noise: f64, quantum: f64| {
        Sensor { noise, relative_noise, quantum }.scaled(factor)
    };
    Sensors {
        speed: sensor(random.uniform(0.02, 0.045), 0.0, random.pick(&[0.01, 0.02, 0.03])),
        speed_threshold_mps: factor * random.uniform(0.03, 0.1),
        position: sensor(0.0, 0.0, 0.1),
        odometer_scale_sd: factor * 5e-4,
        balise_sd_m: factor * 0.3,
        force: sensor(2e-4 * force_max_n, random.uniform(0.002, 0.006), force_quantum_n),
        pressure: sensor(600.0, 0.0, 200.0),
        temperature: sensor(0.1, 0.0, 0.1),
    }
}

/// An instant between two true states.
struct Instant<'a> {
    states: &'a [TrueState],
    index: usize,
    /// From the state to the next.
    share: f64,
}

impl Instant<'_> {
    fn of(&self, value: fn(&TrueState) -> f64) -> f64 {
        let (here, next) = (value(&self.states[self.index]), value(&self.states[self.index + 1]));
        here + self.share * (next - here)
    }

    /// Returns the mean over this many true steps before; the instant's own value for 0.
    fn mean_of(&self, steps: usize, value: fn(&TrueState) -> f64) -> f64 {
        let from = self.index.saturating_sub(steps);
        match steps.min(self.index) {
            0 => self.of(value),
            steps => self.states[from..self.index].iter().map(value).sum::<f64>() / steps as f64,
        }
    }
}

/// Measures a run: one sample per period, each at its own instant.
pub fn measure_run(
    states: &[TrueState],
    plan: &RunPlan,
    line: &SimulatedLine,
    (sensors, disturbances): (&Sensors, &Disturbances),
    settings: &SimulatorSettings,
    random: &mut SimulatorRandom,
) -> Vec<TrainSample> {
    let odometer = read_odometer(states, plan, line, (sensors, disturbances), random);
    let shown_mps = shown_speeds_mps(states, disturbances);
    let end_s = states[states.len() - 1].time_s;
    let period_s = settings.sample_period_s;
    let count = (end_s / period_s).floor() as usize;
    let reading = disturbances.force_reading_factor;
    // The average is the mean of the true steps since the stamp before.
    let averaged = match settings.force_sampling {
        ForceSampling::Averaged => (period_s / TRUE_STEP_S).round() as usize,
        _ => 0,
    };
    (0..count)
        .map(|k| {
            let jitter_s = settings.defects.jitter * period_s * random.gaussian();
            // The stamp gives the instant truly, to a millisecond.
            let late_s = if k == 0 { 0.0 } else { jitter_s.clamp(-0.4, 0.4) };
            let time_s = ((k as f64 * period_s + late_s) * 1000.0).round() / 1000.0;
            // A sample at a true instant reads exactly that instant, in spite of rounding.
            let place = (1e6 * time_s / TRUE_STEP_S).round() / 1e6;
            let index = (place as usize).min(states.len() - 2);
            let instant = Instant { states, index, share: place - index as f64 };
            let between = |value: fn(&TrueState) -> f64| instant.of(value);
            let odometer_m =
                odometer[index] + instant.share * (odometer[index + 1] - odometer[index]);
            let wheel_mps =
                shown_mps[index] + instant.share * (shown_mps[index + 1] - shown_mps[index]);
            let speed_mps = if wheel_mps <= sensors.speed_threshold_mps {
                0.0
            } else {
                sensors.speed.read_positive(wheel_mps, random)
            };
            let traction_n =
                reading * instant.mean_of(averaged, |state| state.reported.traction_force_n);
            let brake_n = reading * instant.mean_of(averaged, |state| state.reported.brake_force_n);
            let pressure_pa = between(|state| state.cylinder_pressure_pa);
            let pressure_pa = sensors.pressure.read(pressure_pa, random).max(0.0);
            let temperature_degc = between(|state| state.temperature_degc);
            let mut sample = TrainSample::empty(SIMULATED_TRAIN)
                .with(SampleField::Position, sensors.position.read(odometer_m, random))
                .with(SampleField::Speed, speed_mps)
                .with(SampleField::TractionForce, sensors.force.read_positive(traction_n, random))
                .with(SampleField::BrakeForce, sensors.force.read_positive(brake_n, random))
                .with(SampleField::BrakeCylinderPressure, pressure_pa)
                .with(
                    SampleField::AmbientTemperature,
                    sensors.temperature.read(temperature_degc, random),
                )
                .with(SampleField::Mass, plan.declared_mass_kg());
            let slip_mps = between(|state| state.wheel_speed_mps - state.speed_mps);
            if slip_mps > 0.5 {
                sample.flags |= FLAG_WHEEL_SLIDE;
            }
            sample.time_ns =
                ((settings.time_offset_s + time_s) * 1000.0).round() as i64 * 1_000_000;
            sample.sequence = k as u64 + 1;
            sample.run = plan.number as u32;
            sample.direction = plan.direction as i8;
            sample
        })
        .collect()
}

/// Returns the speed in m/s that the tacho shows at each true state, noise and steps aside: late, and by its
/// declared wheel.
fn shown_speeds_mps(states: &[TrueState], disturbances: &Disturbances) -> Vec<f64> {
    let late = (disturbances.speed_delay_s / TRUE_STEP_S).max(0.0);
    let share = late.fract();
    let mut shown_mps = states[0].wheel_speed_mps;
    let mut last_mps = shown_mps;
    (0..states.len())
        .map(|index| {
            let before = |steps: usize| states[index.saturating_sub(steps)].wheel_speed_mps;
            let steps = late as usize;
            let reached_mps = before(steps) + share * (before(steps + 1) - before(steps));
            // Over a step a lag follows the mean; none follows at once.
            let lag_s = disturbances.speed_lag_s;
            let mean_mps = if lag_s > 0.0 { 0.5 * (last_mps + reached_mps) } else { reached_mps };
            shown_mps = lagged(shown_mps, mean_mps, TRUE_STEP_S, lag_s);
            last_mps = reached_mps;
            disturbances.speed_scale * shown_mps
        })
        .collect()
}

/// Returns the chainage in m that the odometer shows at each true state: counted from the wheel's speed and
/// corrected at every balise.
fn read_odometer(
    states: &[TrueState],
    plan: &RunPlan,
    line: &SimulatedLine,
    (sensors, disturbances): (&Sensors, &Disturbances),
    random: &mut SimulatorRandom,
) -> Vec<f64> {
    let scale = disturbances.speed_scale * (1.0 + sensors.odometer_scale_sd * random.gaussian());
    let mut shown_m = states[0].position_m + sensors.balise_sd_m * random.gaussian();
    let balises_between = |one_m: f64, other_m: f64| {
        let (low_m, high_m) = (one_m.min(other_m), one_m.max(other_m));
        let first = line.balises_m.partition_point(|&balise_m| balise_m <= low_m);
        line.balises_m.get(first).is_some_and(|&balise_m| balise_m <= high_m)
    };
    let mut odometer = Vec::with_capacity(states.len());
    odometer.push(shown_m);
    for pair in states.windows(2) {
        let wheel_mps = 0.5 * (pair[0].wheel_speed_mps + pair[1].wheel_speed_mps);
        shown_m += plan.direction * scale * wheel_mps * TRUE_STEP_S;
        if balises_between(pair[0].position_m, pair[1].position_m) {
            shown_m = pair[1].position_m + sensors.balise_sd_m * random.gaussian();
        }
        odometer.push(shown_m);
    }
    odometer
}
