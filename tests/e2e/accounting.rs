//! `offered = used + rejected + lost` for every pipeline, from a controller's first sample to its last, even if a
//! process starts late, dies or is stopped meanwhile.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use dynocar::config::is_slow;
use dynocar_analysis::identify::default_estimators;
use dynocar_client::{SamplePublisher, SnapshotReader};
use dynocar_shared::{ParameterSnapshot, SampleField, TrainId, TrainSample};
use dynocar_tests::process::{DaemonSite, Process, await_true};
use dynocar_transport::Host;
use dynocar_transport::channel::SampleCount;
use rustix::process::Signal;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");
const PEER: &str = env!("CARGO_BIN_EXE_dynocar-test-peer");
const ECHO: &str = "[[pipelines]]\nkind = \"echo\"\n";
const TRAIN: TrainId = TrainId(1);

fn daemon(site: &DaemonSite, pipelines: &str) -> Process {
    let config = site.write_config(1, "", pipelines);
    let daemon = site.start(DYNOCAR, &["run", "--config", config.to_str().expect("UTF-8")]);
    daemon.await_error("serving");
    daemon
}

/// Every kind of pipeline on two threads; gives their number as well.
fn all_pipelines() -> (String, usize) {
    let kinds: Vec<_> = default_estimators().iter().map(|it| it.kind()).collect();
    let mut text = "[[threads]]\nname = \"fast\"\n[[threads]]\nname = \"slow\"\n".to_owned();
    for &kind in &kinds {
        let thread = if is_slow(kind) { "slow" } else { "fast" };
        text += &format!("[[pipelines]]\nkind = \"{kind}\"\nthread = \"{thread}\"\n");
    }
    (text, kinds.len())
}

/// Publishes `samples` samples of a steady train at once.
fn burst(publisher: &mut SamplePublisher, samples: u64) {
    for _ in 0..samples {
        let mut sample = TrainSample::empty(TRAIN).with(SampleField::Speed, 20.0);
        sample.time_ns = (publisher.sequence() as i64 + 1) * 1_000_000;
        publisher.publish(&mut sample).expect("a sample to be taken");
    }
}

fn accounted(it: &ParameterSnapshot) -> u64 {
    it.samples_used + it.samples_rejected + it.samples_lost
}

fn snapshots(reader: &mut SnapshotReader) -> Vec<ParameterSnapshot> {
    reader.poll();
    reader.readings(0).map(|reading| *reading.snapshot).collect()
}

/// Waits until `pipelines` pipelines account for this many samples each.
fn await_accounts(reader: &mut SnapshotReader, pipelines: usize, offered: u64, daemon: &Process) {
    let mut found = Vec::new();
    await_true(
        || {
            found = snapshots(reader).iter().map(accounted).collect::<Vec<_>>();
            found.len() == pipelines && found.iter().all(|&it| it == offered)
        },
        || format!("{offered} samples in each account; {}", daemon.errors()),
    );
}

#[test]
fn a_burst_to_a_fresh_daemon_is_counted_by_every_pipeline() {
    let site = DaemonSite::new();
    let (text, pipelines) = all_pipelines();
    let mut publisher = SamplePublisher::open(&site.host(), TRAIN).unwrap();
    // Samples that no daemon could see are in no account.
    burst(&mut publisher, 300);
    let daemon = daemon(&site, &text);
    burst(&mut publisher, 1_600);
    let mut reader = SnapshotReader::open(&site.host(), TRAIN).unwrap();
    await_accounts(&mut reader, pipelines, 1_600, &daemon);
}

#[test]
fn a_close_waits_until_every_pipeline_has_taken_what_is_on_its_way() {
    let site = DaemonSite::new();
    let mut daemon = daemon(&site, ECHO);
    let mut reader = SnapshotReader::open(&site.host(), TRAIN).unwrap();
    for round in 1..=5 {
        let mut publisher = SamplePublisher::open(&site.host(), TRAIN).unwrap();
        burst(&mut publisher, 400);
        assert_eq!(publisher.flush(Duration::from_secs(30)), 0, "{}", daemon.errors());
        drop(publisher);
        await_accounts(&mut reader, 1, 400 * round, &daemon);
        let it = snapshots(&mut reader)[0];
        assert_eq!(it.samples_lost, 0, "the buffer holds 512: {it:?}");
    }
    daemon.end(Signal::KILL);
    let mut publisher = SamplePublisher::open(&site.host(), TRAIN).unwrap();
    burst(&mut publisher, 7);
    assert_eq!(publisher.flush(Duration::from_secs(3_600)), 7, "the dead are not waited for");
}

