//! Recorded snapshots are computed again to the bit, and differences are found.

use std::path::PathBuf;

use crate::support::{samples, snapshots, write};
use dynocar_mcap::recording::Recording;
use dynocar_mcap::writing::{RecordingWriter, WallClock};
use dynocar_shared::{ParameterSnapshot, TrainSample};
use dynocar_workshop::verify::{ComparisonOutcome, Configurations, Verified, verify};

fn verified(samples: &[TrainSample], snapshots: &[ParameterSnapshot]) -> Vec<Verified> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    write(&path, samples, snapshots);
    let recording = Recording::load(&path).unwrap();
    verify(&recording, &Configurations::from_recording(&recording).unwrap())
}

#[test]
fn a_recording_from_the_daemons_start_on_is_the_same_to_the_bit() {
    let samples = samples();
    let answers = snapshots(&samples, 40);
    let verified = verified(&samples, &answers);
    assert_eq!(verified.len(), 3, "the shipped pipelines");
    for it in &verified {
        assert_eq!((it.same, &it.outcome), (it.recorded, &ComparisonOutcome::Same), "{}", it.name);
        assert!(it.recorded > 30, "{}: {} snapshots", it.name, it.recorded);
    }
}

#[test]
fn the_files_of_a_recording_that_rotated_are_verified_as_one_and_only_in_their_order() {
    // One run, for the clock of a dataset begins anew with each.
    let (samples, folder) = (samples()[..700].to_vec(), tempfile::tempdir().unwrap());
    let answers = snapshots(&samples, 20);
    let files: Vec<PathBuf> =
        (1..=3).map(|it| folder.path().join(format!("run-00000{it}.mcap"))).collect();
    // Each file has the configuration attached, and its share of the messages.
    for (index, file) in files.iter().enumerate() {
        let share = &samples[index * samples.len() / 3..(index + 1) * samples.len() / 3];
        let newest = |it: &&ParameterSnapshot| {
            share.iter().any(|sample| sample.sequence == it.sample_sequence)
        };
        let answers: Vec<ParameterSnapshot> = answers.iter().filter(newest).copied().collect();
        write(file, share, &answers);
    }
    let whole = Recording::load_all(&files).unwrap();
    assert_eq!((whole.samples.len(), whole.attachments.len()), (samples.len(), 3));
    for it in verify(&whole, &Configurations::from_recording(&whole).unwrap()) {
        assert_eq!((it.same, &it.outcome), (it.recorded, &ComparisonOutcome::Same), "{}", it.name);
        assert!(it.recorded > 30, "{}: {} snapshots", it.name, it.recorded);
    }
    let last = Recording::load(&files[2]).unwrap();
    let late = verify(&last, &Configurations::from_recording(&last).unwrap());
    assert!(late.iter().all(|it| matches!(it.outcome, ComparisonOutcome::BeginsLate { .. })));

    let error = Recording::load_all(&[files[1].clone(), files[0].clone()]).unwrap_err().to_string();
    assert!(
        error.contains("run-000001.mcap: begins before ") && error.contains("in the order"),
        "{error}"
    );
    let other = folder.path().join("other.mcap");
    let mut writer = RecordingWriter::new(
        std::fs::File::create_new(&other).unwrap(),
        WallClock::of_another_host(),
    )
    .unwrap();
    writer.attach("configuration-1/daemon.toml", b"[daemon]\n", 0).unwrap();
    writer.finish().unwrap();
    let error = Recording::load_all(&[files[2].clone(), other]).unwrap_err().to_string();
    assert!(
        error.contains("other.mcap: configuration-1/daemon.toml is another than in"),
        "{error}"
    );
}

#[test]
fn one_bit_that_is_another_is_found_with_field_and_sample() {
    let samples = samples();
    let mut answers = snapshots(&samples, 40);
    let index = answers.iter().position(|it| it.pipeline_index == 1 && it.sequence > 400).unwrap();
    let tampered = &mut answers[index];
    tampered.covariance[2] = f64::from_bits(tampered.covariance[2].to_bits() ^ 1);
    let sample = tampered.sample_sequence;
    let verified = verified(&samples, &answers);
    match &verified[1].outcome {
        ComparisonOutcome::Differs(found) => {
            assert_eq!((found.field, found.sample), ("covariance", sample), "{found:?}");
            assert!(verified[1].same < verified[1].recorded);
        }
        other => panic!("expected a difference, found {other:?}"),
    }
    for index in [0, 2] {
        assert_eq!(verified[index].outcome, ComparisonOutcome::Same);
    }
}

#[test]
fn a_sample_that_is_another_is_found() {
    let mut samples = samples();
    let answers = snapshots(&samples, 40);
    let changed = samples.iter().position(|it| it.speed_mps > 5.0).unwrap();
    samples[changed].speed_mps += 0.01;
    for it in verified(&samples, &answers).iter().filter(|it| it.name == "train_kalman") {
        let ComparisonOutcome::Differs(found) = &it.outcome else { panic!("{:?}", it.outcome) };
        assert!(found.sample >= samples[changed].sequence, "{found:?}");
    }
}

#[test]
fn a_recording_that_begins_later_says_so_and_one_that_lacks_samples_says_up_to_where() {
    let samples = samples();
    let answers = snapshots(&samples, 40);
    let late: Vec<_> = answers.iter().filter(|it| it.sequence > 300).copied().collect();
    for it in verified(&samples[250..], &late) {
        assert_eq!(it.outcome, ComparisonOutcome::BeginsLate { before: 250 }, "{}", it.name);
    }
    let gap: Vec<_> =
        samples.iter().enumerate().filter(|it| it.0 < 500 || it.0 > 520).map(|it| *it.1).collect();
    for it in verified(&gap, &answers) {
        let is_reported = matches!(
            it.outcome,
            ComparisonOutcome::OtherSamples { agree_up_to, .. } if (480..=620).contains(&agree_up_to)
        );
        assert!(
            is_reported || matches!(it.outcome, ComparisonOutcome::Differs(_)),
            "{}: {:?}",
            it.name,
            it.outcome
        );
        assert!(it.same > 0 && it.same < it.recorded, "{}: {}", it.name, it.same);
    }
}

#[test]
fn samples_lost_on_the_way_to_the_daemon_alone_are_no_wrong_bits() {
    // The recorder began before the daemon: those samples are nobody's.
    let samples = samples();
    let answers = snapshots(&samples[100..], 40);
    for it in verified(&samples, &answers) {
        assert_eq!(it.outcome, ComparisonOutcome::Same, "{}", it.name);
    }
}
