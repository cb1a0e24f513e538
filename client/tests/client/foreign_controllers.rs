//! C and C++ controllers in processes of their own; this process plays the daemon.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use dynocar_shared::services::ROOT_VARIABLE;
use dynocar_shared::{Parameter, SampleField, TrainSample};

use crate::support::{
    self, Link, PIPELINE_INDEX, PlayedDaemon, Program, TRAIN, client_directory, library_directory,
    snapshot_for,
};

fn foreign(file: &str) -> PathBuf {
    client_directory().join("tests/foreign").join(file)
}

fn example(file: &str) -> PathBuf {
    client_directory().join("examples").join(file)
}

/// Checks that a sample of the round-trip programs came through: its cycle determines every field.
fn assert_sample_came_through(sample: &TrainSample) {
    let cycle = (sample.sequence - 1) as f64;
    assert_eq!((sample.time_ns, sample.train_id), (1000 + cycle as i64, TRAIN.0));
    assert_eq!((sample.direction, sample.flags), (-1, 1));
    for (index, field) in SampleField::ALL.into_iter().enumerate() {
        assert_eq!(sample.get(field), Some(cycle + index as f64 + 0.5), "{field:?}");
    }
}

/// Plays the daemon until the controller starts a new run, then falls silent. Returns the output of the controller, by
/// the first word of each line.
fn serve(daemon: &PlayedDaemon, controller: Program) -> HashMap<String, String> {
    let mut first_run = None;
    let mut received = 0;
    let mut lines = HashMap::new();
    while let Some(line) = controller.next_line(|| {
        while let Some(sample) = daemon.next_sample() {
            assert_sample_came_through(&sample);
            received += 1;
            assert_eq!(sample.sequence, received);
            if *first_run.get_or_insert(sample.run) == sample.run {
                daemon.answer(&sample);
            }
        }
    }) {
        let (word, rest) = line.split_once(' ').unwrap();
        lines.insert(word.to_owned(), rest.to_owned());
    }
    controller.finish();
    lines
}

fn numbers(line: &str) -> Vec<f64> {
    line.split_whitespace().map(|number| number.parse().unwrap()).collect()
}

/// Checks the round trip and returns the output of the controller.
fn assert_round_trip(command: &mut Command, daemon: &PlayedDaemon) -> HashMap<String, String> {
    let lines = serve(daemon, Program::start(command.arg(daemon.root()).arg(TRAIN.to_string())));
    let line = |word: &str| lines.get(word).unwrap_or_else(|| panic!("no {word} in {lines:?}"));
    assert_eq!(line("matches"), "1");
    assert_eq!(line("daemon"), "1");
    assert_eq!(line("second"), "6");
    assert_eq!(line("same"), "1");
    assert_eq!(line("provided"), "1 14");
    assert_eq!(line("status"), "estimated none");
    assert_eq!(*line("pipeline"), format!("{PIPELINE_INDEX} resistance_kalman"));
    assert!(numbers(line("sample_sequence"))[0] >= 20.0);

    let mut sample = TrainSample::empty(TRAIN);
    sample.sequence = 20;
    let snapshot = snapshot_for(&sample);
    let estimate = snapshot.resistance_at(20.0).unwrap();
    let (force_n, force_std_n) = estimate.force_n(1e5);
    let expected = [estimate.w0_n_per_kn, estimate.w0_std_n_per_kn, force_n, force_std_n];
    assert_eq!(numbers(line("resistance")), expected);
    assert_eq!(line("extrapolated"), "0");
    let davis_b =
        [snapshot.value(Parameter::DavisB).unwrap(), snapshot.std(Parameter::DavisB).unwrap()];
    assert_eq!(numbers(line("davis_b")), davis_b);
    let places = [Parameter::DavisB, Parameter::DavisC].map(|it| snapshot.index_of(it).unwrap());
    assert_eq!(numbers(line("covariance")), [snapshot.covariance_at(places[0], places[1])]);
    assert_eq!(line("wheel_slide"), "4");
    assert_eq!(line("manoeuvres"), "1");
    assert_eq!(line("silent"), "invalid daemon_silent 0");
    assert_eq!(line("refused"), "0");
    assert_eq!(line("untaken"), "0");
    lines
}

/// Answers once the controller drives by its own parameters, falls silent once it drives by
/// ours, and expects it to go back. On a busy machine an answer may come so late that the
/// controller has gone back before.
fn assert_example_falls_back(command: &mut Command) {
    let daemon = PlayedDaemon::start();
    command.env(ROOT_VARIABLE, daemon.root()).args([TRAIN.to_string(), "6000".into()]);
    let controller = Program::start(command);
    let built_in = |reason| format!("the built-in parameters ({reason})");
    let (ours, silent) = ("the daemon (usable)".to_owned(), built_in("daemon_silent"));
    let mut is_answering = false;
    let mut origins = Vec::new();
    while !(origins.contains(&ours) && origins.last() == Some(&silent)) {
        let line = controller.next_line(|| {
            while let Some(sample) = daemon.next_sample() {
                if is_answering {
                    daemon.answer(&sample);
                }
            }
        });
        let line = line.unwrap_or_else(|| panic!("the controller ended after {origins:?}"));
        is_answering = line.contains("built-in");
        origins.push(line.split_once(" from ").unwrap().1.to_owned());
    }
    assert_eq!(origins[0], built_in("no_snapshot"));
    assert!(origins[1..].iter().all(|it| *it == ours || *it == silent), "{origins:?}");
}

fn c_program(source: &Path, link: Link, directory: &tempfile::TempDir) -> Command {
    let program = directory.path().join("program");
    support::build_c(source, "c99", link, &program);
    Command::new(program)
}