#[test]
fn what_a_close_gives_up_is_counted_as_lost() {
    let site = DaemonSite::new();
    let daemon = daemon(&site, ECHO);
    let mut reader = SnapshotReader::open(&site.host(), TRAIN).unwrap();
    let mut offered = 0;
    for samples in [1_600, 3] {
        let mut publisher = SamplePublisher::open(&site.host(), TRAIN).unwrap();
        daemon.stop();
        burst(&mut publisher, samples);
        assert_eq!(publisher.flush(Duration::from_millis(1)), samples);
        drop(publisher);
        daemon.signal(Signal::CONT);
        offered += samples;
        await_accounts(&mut reader, 1, offered, &daemon);
    }
}

#[test]
fn a_controller_that_was_killed_leaves_no_sample_uncounted() {
    let site = DaemonSite::new();
    let daemon = daemon(&site, ECHO);
    let mut reader = SnapshotReader::open(&site.host(), TRAIN).unwrap();
    let count = SampleCount::open(&site.host(), TRAIN).unwrap();
    for round in 1..=3 {
        let controller = site.start(PEER, &["controller", "1", "100"]);
        let before = count.begun();
        await_true(|| count.begun() > before + 50, || controller.errors());
        if round == 2 {
            daemon.stop();
            await_true(|| count.begun() > before + 700, || controller.errors());
        }
        controller.kill();
        if round == 2 {
            daemon.signal(Signal::CONT);
        }
        await_accounts(&mut reader, 1, count.begun(), &daemon);
    }
}

/// Publishes at a rate until asked to stop.
fn publish_at(host: &Host, rate_hz: u64, stop: &AtomicBool) {
    let mut publisher = SamplePublisher::open(host, TRAIN).unwrap();
    let start = Instant::now();
    while !stop.load(Ordering::Relaxed) {
        let due = (start.elapsed().as_secs_f64() * rate_hz as f64) as u64;
        let missing = due.saturating_sub(publisher.published());
        burst(&mut publisher, missing);
        std::thread::sleep(Duration::from_micros(200));
    }
}

/// The number from which each pipeline of the newest daemon counts.
fn counted_from(it: &ParameterSnapshot) -> u64 {
    it.sample_sequence - accounted(it)
}

#[test]
fn a_restarted_daemon_counts_every_sample_from_the_one_it_could_have_seen() {
    let site = DaemonSite::new();
    let (text, pipelines) = all_pipelines();
    let count = SampleCount::open(&site.host(), TRAIN).unwrap();
    for rate_hz in [5_000, 20_000] {
        let stop = Arc::new(AtomicBool::new(false));
        let controller = {
            let (host, stop) = (site.host(), Arc::clone(&stop));
            std::thread::spawn(move || publish_at(&host, rate_hz, &stop))
        };
        let mut reader = SnapshotReader::open(&site.host(), TRAIN).unwrap();
        for _round in 0..2 {
            let before = count.sent();
            await_true(|| count.sent() > before, || "samples".into());
            let least = count.sent();
            let config = site.write_config(1, "", &text);
            let daemon = site.start(DYNOCAR, &["run", "--config", config.to_str().unwrap()]);
            let epoch = snapshots(&mut reader).iter().map(|it| it.epoch).max().unwrap_or(0);
            let mut of_daemon = || {
                let mut found = snapshots(&mut reader);
                found.retain(|it| it.epoch > epoch);
                found
            };
            await_true(|| of_daemon().len() == pipelines, || daemon.errors());
            // Every pipeline's first snapshot is there.
            let most = count.sent();
            let mut first = vec![None; pipelines];
            let mut looks = 0;
            await_true(
                || {
                    for it in of_daemon().iter().filter(|it| it.sample_sequence > 0) {
                        let from = counted_from(it);
                        let first = first[it.pipeline_index as usize].get_or_insert(from);
                        assert_eq!(*first, from, "{rate_hz} Hz: the account of {it:?}");
                        assert!((least..=most).contains(&from), "{least} to {most}: {it:?}");
                    }
                    looks += u32::from(first.iter().all(Option::is_some));
                    looks > 100
                },
                || format!("samples of all pipelines: {}", daemon.errors()),
            );
            daemon.kill();
        }
        stop.store(true, Ordering::Relaxed);
        controller.join().expect("the controller");
    }
}
