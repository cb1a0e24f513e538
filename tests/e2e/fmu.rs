//! The FMU: its numbers are those of `dynocar identify`, its refusals are in words, and the command packs all files
//! that a simulator needs.

use std::fs::{read, read_to_string, write};
use std::path::{Path, PathBuf};

use dynocar::dataset;
use dynocar_analysis::dataset::Dataset;
use dynocar_analysis::identify::{identify, published_samples};
use dynocar_estimators::EstimatorSettings;
use dynocar_fmu::estimators::PIPELINES;
use dynocar_fmu::ffi::instance::CO_SIMULATION;
use dynocar_fmu::ffi::{
    Status, fmi2CancelStep, fmi2EnterInitializationMode, fmi2ExitInitializationMode, fmi2GetReal,
    fmi2Reset, fmi2SetReal, fmi2SetupExperiment, fmi2Terminate,
};
use dynocar_fmu::variables::{Kind, Meaning, SnapshotField};
use dynocar_fmu::{ESTIMATORS, INTERFACES};
use dynocar_shared::{ParameterSnapshot, PipelineKind, TrainId};
use dynocar_tests::process::DaemonSite;

#[path = "fmu/plant.rs"]
mod plant;
#[path = "fmu/simulator.rs"]
mod simulator;
use crate::commands::{done, dynocar, said};
use simulator::{Fmu, reference};

/// The demo's train has no brake gear; with one, every estimator has something to learn.
const BRAKE_GEAR: &str = "\ncylinder_diameter_mm = 203\ndisc_radius_mm = 297.6\n\
    wheel_radius_mm = 460\nefficiency = 0.85\nratio = 2.55\nfriction = 0.28\npads = 95\n";

/// The demo's dataset.
fn demo() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/demo")
}

/// A copy of the demo's dataset with a brake gear.
fn demo_with_brake_gear(site: &DaemonSite) -> PathBuf {
    let folder = site.path().join("demo data #1");
    std::fs::create_dir_all(folder.join("runs")).unwrap();
    let runs = ["01", "02", "03", "06"].map(|number| format!("runs/{number}.csv"));
    for file in
        ["dataset.toml", "track.toml"].iter().copied().chain(runs.iter().map(String::as_str))
    {
        std::fs::copy(demo().join(file), folder.join(file)).unwrap();
    }
    let train = read_to_string(demo().join("train.toml")).unwrap();
    write(folder.join("train.toml"), train.trim_end().to_owned() + BRAKE_GEAR).unwrap();
    folder
}

/// A variable's bits as `identify` would print them.
fn expected(snapshot: &ParameterSnapshot, reported: SnapshotField, speed_mps: f64) -> u64 {
    let resistance = snapshot.resistance_at(speed_mps);
    let real = |value: Option<f64>| value.unwrap_or(f64::NAN).to_bits();
    match reported {
        SnapshotField::Value(parameter) => real(snapshot.value(parameter)),
        SnapshotField::Std(parameter) => real(snapshot.std(parameter)),
        SnapshotField::Resistance => real(resistance.map(|it| it.w0_n_per_kn)),
        SnapshotField::ResistanceStd => real(resistance.map(|it| it.w0_std_n_per_kn)),
        SnapshotField::UnexplainedForce => snapshot.unexplained_force_n.to_bits(),
        SnapshotField::UnexplainedForceStd => snapshot.unexplained_force_std_n.to_bits(),
        SnapshotField::SuspectedEffect | SnapshotField::SuspectedEffectNumber => {
            snapshot.suspected_effect.into()
        }
        SnapshotField::Status | SnapshotField::StatusNumber => snapshot.status.into(),
        SnapshotField::Reason | SnapshotField::ReasonNumber => snapshot.reason.into(),
        SnapshotField::Usable(quantity) => {
            (snapshot.usable_quantities & quantity.bit() != 0).into()
        }
        SnapshotField::Rejected => snapshot.samples_rejected,
    }
}