#[test]
fn a_c_controller_with_the_static_library_goes_the_whole_way() {
    let directory = tempfile::tempdir().unwrap();
    let mut command = c_program(&foreign("round_trip.c"), Link::Static, &directory);
    assert_round_trip(&mut command, &PlayedDaemon::start());
}

#[test]
fn a_c_controller_with_the_shared_library_goes_the_whole_way() {
    let directory = tempfile::tempdir().unwrap();
    let mut command = c_program(&foreign("round_trip.c"), Link::Shared, &directory);
    assert_round_trip(&mut command, &PlayedDaemon::start());
}

#[test]
fn a_cpp_controller_goes_the_whole_way() {
    let directory = tempfile::tempdir().unwrap();
    let program = directory.path().join("program");
    support::build_cpp(&foreign("round_trip.c"), "c++17", &program);
    assert_round_trip(&mut Command::new(program), &PlayedDaemon::start());
}

#[test]
fn a_controller_with_the_cpp_wrapper_goes_the_whole_way_allocates_nothing_and_is_moved() {
    let directory = tempfile::tempdir().unwrap();
    for standard in ["c++17", "c++20"] {
        let program = directory.path().join(standard);
        support::build_cpp(&foreign("round_trip.cpp"), standard, &program);
        let lines = assert_round_trip(&mut Command::new(program), &PlayedDaemon::start());
        let train = TRAIN.to_string();
        assert!(lines["words"].contains(&train), "{lines:?}");
        let mut sample = TrainSample::empty(TRAIN);
        sample.sequence = 20;
        let snapshot = snapshot_for(&sample);
        let [mass_t, std] = [snapshot.value(Parameter::Mass), snapshot.std(Parameter::Mass)];
        let (mass_t, half) = (mass_t.unwrap(), 1.96 * std.unwrap());
        assert_eq!(numbers(&lines["mass_t"]), [mass_t, mass_t - half, mass_t + half]);
        assert_eq!((&*lines["others"], &*lines["absent"]), ("0", "not_provided 0 0"));
        assert_eq!((&*lines["held_back"], &*lines["allocated"]), ("0", "0"));
        assert_eq!(lines["valid"], "1", "what is NaN is missing");
        // DYNOCAR_ERROR_NULL_ARGUMENT
        assert_eq!(lines["moved"], "1");
    }
}

#[test]
fn the_c_example_uses_the_daemon_and_falls_back() {
    let directory = tempfile::tempdir().unwrap();
    assert_example_falls_back(&mut c_program(&example("controller.c"), Link::Shared, &directory));
}

#[test]
fn the_cpp_example_uses_the_daemon_and_falls_back() {
    let directory = tempfile::tempdir().unwrap();
    let program = directory.path().join("program");
    support::build_cpp(&example("controller.cpp"), "c++17", &program);
    assert_example_falls_back(&mut Command::new(program));
}

#[test]
fn the_rust_example_uses_the_daemon_and_falls_back() {
    let program = library_directory().join("../examples/controller");
    assert!(program.exists(), "run all tests of the package: that builds the example");
    assert_example_falls_back(&mut Command::new(program));
}

/// With nobody on the channel both examples use their built-in values.
#[test]
fn the_stopping_examples_in_c_and_rust_say_the_same() {
    let directory = tempfile::tempdir().unwrap();
    let daemon = PlayedDaemon::start();
    let in_c = c_program(&example("stopping.c"), Link::Static, &directory);
    let in_rust = Command::new(library_directory().join("../examples/stopping"));
    let said = [in_c, in_rust].map(|mut program| {
        program.env(ROOT_VARIABLE, daemon.root()).args([TRAIN.to_string(), "40".into()]);
        support::must_succeed(&mut program)
    });
    assert_eq!(said[0], said[1]);
    let lines: Vec<&str> = said[0].lines().collect();
    let [resistance, _, _, stop] = lines[..] else { panic!("{}", said[0]) };
    assert_eq!(resistance, "resistance: the built-in values (no_snapshot)");
    let words: Vec<f64> = stop.split_whitespace().filter_map(|it| it.parse().ok()).collect();
    let [from_mps, distance_m, time_s, _, bound_m, bound_s] = words[..] else {
        panic!("{}", said[0]);
    };
    assert_eq!(from_mps, 40.0);
    assert!(distance_m > 500.0 && bound_m > distance_m && bound_s > time_s, "{}", said[0]);
}

/// With nobody on the channel both drive by their built-in values, and both come late: their train is
/// heavier than that.
#[test]
fn the_driver_examples_in_c_and_rust_drive_the_same() {
    let directory = tempfile::tempdir().unwrap();
    let root = directory.path().join("root");
    let in_c = c_program(&example("driver.c"), Link::Static, &directory);
    let in_rust = Command::new(library_directory().join("../examples/driver"));
    let said = [in_c, in_rust].map(|mut program| {
        program.env(ROOT_VARIABLE, &root).args([TRAIN.to_string(), "2".into()]);
        support::must_succeed(&mut program)
    });
    assert_eq!(said[0], said[1]);
    let lines: Vec<&str> = said[0].lines().collect();
    assert_eq!(lines.len(), 2, "{}", said[0]);
    for (line, leg) in lines.iter().zip(1..) {
        let late = line.strip_prefix(&format!("leg {leg}: +")).unwrap_or_else(|| panic!("{line}"));
        let late_s: f64 = late.split(' ').next().unwrap().parse().unwrap();
        assert!(late_s > 10.0 && line.ends_with("by the built-in parameters (1799 t)"), "{line}");
    }
}
