//! The simulator's files are reproducible and complete, and do not reveal the truth.

use dynocar_core::pipeline::admission::Admission;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{SampleField, TrainSample};
use dynocar_tests::simulator::dataset_writer::{dataset_files, write_dataset, write_truth};
use dynocar_tests::simulator::sensors::SIMULATED_TRAIN;
use dynocar_tests::simulator::{
    Defects, EffectRequest, SimulatedDataset, SimulatorSettings, TrainType, simulate,
};

fn short(seed: u64, kinds: &[EffectKind]) -> SimulatorSettings {
    SimulatorSettings {
        runs: 3,
        holdout_runs: 1,
        duration_s: 240.0,
        ..SimulatorSettings::new(seed, EffectRequest::Kinds(kinds.to_vec()))
    }
}

fn text_of(dataset: &SimulatedDataset, path: &str) -> String {
    let files = dataset_files(dataset);
    files.into_iter().find(|file| file.0 == path).expect("the file is written").1
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_seed_others() {
    let settings = |seed| SimulatorSettings {
        defects: Defects::ALL,
        ..short(seed, &[EffectKind::Wind, EffectKind::LowAdhesion])
    };
    let first = simulate(&settings(5));
    assert_eq!(dataset_files(&first), dataset_files(&simulate(&settings(5))));
    assert_eq!(first.truth_json().to_string(), simulate(&settings(5)).truth_json().to_string());
    assert_ne!(dataset_files(&first), dataset_files(&simulate(&settings(6))));
}

/// A mapped column of a line such as `speed = { column = "v", unit = "km/h" }`.
struct MappedColumn {
    column: String,
    unit: String,
    scale: f64,
}

/// Returns the column of a canonical quantity.
fn column(dataset_toml: &str, canonical: &str) -> Option<MappedColumn> {
    let line = dataset_toml.lines().find(|line| line.starts_with(&format!("{canonical} = {{")))?;
    let quoted: Vec<&str> = line.split('"').collect();
    let scale = line.split("scale = ").nth(1).map(|rest| rest.trim_end_matches(" }"));
    let scale = scale.map_or(1.0, |text| text.parse().unwrap());
    Some(MappedColumn { column: quoted[1].into(), unit: quoted[3].into(), scale })
}

/// SI value of a cell; `None` when it is empty.
fn si(cell: &str, MappedColumn { unit, scale, .. }: &MappedColumn) -> Option<f64> {
    let value = cell.parse::<f64>().ok()? * scale;
    Some(match unit.as_str() {
        "s" | "m" | "m/s" | "N" | "Pa" | "degC" | "1" => value,
        "ms" => value * 1e-3,
        "km" | "kN" | "kPa" => value * 1e3,
        "km/h" => value / 3.6,
        "mph" => value * 0.44704,
        "bar" => value * 1e5,
        "K" => value - 273.15,
        "degF" => (value - 32.0) / 1.8,
        unit => panic!("unexpected unit {unit}"),
    })
}

/// Compares one quantity of every row of a run's file with the samples.
fn assert_column(
    dataset: &SimulatedDataset,
    canonical: &str,
    expected: impl Fn(&TrainSample) -> Option<f64>,
    tolerance: f64,
) {
    let toml = text_of(dataset, "dataset.toml");
    let Some(column) = column(&toml, canonical) else { return };
    let delimiter = if toml.contains("delimiter = \";\"") { ';' } else { ',' };
    let run = &dataset.runs[1];
    let csv = text_of(dataset, &run.plan.file());
    let mut lines = csv.lines();
    let index =
        lines.next().unwrap().split(delimiter).position(|name| name == column.column).unwrap();
    assert_eq!(csv.lines().count(), run.samples.len() + 1);
    for (line, sample) in lines.zip(&run.samples) {
        let cell = line.split(delimiter).nth(index).unwrap();
        match (si(cell, &column), expected(sample)) {
            (Some(read), Some(value)) => {
                let seed = dataset.settings.seed;
                assert!((read - value).abs() <= tolerance, "{seed} {canonical}: {read} {value}");
            }
            (read, value) => assert_eq!((read, cell), (value, ""), "{canonical}"),
        }
    }
}

#[test]
fn files_in_any_units_say_what_the_samples_say() {
    let mut seen = std::collections::BTreeSet::new();
    for seed in 0..12 {
        let dataset = simulate(&SimulatorSettings {
            time_offset_s: 1000.0 * seed as f64,
            defects: Defects { missing_cells: 0.02, ..Defects::NONE },
            ..short(seed, &[])
        });
        let toml = text_of(&dataset, "dataset.toml");
        let is_head = toml.contains("position_reference = \"head\"");
        let run = &dataset.runs[1];
        let head_m = 0.5 * dataset.declared_train().length_m * run.plan.direction;
        let ahead_m = if is_head { head_m } else { 0.0 };
        let of = |field| move |sample: &TrainSample| sample.get(field);
        assert_column(&dataset, "time", |sample| Some(sample.time_ns as f64 * 1e-9), 1e-6);
        let position = |sample: &TrainSample| Some(sample.get(SampleField::Position)? + ahead_m);
        assert_column(&dataset, "position", position, 0.06);
        assert_column(&dataset, "speed", of(SampleField::Speed), 0.0051);
        assert_column(&dataset, "traction_force", of(SampleField::TractionForce), 5.1);
        assert_column(&dataset, "brake_force", of(SampleField::BrakeForce), 5.1);
        let control = |sample: &TrainSample| {
            Some(sample.get(SampleField::TractionForce)? - sample.get(SampleField::BrakeForce)?)
        };
        assert_column(&dataset, "control_force", control, 5.1);
        let pressure = of(SampleField::BrakeCylinderPressure);
        assert_column(&dataset, "brake_cylinder_pressure", pressure, 51.0);
        let temperature = of(SampleField::AmbientTemperature);
        assert_column(&dataset, "ambient_temperature", temperature, 0.051);
        seen.extend(toml.lines().filter(|line| line.contains("unit = ")).map(String::from));
    }
    assert!(seen.len() > 30, "names and units vary, {} lines differ", seen.len());
}

#[test]
fn declared_files_are_the_same_with_and_without_the_effect() {
    for kind in [EffectKind::CurveResistance, EffectKind::GradientShift, EffectKind::RotatingMass] {
        let with = |kinds: &[EffectKind]| {
            let settings =
                SimulatorSettings { train_type: Some(TrainType::Regional), ..short(3, kinds) };
            dataset_files(&simulate(&settings))
        };
        let (effect, null) = (with(&[kind]), with(&[]));
        // Only the recordings show it.
        assert_eq!(effect[..3], null[..3], "{kind}");
        assert_ne!(effect[3..], null[3..], "{kind}");
    }
}

#[test]
fn a_folder_and_its_truth_are_written_apart() {
    let folder = tempfile::tempdir().unwrap();
    let dataset = simulate(&SimulatorSettings {
        time_offset_s: 500.0,
        ..short(8, &[EffectKind::DraggingBrake])
    });
    write_dataset(&dataset, &folder.path().join("d")).unwrap();
    write_truth(&dataset, &folder.path().join("truth.json")).unwrap();
    let written = std::fs::read_to_string(folder.path().join("d/runs/02.csv")).unwrap();
    assert_eq!(written, text_of(&dataset, "runs/02.csv"));
    let truth: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(folder.path().join("truth.json")).unwrap())
            .unwrap();
    assert_eq!(truth["verdict"], "effect");
    assert_eq!(truth["effects"][0]["kind"], "dragging_brake");
    let windows = truth["effects"][0]["where"]["windows"].as_array().unwrap();
    assert_eq!(windows.len(), 2, "one of two fit runs and the holdout run");
    for window in windows {
        let of_run = |run: &&serde_json::Value| run["file"] == window["run"];
        let run = truth["runs"].as_array().unwrap().iter().find(of_run).unwrap();
        let end_s = window["t_end_s"].as_f64().unwrap();
        assert!(window["t_start_s"].as_f64().unwrap() >= 500.0);
        assert_eq!(end_s, 500.0 + run["duration_s"].as_f64().unwrap());
    }
    assert!(truth["oracle"]["full_run"]["true_parameters"].as_f64().unwrap() < 0.5);
}