/// Compares every output with the pipelines after the first samples.
fn assert_as_identified(fmu: &Fmu, dataset: &Dataset, count: usize) {
    let samples = &published_samples(dataset, TrainId(1))[..count];
    let speed_mps = samples[count - 1].speed_mps;
    let identified = |kind: PipelineKind| {
        *identify(dataset, samples, &EstimatorSettings::default_of(kind).unwrap())
            .unwrap()
            .snapshot()
    };
    let snapshots = PIPELINES.map(identified);
    for (reference, variable) in ESTIMATORS.variables.iter().enumerate() {
        let Meaning::Estimate(of, reported) = variable.meaning else { continue };
        let reference = reference as u32;
        let snapshot = &snapshots[PIPELINES.iter().position(|&kind| kind == of).unwrap()];
        let got = match variable.meaning.kind() {
            Kind::Real => fmu.real(reference).unwrap().to_bits(),
            Kind::Boolean => u64::from(fmu.boolean(reference).unwrap()),
            _ => fmu.integer(reference).unwrap() as u64,
        };
        let name = variable.name;
        assert_eq!(got, expected(snapshot, reported, speed_mps), "{name} after {count} samples");
    }
}

/// Sets the inputs of one row and steps.
fn take_row(fmu: &Fmu, header: &[&str], (row, next): (&str, Option<&&str>)) {
    let cells: Vec<f64> = row.split(',').map(|cell| cell.parse().unwrap()).collect();
    for (name, &cell) in header.iter().zip(&cells).skip(1) {
        let reference = reference(name);
        let went = match ESTIMATORS.variables[reference as usize].meaning.kind() {
            Kind::Boolean => fmu.set_boolean(reference, cell as i32),
            Kind::Integer => fmu.set_integer(reference, cell as i32),
            _ => fmu.set_real(reference, cell),
        };
        assert_eq!(went, Status::Ok, "{name} = {cell}: {}", fmu.said());
    }
    let time_s = |row: &str| row.split(',').next().unwrap().parse::<f64>().unwrap();
    let step_s = next.map_or(0.1, |next| time_s(next) - cells[0]);
    assert_eq!(fmu.step_for(cells[0], step_s), Status::Ok, "{}", fmu.said());
}

#[test]
fn every_output_has_the_bits_of_the_pipelines_at_every_moment_looked_at() {
    let site = DaemonSite::new();
    let folder = demo_with_brake_gear(&site);
    let folder_name = folder.to_str().unwrap();
    done(&site, &["fmu", "-o", "a.fmu", "--dataset", folder_name, "--inputs", "inputs"]);
    let resources = unpacked(&site, "a.fmu").join("resources");
    let location = format!("file://{}", resources.display());
    let dataset = dataset::load(&folder).unwrap();
    let fmu = Fmu::new(&location);
    fmu.initialize();
    let mut count = 0;
    for run in 1..=dataset.runs.len() {
        let name = format!("inputs/run_{run:02}.csv");
        let text = read_to_string(site.path().join(name)).unwrap();
        assert!(text.starts_with(dynocar_workshop::cli::fmu::INPUTS_MARK));
        let mut lines = text.lines();
        let header: Vec<&str> = lines.next().unwrap().split(',').collect();
        let rows: Vec<&str> = lines.collect();
        for (index, row) in rows.iter().enumerate() {
            take_row(&fmu, &header, (row, rows.get(index + 1)));
            count += 1;
            if [1, 300, 2_000, 4_900, 11_111].contains(&count) {
                assert_as_identified(&fmu, &dataset, count);
            }
        }
    }
    assert_eq!(count, dataset.runs.iter().map(|run| run.samples.len()).sum::<usize>());
    assert_as_identified(&fmu, &dataset, count);
    let status = |name: &str| fmu.integer(reference(name)).unwrap();
    assert_eq!((status("resistance.status"), status("mass.status")), (2, 2), "both are estimated");
}

/// Unpacks an FMU into a folder next to it, as a simulator does.
fn unpacked(site: &DaemonSite, fmu: &str) -> PathBuf {
    let folder = site.path().join("unpacked #1");
    let file = std::fs::File::open(site.path().join(fmu)).unwrap();
    zip::ZipArchive::new(file).unwrap().extract(&folder).unwrap();
    folder
}

