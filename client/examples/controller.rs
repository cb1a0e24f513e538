//! A controller's cycle at 1 kHz: publish a sample, poll, use the learned parameters, and fall back to the built-in
//! parameters whenever the learned ones are not usable.
//!
//! `cargo run --release -p dynocar-client --example controller -- [train id] [seconds]`
//! reports on standard output whenever its resistance comes from another source. Ten seconds of coasting teach the
//! daemon next to nothing: let `dynocar replay config/demo --rate 200` drive train 1 first, and this example drives on
//! with the learned values.

use std::time::{Duration, Instant};

use dynocar_client::{Host, SamplePublisher, SnapshotReader, monotonic_now_ns};
use dynocar_shared::resistance::GRAVITY_MPS2;
use dynocar_shared::{SampleField, TrainId, TrainSample};

const CYCLE: Duration = Duration::from_millis(1);
/// The train of config/demo/train.toml, which config/daemon.toml serves as train 1.
const MASS_KG: f64 = 1_799_200.0;
const ROTATING_MASS_FACTOR: f64 = 0.04;
/// Davis a, b, c in N/kN and m/s, as the manufacturer declared them.
const BUILT_IN: [f64; 3] = [1.498, 0.0147, 0.00086];

fn built_in_force_n(speed_mps: f64) -> f64 {
    let [a, b, c] = BUILT_IN;
    (a + speed_mps * (b + speed_mps * c)) * MASS_KG * GRAVITY_MPS2 / 1000.0
}

/// Returns the resistance in N, its source, and the reason for it.
fn resistance(reader: &SnapshotReader, speed_mps: f64) -> (f64, [&'static str; 2]) {
    let answer = reader.resistance(monotonic_now_ns());
    if let Ok(reading) = &answer
        && reading.is_usable()
        && let Some(estimate) = reading.snapshot.resistance_at(speed_mps)
    {
        return (estimate.force_n(MASS_KG).0, ["the daemon", reading.use_state().name()]);
    }
    let why = match answer {
        Ok(reading) => reading.why(),
        Err(why) => why.name(),
    };
    (built_in_force_n(speed_mps), ["the built-in parameters", why])
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let train = TrainId(arguments.next().map_or(Ok(1), |text| text.parse())?);
    let seconds: u64 = arguments.next().map_or(Ok(10), |text| text.parse())?;

    let host = Host::from_environment()?;
    let mut publisher = SamplePublisher::open(&host, train)?;
    let mut reader = SnapshotReader::open(&host, train)?;

    let mut speed_mps = 20.0;
    let mut before = [""; 2];
    let mut next = Instant::now();
    for cycle in 0..seconds * 1000 {
        let mut sample = TrainSample::empty(train)
            .with(SampleField::Speed, speed_mps)
            .with(SampleField::TractionForce, 0.0)
            .with(SampleField::BrakeForce, 0.0)
            // This train knows its gradient; one that knows its position sends that instead.
            .with(SampleField::Gradient, 0.0);
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

        // In place of the train: it coasts on the level.
        let inertia_kg = MASS_KG * (1.0 + ROTATING_MASS_FACTOR);
        speed_mps -= built_in_force_n(speed_mps) / inertia_kg * CYCLE.as_secs_f64();
        next += CYCLE;
        std::thread::sleep(next.saturating_duration_since(Instant::now()));
    }
    println!("published {} samples", publisher.published());
    Ok(())
}
