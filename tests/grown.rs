//! Tests of the additions of docs/walkthrough.md; tests/growth.py runs them in a copy that has these additions.

use std::sync::Arc;

use dynocar_analysis::dataset::{Dataset, Quantity, parse_track, parse_train, written};
use dynocar_analysis::driven::{Beginning, DrivenTrain};
use dynocar_analysis::explain::explain;
use dynocar_analysis::identify::{identify, published_samples};
use dynocar_estimators::EstimatorSettings;
use dynocar_model::force::{ForceResolver, ValidSample};
use dynocar_model::train::numbers::PAD_AREA;
use dynocar_shared::schema::sample_fields;
use dynocar_shared::{Parameter, PipelineKind, SampleField, Status, TrainId, TrainSample};

const TRAIN: &str = "[train]\nmass_t = 200\nlength_m = 100\nrotating_mass_factor = 0.06\n\
                     [resistance]\na = 1.5\nb = 0.01\nc = 0.0005\n";
/// The form of a drag that acts while there is neither traction nor braking.
const DRAG: &str = "[[extra.factor]]\nof = \"traction_force_n\"\nform = \"up_to\"\nto = 500\n\
    [[extra.factor]]\nof = \"brake_force_n\"\nform = \"up_to\"\nto = 500\n";
const TRACK: &str = "[track]\nlength_m = 40000\ngradient = [[0.0, 0.0], [3000.0, 4.0], [5000.0, -3.0], \
                     [9000.0, 1.0], [12000.0, -5.0], [15000.0, 2.0], [22000.0, -1.0]]\n";
const STEP_S: f64 = 0.5;
const RUNS: usize = 4;

/// Returns the traction and brake force in N of a run after some steps: traction, coasting and braking in turn.
fn forces_n(number: usize, step: u32) -> [f64; 2] {
    let lap_s = 200.0 + 10.0 * number as f64;
    match STEP_S * f64::from(step) % lap_s {
        t if t < 50.0 => [90e3 - 400.0 * t, 0.0],
        t if t < lap_s - 25.0 => [0.0, 0.0],
        _ => [0.0, 100e3],
    }
}

/// Returns a run of a train, with a speed sensor that errs by 2 cm/s.
fn run(train: &str, number: usize) -> String {
    let train = Arc::new(parse_train("train.toml", train).unwrap());
    let track = Arc::new(parse_track("track.toml", TRACK).unwrap());
    let begins = Beginning { position_m: 100.0, speed_mps: 5.0, is_held_at_rest: true };
    let mut driven = DrivenTrain::new(train, Some(track), begins);
    let mut noise = 7 + number as u64;
    let mut text = String::from("t,v,s,traction,brake,wind,rail\n");
    for step in 0..1000 {
        noise =
            noise.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let error_mps = 0.04 * ((noise >> 40) as f64 / f64::from(1 << 24) - 0.5);
        let speed_mps = (driven.speed_mps() + error_mps).max(0.0);
        let (time_s, position_m) = (STEP_S * f64::from(step), driven.position_m());
        let [now, then] = [step, step + 1].map(|step| forces_n(number, step));
        text += &format!("{time_s},{speed_mps:.4},{position_m:.2},{},{},0,21\n", now[0], now[1]);
        driven.drive(STEP_S, |after_s| {
            let at = |k: usize| now[k] + (then[k] - now[k]) * after_s / STEP_S;
            TrainSample::empty(TrainId(1))
                .with(SampleField::TractionForce, at(0))
                .with(SampleField::BrakeForce, at(1))
        });
    }
    text
}

/// Runs of a train with a drag in N/kN, declared without it.
fn dataset_with(drag_n_per_kn: f64) -> Dataset {
    let column = |quantity: &str, column: &str, unit: &str| {
        format!("{quantity} = {{ column = \"{column}\", unit = \"{unit}\" }}\n")
    };
    let mut manifest = "[dataset]\nname = \"grown\"\n[train]\nfile = \"train.toml\"\n\
                        [track]\nfile = \"track.toml\"\n[columns]\n"
        .to_owned();
    manifest += &column("time", "t", "s");
    manifest += &column("speed", "v", "m/s");
    manifest += &column("position", "s", "m");
    manifest += &column("traction_force", "traction", "N");
    manifest += &column("brake_force", "brake", "N");
    manifest += &column("headwind", "wind", "m/s");
    manifest += &column("rail_temperature", "rail", "degC");
    let true_train = format!("{TRAIN}[[extra]]\nn_per_kn = {drag_n_per_kn}\n{DRAG}");
    let runs: Vec<(String, String)> =
        (0..RUNS).map(|k| (format!("{k}.csv"), run(&true_train, k))).collect();
    for (file, _) in &runs {
        let role = if file == "3.csv" { "holdout" } else { "fit" };
        manifest += &format!("[[runs]]\nfile = \"{file}\"\nrole = \"{role}\"\ndirection = 1\n");
    }
    let mut files =
        vec![("dataset.toml", &manifest[..]), ("train.toml", TRAIN), ("track.toml", TRACK)];
    files.extend(runs.iter().map(|(file, text)| (&file[..], &text[..])));
    Dataset::load(&files[..]).unwrap()
}