#[test]
fn the_fmu_holds_what_the_standard_asks_for_and_is_the_same_twice() {
    let site = DaemonSite::new();
    let file = |name: &str| demo().join(name).display().to_string();
    let (train, track) = (file("train.toml"), file("track.toml"));
    for out in ["a.fmu", "b.fmu"] {
        done(&site, &["fmu", "--out", out, "--train", &train, "--track", &track]);
    }
    let bytes = |name: &str| read(site.path().join(name)).unwrap();
    assert!(bytes("a.fmu") == bytes("b.fmu"), "nothing in it depends on the hour");
    let folder = unpacked(&site, "a.fmu");
    let description = read_to_string(folder.join("modelDescription.xml")).unwrap();
    assert_eq!(
        description,
        dynocar_fmu::model_description(&ESTIMATORS, dynocar_fmu::STEP_DEFAULT_S)
    );
    let platform = if cfg!(target_arch = "x86_64") { "linux64" } else { "aarch64-linux" };
    let library = read(folder.join(format!("binaries/{platform}/dynocar.so"))).unwrap();
    assert!(library.starts_with(b"\x7fELF"));
    for name in ["train.toml", "track.toml"] {
        let packed = read_to_string(folder.join("resources").join(name)).unwrap();
        assert_eq!(packed, read_to_string(file(name)).unwrap());
    }
    assert!(folder.join("documentation/index.html").is_file());
}

#[test]
fn calls_in_the_wrong_order_or_of_nonsense_are_refused_in_words() {
    let fmu = Fmu::new("file:///nowhere");
    let refused = |went: Status, words: &str| {
        assert_eq!(went, Status::Error, "expected: {words}");
        let said = fmu.said();
        assert!(said.contains(words), "{said:?} lacks {words:?}");
    };
    let component = fmu.component;
    refused(fmu.step(0.0), "fmi2DoStep is not allowed before initialization");
    // SAFETY: the component lives; the NULL array is the tested input.
    unsafe {
        refused(fmi2Terminate(component), "fmi2Terminate is not allowed before initialization");
        refused(fmi2ExitInitializationMode(component), "not allowed before initialization");
        refused(fmi2EnterInitializationMode(component), "/nowhere/train.toml: no such file");
        refused(fmi2CancelStep(component), "fmi2CancelStep is not supported");
        let null = (std::ptr::null(), std::ptr::null());
        refused(fmi2SetReal(component, null.0, 1, null.1), "value references is NULL");
        refused(fmi2SetReal(component, &3, 1, null.1), "the array of values is NULL");
        refused(fmi2GetReal(component, &3, 1, std::ptr::null_mut()), "the array of values is NULL");
        assert_eq!(fmi2SetReal(component, null.0, 0, null.1), Status::Ok, "nothing to set");
        assert_eq!(fmi2Terminate(std::ptr::null_mut()), Status::Error, "no component");
    }
    refused(fmu.set_real(999, 0.0), "no variable has the value reference 999");
    refused(fmu.set_real(reference("run"), 1.0), "run is of type Integer, not Real");
    refused(fmu.set_real(reference("resistance.a"), 1.0), "resistance.a is an output");
    refused(fmu.set_integer(reference("run"), -1), "run = -1: expected 0 or more");
    refused(fmu.set_string(reference("train_file"), c"\xff"), "train_file is no text in UTF-8");
    let wrong = c"/nowhere/100%#1.toml";
    assert_eq!(fmu.set_string(reference("train_file"), wrong), Status::Ok);
    // SAFETY: the component lives.
    refused(
        unsafe { fmi2EnterInitializationMode(component) },
        "/nowhere/100%%##1.toml: cannot be read",
    );
}

