//! Braking distance from the present speed, under what the daemon has learned of the rail, of the
//! brake and of the resistance; with the built-in values where it has learned nothing usable.
//!
//! `cargo run --release -p dynocar-client --example stopping -- [train id] [speed in m/s]`

use dynocar_client::{Host, Reading, SnapshotReader, monotonic_now_ns};
use dynocar_shared::stopping::{EffortPoint, RailAdhesion, Stop};
use dynocar_shared::{Parameter, PipelineKind, RailCondition, TrainId, Uncertain};

const MASS_KG: f64 = 114_500.0;
const DECLARED_FRICTION: f64 = 0.35;
const CONFIDENCE: f64 = 0.99;
const EFFORT: [EffortPoint; 3] = [
    EffortPoint { speed_mps: 0.0, force_n: 130_000.0 },
    EffortPoint { speed_mps: 25.0, force_n: 130_000.0 },
    EffortPoint { speed_mps: 40.0, force_n: 90_000.0 },
];

fn usable(reader: &SnapshotReader, kind: PipelineKind) -> Option<Reading<'_>> {
    reader.latest(kind, monotonic_now_ns()).filter(|reading| reading.is_usable())
}

fn learned(reader: &SnapshotReader, kind: PipelineKind, parameter: Parameter) -> Option<Uncertain> {
    let snapshot = usable(reader, kind)?.snapshot;
    Some(Uncertain::new(snapshot.value(parameter)?, snapshot.std(parameter)?))
}

fn stop(reader: &SnapshotReader, speed_mps: f64) -> Stop<'static> {
    let mut stop = Stop {
        rotating_mass_factor: 0.06,
        w0_std_n_per_kn: 0.3,
        brake_scale: Uncertain::new(1.0, 0.1),
        // A wet rail, until the daemon knows better.
        adhesion: RailAdhesion::Law(RailCondition::Wet, Uncertain::new(1.0, 0.1)),
        ..Stop::level(speed_mps, MASS_KG, [1.5, 0.02, 0.0012], &EFFORT)
    };
    if let Some(Reading { snapshot, .. }) = usable(reader, PipelineKind::ResistanceKalman)
        && let Some(resistance) = snapshot.resistance_at(speed_mps)
    {
        let davis = [Parameter::DavisA, Parameter::DavisB, Parameter::DavisC];
        stop.davis = davis.map(|parameter| snapshot.value(parameter).unwrap_or_default());
        stop.w0_std_n_per_kn = resistance.w0_std_n_per_kn;
    }
    let kind = PipelineKind::BrakeSmoother;
    if let Some(friction) = learned(reader, kind, Parameter::DiscFriction) {
        let share = 1.0 / DECLARED_FRICTION;
        stop.brake_scale = Uncertain::new(share * friction.value, share * friction.std);
    }
    let kind = PipelineKind::AdhesionSmoother;
    if let Some(adhesion) = learned(reader, kind, Parameter::Adhesion) {
        stop.adhesion = RailAdhesion::Coefficient(adhesion);
    }
    stop
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let train = TrainId(arguments.next().map_or(Ok(7), |text| text.parse())?);
    let speed_mps: f64 = arguments.next().map_or(Ok(30.0), |text| text.parse())?;
    let mut reader = SnapshotReader::open(&Host::from_environment()?, train)?;
    reader.poll();
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
