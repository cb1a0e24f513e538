//! A controller's cycle at 1 kHz: publish a sample, poll, use what the daemon learned, and fall
//! back to the built-in parameters whenever that is not usable.
//!
//! `cargo run --release -p dynocar-client --example controller -- [train id] [seconds]`
//! tells on standard output whenever its resistance comes from another source.

use std::time::{Duration, Instant};

use dynocar_client::{Host, SamplePublisher, SnapshotReader, monotonic_now_ns};
use dynocar_shared::resistance::STANDARD_GRAVITY_MPS2;
use dynocar_shared::{PipelineKind, SampleField, Status, TrainId, TrainSample};

const CYCLE: Duration = Duration::from_millis(1);
const MASS_KG: f64 = 114_500.0;
/// Davis a, b, c in N/kN and m/s, as the manufacturer declared them.
const BUILT_IN: [f64; 3] = [1.5, 0.02, 0.0012];

fn built_in_force_n(speed_mps: f64) -> f64 {
    let [a, b, c] = BUILT_IN;
    (a + speed_mps * (b + speed_mps * c)) * MASS_KG * STANDARD_GRAVITY_MPS2 / 1000.0
}

/// Resistance in N, where it comes from, and why.
fn resistance(reader: &SnapshotReader, speed_mps: f64) -> (f64, [&'static str; 2]) {
    let reading = reader.latest(PipelineKind::ResistanceKalman, monotonic_now_ns());
    let usable = reading.as_ref().filter(|reading| reading.is_usable());
    if let Some(estimate) = usable.and_then(|reading| reading.snapshot.resistance_at(speed_mps)) {
        return (estimate.force_n(MASS_KG).0, ["the daemon", Status::Estimated.name()]);
    }
    let reason = reading.and_then(|reading| reading.reason());
    let reason = reason.map_or("no_snapshot", |reason| reason.name());
    (built_in_force_n(speed_mps), ["the built-in parameters", reason])
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let train = TrainId(arguments.next().map_or(Ok(7), |text| text.parse())?);
    let seconds: u64 = arguments.next().map_or(Ok(10), |text| text.parse())?;

    let host = Host::from_environment()?;
    let mut publisher = SamplePublisher::open(&host, train)?;
    let mut reader = SnapshotReader::open(&host, train)?;

    let (mut speed_mps, mut position_m) = (20.0, 0.0);
    let mut before = [""; 2];
    let mut next = Instant::now();
    for cycle in 0..seconds * 1000 {
        let mut sample = TrainSample::empty(train)
            .with(SampleField::Position, position_m)
            .with(SampleField::Speed, speed_mps)
            .with(SampleField::TractionForce, 0.0)
            .with(SampleField::BrakeForce, 0.0);
        sample.time_ns = monotonic_now_ns();
        // A refused sample counts as lost; the cycle goes on.
        let _ = publisher.publish(&mut sample);

        reader.poll();
        let (force_n, from) = resistance(&reader, speed_mps);
        if from != before {
            // A real controller would not print from its cycle.
            let [source, reason] = from;
            println!(
                "cycle {cycle}: {force_n:.0} N at {speed_mps:.2} m/s from {source} ({reason})"
            );
            before = from;
        }

        // In place of the train: it coasts.
        position_m += speed_mps * CYCLE.as_secs_f64();
        speed_mps -= built_in_force_n(speed_mps) / MASS_KG * CYCLE.as_secs_f64();
        next += CYCLE;
        std::thread::sleep(next.saturating_duration_since(Instant::now()));
    }
    println!("published {} samples", publisher.published());
    Ok(())
}
