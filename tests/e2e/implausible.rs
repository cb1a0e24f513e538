//! A real daemon fed with samples that cannot be true: the estimates are degraded, the fault is reported once, and
//! `dynocar health` shows it.

use dynocar_client::{SamplePublisher, SnapshotReader};
use dynocar_shared::{PipelineKind, Reason, SampleField, Status, TrainId, TrainSample};
use dynocar_tests::process::{DaemonSite, await_true};
use dynocar_transport::monotonic_now_ns;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");
const TRAIN: TrainId = TrainId(1);

/// Returns a sample of a train that pulls, coasts and brakes in turn on level track, at 5 Hz in the samples' own time.
/// The forces are in kN where N are expected.
fn sample(speed_mps: &mut f64, index: u64) -> TrainSample {
    let force_n = match index % 600 {
        0..200 => 160e3,
        200..400 => 0.0,
        _ => -140e3,
    };
    let retarding_n = 200.0 * 9.81 * (1.9 + *speed_mps * (0.03 + *speed_mps * 0.0043));
    let mut sample = TrainSample::empty(TRAIN)
        .with(SampleField::Speed, *speed_mps)
        .with(SampleField::Gradient, 0.0)
        .with(SampleField::TractionForce, (force_n / 1e3_f64).max(0.0))
        .with(SampleField::BrakeForce, (-force_n / 1e3_f64).max(0.0));
    sample.time_ns = index as i64 * 200_000_000;
    sample.run = 1;
    *speed_mps = (*speed_mps + 0.2 * (force_n - retarding_n) / (1.08 * 200e3)).clamp(2.0, 40.0);
    sample
}

#[test]
fn kilonewtons_for_newtons_are_degraded_logged_once_in_words_and_seen_by_health() {
    let site = DaemonSite::new();
    let pipelines = "[[pipelines]]\nkind = \"rls\"\n[[pipelines]]\nkind = \"mass_kalman\"\n";
    let config = site.write_config(1, "", pipelines);
    let daemon = site.start(DYNOCAR, &["run", "--config", config.to_str().unwrap()]);
    daemon.await_error("serving");
    let host = site.host();
    let mut publisher = SamplePublisher::open(&host, TRAIN).unwrap();
    let mut reader = SnapshotReader::open(&host, TRAIN).unwrap();
    let (mut speed_mps, mut index) = (2.0, 0);
    let kinds = [PipelineKind::Rls, PipelineKind::MassKalman];
    await_true(
        || {
            for _ in 0..50 {
                publisher.publish(&mut sample(&mut speed_mps, index)).unwrap();
                index += 1;
            }
            std::thread::sleep(std::time::Duration::from_millis(5));
            reader.poll();
            let now_ns = monotonic_now_ns();
            kinds.iter().all(|&kind| {
                reader.latest(kind, now_ns).is_some_and(|reading| {
                    reading.reason() == Some(Reason::ImplausibleForces)
                        && reading.status() != Status::Estimated
                })
            })
        },
        || "both pipelines to say implausible_forces".into(),
    );
    daemon.await_error("the samples cannot be true: forces look");
    let mut health = site.start(DYNOCAR, &["health", "--train", "1"]);
    assert_eq!(health.wait().code(), Some(3));
    let words = health.output();
    assert!(words.starts_with("train 1: degraded"), "{words}");
    assert!(words.contains("implausible_forces"), "{words}");
    let printed = daemon.errors();
    assert_eq!(printed.matches("the samples cannot be true").count(), 1, "{printed}");
    assert!(printed.contains("is the unit kN and not N?"), "{printed}");
}