fn dataset() -> Dataset {
    dataset_with(0.6)
}

#[test]
fn an_everyday_effect_is_in_the_model_without_a_name_as_its_policy_says() {
    let answer = explain(&dataset_with(0.06), &|_, _| {}).unwrap().answer;
    assert!(answer.effects.is_empty(), "{}", answer.statement);
    let drag = answer.considered.iter().find(|it| it.kind == "idle_drag").unwrap();
    assert!(drag.reason.starts_with("certain and small"), "{} {drag:?}", answer.statement);
}

#[test]
fn the_effect_is_found() {
    let answer = explain(&dataset(), &|_, _| {}).unwrap().answer;
    let kinds: Vec<&str> = answer.effects.iter().map(|it| it.kind).collect();
    assert_eq!(kinds, ["idle_drag"], "{}", answer.statement);
    println!("{}", answer.statement);
}

#[test]
fn the_key_is_read_judged_and_written() {
    let text = format!("{TRAIN}[brake]\npad_area_cm2 = 350\n");
    let train = parse_train("train.toml", &text).unwrap();
    assert_eq!(train.brake_gear.pad_area_cm2, Some(350.0));
    let refused = parse_train("train.toml", &text.replace("350", "-350")).unwrap_err();
    assert!(refused.to_string().contains("pad_area_cm2 = -350: expected an area in cm²"));
    let mut declared = TRAIN.parse().unwrap();
    written::set(&mut declared, &PAD_AREA, 350.0);
    assert_eq!(parse_train("train.toml", &declared.to_string()), Ok(train));
}

#[test]
fn the_pipeline_identifies_the_mass() {
    let dataset = dataset();
    let kind = PipelineKind::from_name("mass_impulse").unwrap();
    let settings = EstimatorSettings::default_of(kind).unwrap();
    let samples = published_samples(&dataset, TrainId(1));
    let snapshot = identify(&dataset, &samples, &settings).unwrap().estimate();
    let mass_t = snapshot.value(Parameter::Mass).unwrap();
    assert!((mass_t - 200.0).abs() < 4.0, "{mass_t}");
    assert_eq!(snapshot.status(), Status::Estimated);
}

#[test]
fn a_run_in_the_format_is_read_as_the_same_run_in_csv() {
    let manifest = "[dataset]\nname = \"fixed\"\n[train]\nfile = \"train.toml\"\n[columns]\n\
                    time = { column = \"t\", unit = \"s\" }\nspeed = { column = \"v\", unit = \"m/s\" }\n\
                    [[runs]]\nfile = \"run.fwf\"\n";
    let load = |manifest: &str, file: &str, text: &str| {
        let files = [("dataset.toml", manifest), ("train.toml", TRAIN), (file, text)];
        Dataset::load(&files[..]).map(|it| it.runs[0].samples.clone())
    };
    let read = load(manifest, "run.fwf", "  t    v\n0.0  3.5\n0.5 12.25\n1.0 12.5\n").unwrap();
    let as_csv = manifest.replace("run.fwf", "run.csv");
    assert_eq!(load(&as_csv, "run.csv", "t,v\n0,3.5\n0.5,12.25\n1,12.5\n"), Ok(read.clone()));
    assert_eq!(read[1].speed_mps, 12.25);
    let wrong = load(manifest, "run.fwf", "t v\n0 1\n1 fast\n").unwrap_err().to_string();
    assert!(wrong.starts_with("run.fwf:3: column 'v'"), "{wrong}");
}

#[test]
fn the_field_comes_from_a_column_and_acts() {
    let sample = dataset().runs[0].samples[0];
    let field = SampleField::ALL.into_iter().find(|it| it.name() == "headwind_mps").unwrap();
    assert_eq!(sample.get(field), Some(0.0));
    assert_eq!(Quantity::of_field(field).map(Quantity::name), Some("headwind"));
    // Recordings of every format have their columns from these.
    assert!(sample_fields().any(|it| it.layout.name == field.name()));
    let train = Arc::new(parse_train("train.toml", TRAIN).unwrap());
    let mut resolver = ForceResolver::new(train, None);
    let mut extra_n_per_kn = |wind_mps: f64| {
        let sample = TrainSample { speed_mps: 20.0, ..sample }.with(field, wind_mps);
        let valid = ValidSample { sample: &sample, step_s: 0.0, segment: 1 };
        resolver.resolve(&valid).extra_n_per_kn
    };
    let by_wind = extra_n_per_kn(10.0) - extra_n_per_kn(0.0);
    assert!((by_wind - 0.0005 * (900.0 - 400.0)).abs() < 1e-12, "{by_wind}");
}