#[test]
fn an_instance_that_was_refused_something_goes_on_and_begins_anew() {
    let fmu = Fmu::new(demo().to_str().unwrap());
    fmu.initialize();
    for time_s in [f64::NAN, f64::INFINITY, 1e300] {
        assert_eq!(fmu.step(time_s), Status::Error);
        assert!(fmu.said().starts_with("currentCommunicationPoint = "));
    }
    assert_eq!(fmu.set_string(reference("track_file"), c"other.toml"), Status::Error);
    assert!(fmu.said().contains("not allowed between steps"));
    let (speed, rejected) = (reference("speed_mps"), reference("mass.rejected"));
    for (value, count) in [(f64::NAN, 1), (f64::INFINITY, 2), (1e30, 3)] {
        assert_eq!(fmu.set_real(speed, value), Status::Ok);
        let time_s = f64::from(count - 1);
        assert_eq!(fmu.step_for(time_s, 1.0), Status::Ok, "{}", fmu.said());
        for elsewhere_s in [time_s, time_s - 5.0, time_s + 1000.0] {
            assert_eq!(fmu.step_for(elsewhere_s, 1.0), Status::Error, "{elsewhere_s}");
            assert!(fmu.said().contains("the end of the step before"), "{}", fmu.said());
        }
        assert_eq!(fmu.integer(rejected), Some(count), "after a speed of {value}");
    }
    let a = fmu.real(reference("resistance.a"));
    assert!(a.is_some_and(f64::is_finite), "the declared one until there is another: {a:?}");
    // SAFETY: the component lives.
    unsafe {
        assert_eq!(fmi2SetupExperiment(fmu.component, 0, 0.0, 0.0, 0, 0.0), Status::Error);
        assert_eq!(fmi2Terminate(fmu.component), Status::Ok);
        assert_eq!(fmu.integer(rejected), Some(3), "the results can still be got");
        assert_eq!(fmu.set_real(speed, 1.0), Status::Error);
        assert_eq!(fmi2Reset(fmu.component), Status::Ok);
    }
    fmu.initialize();
    assert_eq!(fmu.integer(rejected), Some(0));
}

#[test]
fn another_kind_or_another_release_of_an_fmu_is_refused_in_words() {
    let refusal = |kind, guid: &str| {
        let fmu = Fmu::instantiate(kind, guid, "");
        assert!(fmu.component.is_null());
        fmu.said()
    };
    assert_eq!(refusal(0, ESTIMATORS.guid), "this FMU is for co-simulation only");
    let [one, other] = INTERFACES.map(|model| model.guid);
    let words = format!("modelDescription.xml is of 1234, the library of {one} and {other}");
    assert_eq!(refusal(CO_SIMULATION, "1234"), words);
}

#[test]
fn a_library_that_is_not_there_or_another_is_refused_in_words() {
    let site = DaemonSite::new();
    site.write("other.so", "\x7fELF and nothing else");
    let refusal = |library: &str, words: &str| {
        let output = dynocar(&site, &["fmu", "-o", "a.fmu", "--library", library]);
        assert_eq!(output.status.code(), Some(2), "{}", said(&output));
        assert!(said(&output).contains(words), "{}", said(&output));
        assert!(!site.path().join("a.fmu").exists());
    };
    refusal("nowhere.so", "nowhere.so: cannot be read: No such file");
    refusal("other.so", "other.so: expected the libdynocar_fmu.so of this release");
    let error = dynocar_workshop::cli::fmu::find_library(Path::new("/nowhere/dynocar"))
        .unwrap_err()
        .to_string();
    assert!(error.starts_with("no libdynocar_fmu.so of this release in /nowhere/deps"), "{error}");
    assert!(error.contains("`cargo build --release -p dynocar-fmu`"), "{error}");
}

#[test]
fn files_that_are_wrong_or_would_be_lost_are_refused_before_anything_is_written() {
    let site = DaemonSite::new();
    site.write("train.toml", "[train]\nmass_t = -1\n");
    let refusal = |arguments: &[&str], words: &str| {
        let output = dynocar(&site, arguments);
        assert_eq!(output.status.code(), Some(2), "{}", said(&output));
        assert!(said(&output).contains(words), "{}", said(&output));
        assert!(!site.path().join("a.fmu").exists());
    };
    refusal(&["fmu", "-o", "a.fmu", "--train", "train.toml"], "train.mass_t = -1: expected");
    refusal(&["fmu", "-o", "train.toml"], "train.toml: exists and is none of");
    refusal(&["fmu", "-o", "a.fmu", "--dataset", "nowhere"], "nowhere: no such file or folder");
    std::fs::create_dir(site.path().join("runs")).unwrap();
    site.write("runs/run_02.csv", "t,v\n0,1\n");
    refusal(
        &["fmu", "-o", "a.fmu", "--dataset", demo().to_str().unwrap(), "--inputs", "runs"],
        "runs/run_02.csv: exists and is none of",
    );
    assert!(!site.path().join("runs/run_01.csv").exists());
}