#[test]
fn the_right_verdict_follows_the_effects() {
    let verdict = |kinds: &[EffectKind]| simulate(&short(1, kinds)).verdict();
    assert_eq!(verdict(&[]), "none");
    assert_eq!(verdict(&[EffectKind::TunnelDrag, EffectKind::Wind]), "effect");
    assert_eq!(verdict(&[EffectKind::Unknown]), "unknown");
}

#[test]
fn defects_come_as_often_as_asked_and_validation_sees_them() {
    let clean = simulate(&SimulatorSettings::new(21, EffectRequest::none()));
    let poor = simulate(&SimulatorSettings {
        defects: Defects::ALL,
        ..SimulatorSettings::new(21, EffectRequest::none())
    });
    let rows = |dataset: &SimulatedDataset| -> usize {
        dataset.runs.iter().map(|run| run.samples.len()).sum()
    };
    let lost = 1.0 - rows(&poor) as f64 / rows(&clean) as f64;
    // 1 % of rows and 6 gaps of 3 s per hour; a share of 0.1 % is repeated.
    assert!((0.008..0.03).contains(&lost), "{lost}");
    let (mut rejected, mut missing_cells) = (0, 0);
    for run in &poor.runs {
        let train = poor.declared_train().clone();
        let mut admission = Admission::new(SIMULATED_TRAIN, train.into());
        for sample in &run.samples {
            rejected += usize::from(admission.validate(sample).is_err());
            missing_cells += usize::from(sample.get(SampleField::Position).is_none());
        }
    }
    let share = rejected as f64 / rows(&poor) as f64;
    // Outliers of speed and position, repeated and swapped rows; most outliers of forces pass.
    assert!((0.003..0.02).contains(&share), "{share}");
    let empty = missing_cells as f64 / rows(&poor) as f64;
    assert!((0.003..0.008).contains(&empty), "{empty}");
}

#[test]
fn sampling_follows_its_period_jitter_and_offset() {
    for period_s in [0.1, 0.5, 1.0] {
        let dataset = simulate(&SimulatorSettings {
            sample_period_s: period_s,
            time_offset_s: 3600.0,
            defects: Defects { jitter: 0.05, ..Defects::NONE },
            ..short(2, &[])
        });
        for run in &dataset.runs {
            assert_eq!(run.samples[0].time_ns, 3_600_000_000_000);
            for pair in run.samples.windows(2) {
                let step_s = (pair[1].time_ns - pair[0].time_ns) as f64 * 1e-9;
                assert!((0.6..1.4).contains(&(step_s / period_s)), "{step_s} s");
            }
            let irregular = run.samples.windows(2).filter(|pair| {
                ((pair[1].time_ns - pair[0].time_ns) as f64 * 1e-9 - period_s).abs() > 1e-6
            });
            assert!(irregular.count() > run.samples.len() / 2);
        }
    }
}
