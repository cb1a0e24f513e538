//! Broken and foreign files, and files of another schema, are named; their readable part is read.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::support::{samples, snapshots, write};
use dynocar_mcap::copying::recover;
use dynocar_mcap::reading::{FileEnding, read};
use dynocar_mcap::recording::Recording;
use dynocar_shared::TrainSample;
use proptest::prelude::*;

fn program(arguments: &[&str]) -> Output {
    let program = env!("CARGO_BIN_EXE_dynocar-recording");
    Command::new(program).args(arguments).output().expect("the program")
}

/// Returns the program's message about a wrong file, which has to be named.
fn refusal(path: &Path) -> String {
    let out = path.with_extension("out");
    let shown = path.to_str().unwrap();
    let mut printed = String::new();
    for arguments in
        [["convert", shown, "-o", out.to_str().unwrap()].as_slice(), ["verify", shown].as_slice()]
    {
        let failure = dynocar_workshop::cli::execute(arguments.iter().copied()).unwrap_err();
        let answer = failure.answer().expect("a failure in words");
        printed = answer.message;
        assert_eq!(answer.exit_status, 2, "{arguments:?}: {printed}");
        assert!(printed.starts_with(&format!("{shown}: ")), "{printed}");
        assert!(!out.exists(), "nothing is left of {arguments:?}");
    }
    printed
}

fn recording(folder: &Path) -> PathBuf {
    let path = folder.join("run.mcap");
    let samples = &samples()[..600];
    write(&path, samples, &snapshots(samples, 100));
    path
}

#[test]
fn a_file_of_another_format_and_one_that_is_not_there_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let cases: [(&str, Option<&[u8]>, &str); 4] = [
        ("text.mcap", Some(b"time_s,speed_mps\n0,1\n"), "not an MCAP file"),
        ("empty.mcap", Some(b""), "not an MCAP file"),
        ("short.mcap", Some(b"\x89MC"), "not an MCAP file"),
        ("gone.mcap", None, "No such file"),
    ];
    for (name, content, expected) in cases {
        let path = folder.path().join(name);
        if let Some(content) = content {
            std::fs::write(&path, content).unwrap();
        }
        let printed = refusal(&path);
        assert!(printed.contains(expected), "{printed}");
    }
}

/// An MCAP file of somebody else's writer.
fn foreign(path: &Path, schema: &str, metadata: &BTreeMap<String, String>) {
    let mut writer = mcap::Writer::new(std::fs::File::create_new(path).unwrap()).unwrap();
    let schema = writer.add_schema(schema, "protobuf", b"").unwrap();
    let channel = writer.add_channel(schema, "/camera", "protobuf", metadata).unwrap();
    let header = mcap::records::MessageHeader {
        channel_id: channel,
        sequence: 1,
        log_time: 1,
        publish_time: 1,
    };
    writer.write_to_known_channel(&header, &[8, 1]).unwrap();
    writer.finish().unwrap();
}

#[test]
fn a_foreign_file_and_one_of_another_schema_are_named_with_what_was_expected() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("foreign.mcap");
    foreign(&path, "foxglove.Image", &BTreeMap::new());
    let printed = refusal(&path);
    assert!(printed.contains("no samples: expected a channel of dynocar.TrainSample"), "{printed}");
    assert!(printed.contains("found /camera"), "{printed}");
    let path = folder.path().join("newer.mcap");
    let layout = [("layout".to_owned(), "dynocar.TrainSample.0123456789abcdef".to_owned())];
    foreign(&path, "dynocar.TrainSample", &layout.into());
    let printed = refusal(&path);
    assert!(printed.contains(TrainSample::WIRE_NAME), "{printed}");
    assert!(printed.contains("found dynocar.TrainSample.0123456789abcdef"), "{printed}");
}

#[test]
fn a_file_cut_anywhere_is_read_up_to_there_and_made_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = recording(folder.path());
    let whole = Recording::load(&path).unwrap();
    assert_eq!(whole.broken, None);
    let bytes = std::fs::read(&path).unwrap();
    let mut counts = Vec::new();
    for share in [20, 40, 60, 80, 99] {
        let cut = folder.path().join(format!("cut-{share}.mcap"));
        std::fs::write(&cut, &bytes[..bytes.len() * share / 100]).unwrap();
        let mut left = Recording::default();
        let ending = read(&cut, &mut left).unwrap();
        assert!(matches!(ending, FileEnding::Broken { .. }), "{share} %: {ending:?}");
        assert_eq!(left.samples, whole.samples[..left.samples.len()]);
        counts.push(left.samples.len());
        let mended = folder.path().join(format!("whole-{share}.mcap"));
        recover(std::slice::from_ref(&cut), &mended).unwrap();
        let mut again = Recording::default();
        assert_eq!(read(&mended, &mut again).unwrap(), FileEnding::Whole);
        assert_eq!(again.samples, left.samples);
        assert_eq!(again.snapshots, left.snapshots);
        assert_eq!(again.attachments, left.attachments);
    }
    assert!(counts.is_sorted() && counts[0] < counts[4], "{counts:?}");
    let output = program(&["recover", path.to_str().unwrap(), "-o", path.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(2), "its input is never overwritten");
    assert_eq!(std::fs::read(&path).unwrap(), bytes);
}

#[test]
fn a_recording_becomes_a_dataset_and_the_same_samples_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = recording(folder.path());
    let at = |name: &str| folder.path().join(name);
    let convert = |from: &Path, to: &Path| {
        let words = ["convert", from.to_str().unwrap(), "-o", to.to_str().unwrap()];
        dynocar_workshop::cli::execute(words).unwrap();
    };
    convert(&path, &at("dataset"));
    let dataset = dynocar::dataset::load(&at("dataset")).unwrap();
    assert_eq!(dataset.runs.iter().map(|it| it.samples.len()).sum::<usize>(), 600);
    assert_eq!(dynocar_workshop::dataset::load(&path).unwrap().runs, dataset.runs);
    convert(&at("dataset"), &at("again.mcap"));
    let (one, two) = (Recording::load(&path).unwrap(), Recording::load(&at("again.mcap")).unwrap());
    assert_eq!(one.samples, two.samples);
    // A dataset that was no recording comes back file by file.
    convert(&crate::support::config_folder().join("demo"), &at("demo.mcap"));
    let demo = dynocar::dataset::load(&crate::support::config_folder().join("demo")).unwrap();
    assert_eq!(dynocar_workshop::dataset::load(&at("demo.mcap")).unwrap(), demo);
    convert(&at("demo.mcap"), &at("demo"));
    for file in ["dataset.toml", "train.toml", "track.toml", "runs/01.csv", "runs/06.csv"] {
        let original =
            std::fs::read(crate::support::config_folder().join("demo").join(file)).unwrap();
        assert!(std::fs::read(at("demo").join(file)).unwrap() == original, "{file}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]
    #[test]
    fn damaged_bytes_make_no_reader_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        thread_local! {
            static WHOLE: Vec<u8> = {
                let folder = tempfile::tempdir().unwrap();
                let path = folder.path().join("run.mcap");
                write(&path, &samples()[..40], &snapshots(&samples()[..40], 20));
                std::fs::read(path).unwrap()
            };
        }
        let mut bytes = WHOLE.with(Clone::clone);
        for (place, byte) in changes {
            let place = place.index(bytes.len());
            bytes[place] = byte;
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("damaged.mcap");
        std::fs::write(&path, &bytes).unwrap();
        let _ = read(&path, &mut ());
        let _ = Recording::load(&path);
    }
}
