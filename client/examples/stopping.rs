//! Braking distance from the present speed, with the adhesion, the brake and the resistance that the daemon has
//! learned; where it has learned nothing usable, with the built-in values.
//!
//! `cargo run --release -p dynocar-client --example stopping -- [train id] [speed in m/s]`

use std::time::Duration;

use dynocar_client::{Host, NoAnswer, SnapshotReader, monotonic_now_ns};
use dynocar_shared::stopping::{BrakeResponse, EffortPoint, RailAdhesion, Stop};
use dynocar_shared::{Parameter, ParameterSnapshot, Quantity, RailCondition, TrainId, Uncertain};

/// The train of config/demo/train.toml, which config/daemon.toml serves as train 1.
const MASS_KG: f64 = 1_799_200.0;
const DECLARED_FRICTION: f64 = 0.35;
const CONFIDENCE: f64 = 0.99;
const EFFORT: [EffortPoint; 2] = [
    EffortPoint { speed_mps: 0.0, force_n: 1_216_000.0 },
    EffortPoint { speed_mps: 30.0, force_n: 1_216_000.0 },
];
const ASKED: [Quantity; 3] = [Quantity::Resistance, Quantity::BrakeFriction, Quantity::Adhesion];

/// Returns the daemon's snapshot of a quantity if it may be used; prints its source.
fn learned(reader: &SnapshotReader, quantity: Quantity) -> Option<&ParameterSnapshot> {
    let answer = reader.quantity(quantity, monotonic_now_ns());
    if let Ok(reading) = &answer
        && reading.is_usable()
    {
        println!("{quantity}: the daemon ({})", reading.use_state());
        return Some(reading.snapshot);
    }
    let why = match answer {
        Ok(reading) => reading.why(),
        Err(why) => why.name(),
    };
    println!("{quantity}: the built-in values ({why})");
    None
}

fn value_of(snapshot: &ParameterSnapshot, parameter: Parameter) -> Option<Uncertain> {
    Some(Uncertain::new(snapshot.value(parameter)?, snapshot.std(parameter)?))
}

fn stop(reader: &SnapshotReader, speed_mps: f64) -> Stop<'static> {
    let mut stop = Stop {
        rotating_mass_factor: 0.04,
        w0_std_n_per_kn: 0.3,
        brake_scale: Uncertain::new(1.0, 0.1),
        // Declared, or `law.response` of `dynocar stops --json`.
        response: BrakeResponse {
            dead_time_s: 0.8,
            build_up_s: 2.0,
            std_s: 0.3,
            ..BrakeResponse::IMMEDIATE
        },
        // A wet rail, until the daemon knows better.
        adhesion: RailAdhesion::Law(RailCondition::Wet, Uncertain::new(1.0, 0.1)),
        ..Stop::level(speed_mps, MASS_KG, [1.498, 0.0147, 0.00086], &EFFORT)
    };
    if let Some(snapshot) = learned(reader, Quantity::Resistance)
        && let Some(resistance) = snapshot.resistance_at(speed_mps)
    {
        let davis = [Parameter::DavisA, Parameter::DavisB, Parameter::DavisC];
        stop.davis = davis.map(|parameter| snapshot.value(parameter).unwrap_or_default());
        stop.w0_std_n_per_kn = resistance.w0_std_n_per_kn;
    }
    if let Some(snapshot) = learned(reader, Quantity::BrakeFriction)
        && let Some(friction) = value_of(snapshot, Parameter::DiscFriction)
    {
        let share = 1.0 / DECLARED_FRICTION;
        stop.brake_scale = Uncertain::new(share * friction.value, share * friction.std);
    }
    // The rail carries less at this speed than where the last braking ended.
    if let Some(snapshot) = learned(reader, Quantity::Adhesion)
        && let Some(adhesion) = RailAdhesion::learned(snapshot)
    {
        stop.adhesion = adhesion;
    }
    stop
}

/// Polls for up to half a second, until every pipeline that answers has been heard.
fn listen(reader: &mut SnapshotReader) {
    for _ in 0..50 {
        reader.poll();
        let now_ns = monotonic_now_ns();
        let is_heard = |&it| !matches!(reader.quantity(it, now_ns), Err(NoAnswer::NoSnapshot));
        if ASKED.iter().all(is_heard) {
            return;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let train = TrainId(arguments.next().map_or(Ok(1), |text| text.parse())?);
    let speed_mps: f64 = arguments.next().map_or(Ok(20.0), |text| text.parse())?;
    let mut reader = SnapshotReader::open(&Host::from_environment()?, train)?;
    listen(&mut reader);
    let found = stop(&reader, speed_mps).estimate(CONFIDENCE)?;
    println!(
        "from {speed_mps:.1} m/s: {:.0} m and {:.1} s; with {:.0} % confidence within {:.0} m and \
         {:.1} s",
        found.distance_m,
        found.time_s,
        100.0 * CONFIDENCE,
        found.distance_bound_m,
        found.time_bound_s
    );
    Ok(())
}
