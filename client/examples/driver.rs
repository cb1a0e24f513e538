//! A driver on a simulated train: put your own controller in its place, and see how much it gains.
//!
//! `cargo run --release -p dynocar-client --example driver -- [train id] [legs]`
//! drives that many legs of 6 km by the timetable, many times faster than real time, and reports after each how late it
//! came, how far beyond the stopping point it stands, and by which parameters it drove. With `dynocar run --config
//! config/daemon.toml` next to it, it drives by the parameters that the daemon learns.

use std::time::Duration;

use dynocar_client::{Host, SamplePublisher, SnapshotReader, monotonic_now_ns};
use dynocar_shared::resistance::GRAVITY_MPS2;
use dynocar_shared::{Parameter, SampleField, TrainId, TrainSample};

const CYCLE_S: f64 = 0.2;
const PATIENCE: Duration = Duration::from_millis(50);
const LEG_M: f64 = 6000.0;
const DUE_S: f64 = 450.0;
const CRUISE_MPS: f64 = 19.0;
const COASTING_MIN_MPS: f64 = 15.0;
const BRAKING_MPS2: f64 = 0.25;
const GAIN_PER_S: f64 = 0.3;
/// The train of config/demo/train.toml, which config/daemon.toml serves as train 1.
const TRACTION_N: f64 = 300e3;
const BRAKE_N: f64 = 1216e3;
const SLEW_N_PER_S: f64 = 150e3;
const ROTATING_MASS_FACTOR: f64 = 0.04;
const BUILT_IN: Parameters =
    Parameters { mass_kg: 1_799_200.0, davis: [1.498, 0.0147, 0.00086], is_learned: false };
/// The undeclared truth: another load, and more resistance.
const TRUTH: Parameters =
    Parameters { mass_kg: 2_050_000.0, davis: [2.1, 0.019, 0.00115], is_learned: false };

#[derive(Clone, Copy)]
struct Parameters {
    mass_kg: f64,
    davis: [f64; 3],
    is_learned: bool,
}

impl Parameters {
    /// Returns the force in N, braking negative, for an acceleration in m/s² on the level.
    fn force_n(&self, acceleration_mps2: f64, speed_mps: f64) -> f64 {
        let [a, b, c] = self.davis;
        let w0_n_per_kn = a + speed_mps * (b + speed_mps * c);
        let resistance_n = w0_n_per_kn * self.mass_kg * GRAVITY_MPS2 / 1000.0;
        self.mass_kg * (1.0 + ROTATING_MASS_FACTOR) * acceleration_mps2 + resistance_n
    }

    /// Returns the acceleration in m/s² under a force in N.
    fn acceleration_mps2(&self, force_n: f64, speed_mps: f64) -> f64 {
        let free_n = force_n - self.force_n(0.0, speed_mps);
        free_n / (self.mass_kg * (1.0 + ROTATING_MASS_FACTOR))
    }
}

/// A train on the level: place in m, speed in m/s, force in N.
#[derive(Clone, Copy, Default)]
struct Train {
    at_m: f64,
    speed_mps: f64,
    force_n: f64,
}

impl Train {
    fn step(&mut self, wanted_n: f64, parameters: &Parameters) {
        let most_n = SLEW_N_PER_S * CYCLE_S;
        let next_n = wanted_n.clamp(self.force_n - most_n, self.force_n + most_n);
        let mean_n = 0.5 * (self.force_n + next_n);
        let before_mps = self.speed_mps;
        let gained_mps = CYCLE_S * parameters.acceleration_mps2(mean_n, before_mps);
        self.speed_mps = (before_mps + gained_mps).max(0.0);
        self.at_m += 0.5 * CYCLE_S * (before_mps + self.speed_mps);
        self.force_n = next_n;
    }
}

/// Your controller: the force in N, braking negative, at a place with a speed, by known parameters.
fn controller_n(train: &Train, coast_from_m: f64, known: &Parameters) -> f64 {
    let curve_mps = (2.0 * BRAKING_MPS2 * (LEG_M - train.at_m).max(0.0)).sqrt();
    let speed_mps = train.speed_mps;
    let brakes = speed_mps + 0.5 >= curve_mps && train.at_m > 0.5 * LEG_M;
    let coasts = train.at_m >= coast_from_m;
    if !brakes && coasts && speed_mps > COASTING_MIN_MPS {
        return 0.0;
    }
    let target_mps = if coasts { COASTING_MIN_MPS } else { CRUISE_MPS };
    let acceleration_mps2 = match brakes {
        true => GAIN_PER_S * (curve_mps - speed_mps) - BRAKING_MPS2,
        false => GAIN_PER_S * (target_mps - speed_mps),
    };
    known.force_n(acceleration_mps2, speed_mps).clamp(-BRAKE_N, TRACTION_N)
}

/// Running time in s by known parameters.
fn predicted_s(coast_from_m: f64, known: &Parameters) -> f64 {
    let (mut train, mut time_s) = (Train::default(), 0.0);
    while time_s < 2.0 * DUE_S && (train.at_m < 1.0 || train.speed_mps > 0.0) {
        train.step(controller_n(&train, coast_from_m, known), known);
        time_s += CYCLE_S;
    }
    time_s
}

/// Returns the first place in m from which coasting still keeps the timetable, by known parameters.
fn coasting_place_m(known: &Parameters) -> f64 {
    let (mut early_m, mut late_m) = (0.1 * LEG_M, LEG_M);
    for _ in 0..20 {
        let middle_m = 0.5 * (early_m + late_m);
        match predicted_s(middle_m, known) <= DUE_S {
            true => late_m = middle_m,
            false => early_m = middle_m,
        }
    }
    late_m
}

/// Returns the usable answers of the daemon, else the built-in parameters.
fn known(reader: &SnapshotReader) -> Parameters {
    let (mut known, now_ns) = (BUILT_IN, monotonic_now_ns());
    if let Ok(reading) = reader.mass(now_ns)
        && reading.is_usable()
        && let Some(mass_t) = reading.snapshot.value(Parameter::Mass)
    {
        (known.mass_kg, known.is_learned) = (1000.0 * mass_t, true);
    }
    if let Ok(reading) = reader.resistance(now_ns)
        && reading.is_usable()
    {
        let davis = [Parameter::DavisA, Parameter::DavisB, Parameter::DavisC];
        known.davis = davis.map(|it| reading.snapshot.value(it).unwrap_or_default());
        known.is_learned = true;
    }
    known
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let id = TrainId(arguments.next().map_or(Ok(1), |text| text.parse())?);
    let legs: u32 = arguments.next().map_or(Ok(6), |text| text.parse())?;
    let host = Host::from_environment()?;
    let mut publisher = SamplePublisher::open(&host, id)?;
    let mut reader = SnapshotReader::open(&host, id)?;
    let mut time_ns = monotonic_now_ns();
    for leg in 1..=legs {
        let mut train = Train::default();
        publisher.start_run();
        reader.poll();
        let mut coast_from_m = coasting_place_m(&known(&reader));
        let mut cycles = 0;
        while cycles == 0 || train.at_m < 1.0 || train.speed_mps > 0.0 {
            let mut sample = TrainSample::empty(id)
                .with(SampleField::Speed, train.speed_mps)
                .with(SampleField::TractionForce, train.force_n.max(0.0))
                .with(SampleField::BrakeForce, (-train.force_n).max(0.0))
                .with(SampleField::Gradient, 0.0);
            time_ns += (1e9 * CYCLE_S) as i64;
            sample.time_ns = time_ns;
            // A refused sample counts as lost; the cycle goes on.
            let _ = publisher.publish(&mut sample);
            // The simulated clock waits for the daemon, where there is one; a real one never does.
            publisher.flush(PATIENCE);
            reader.poll();
            let known = known(&reader);
            if cycles % 150 == 149 && train.at_m < coast_from_m {
                coast_from_m = coasting_place_m(&known);
            }
            train.step(controller_n(&train, coast_from_m, &known), &TRUTH);
            cycles += 1;
        }
        let known = known(&reader);
        println!(
            "leg {leg}: {:+.1} s off the timetable, {:+.2} m off the stopping point, by {} ({:.0} t)",
            f64::from(cycles) * CYCLE_S - DUE_S,
            train.at_m - LEG_M,
            if known.is_learned { "the daemon" } else { "the built-in parameters" },
            1e-3 * known.mass_kg,
        );
    }
    Ok(())
}
