//! Input faults in simulated datasets: each is named by `check`, `identify` and `explain`, no pipeline stays trusted,
//! and right data give no message under any effect.

use std::path::Path;
use std::process::Command;

use dynocar::dataset;
use dynocar_analysis::identify::{identify, published_samples};
use dynocar_core::plausibility::Severity;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{Reason, Status, TrainId};
use dynocar_tests::golden::frugal_estimators;
use dynocar_tests::simulator::dataset_writer::dataset_files;
use dynocar_tests::simulator::{
    Defects, EffectRequest, SimulatorSettings, TrainType, TrueEffect, simulate,
};
use serde_json::Value;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");

/// A wrong description that no single file contradicts.
#[derive(Clone, Copy, Debug)]
enum InputFault {
    /// The values of these quantities are read too large by this factor.
    Scale(&'static [&'static str], f64),
    /// Two columns are exchanged, or the sign of their difference.
    Exchange,
    /// The masses of the runs are wrong by this factor.
    Mass(f64),
    /// The line's gradients are wrong by this factor.
    Gradient(f64),
    /// The direction of every run is reversed.
    Direction,
}

const FORCES: &[&str] = &["traction_force", "brake_force", "control_force"];

/// Faults, the code of the diagnostic, and the reason of the pipelines.
const FAULTS: [(&str, InputFault, &str, Reason); 17] = [
    ("kN as N", InputFault::Scale(FORCES, 1e-3), "forces_scale", Reason::ImplausibleForces),
    ("N as kN", InputFault::Scale(FORCES, 1e3), "forces_scale", Reason::ImplausibleForces),
    ("lbf as N", InputFault::Scale(FORCES, 0.224_809), "forces_scale", Reason::ImplausibleForces),
    ("exchanged", InputFault::Exchange, "forces_swapped", Reason::ImplausibleForces),
    ("km/h as m/s", InputFault::Scale(&["speed"], 3.6), "speed_scale", Reason::ImplausibleMotion),
    (
        "m/s as km/h",
        InputFault::Scale(&["speed"], 1.0 / 3.6),
        "speed_scale",
        Reason::ImplausibleMotion,
    ),
    (
        "mph as m/s",
        InputFault::Scale(&["speed"], 2.236_936),
        "speed_scale",
        Reason::ImplausibleMotion,
    ),
    (
        "km as m",
        InputFault::Scale(&["position"], 1e-3),
        "position_scale",
        Reason::ImplausibleMotion,
    ),
    ("m as km", InputFault::Scale(&["position"], 1e3), "position_scale", Reason::ImplausibleMotion),
    ("ms as s", InputFault::Scale(&["time"], 1e3), "time_scale", Reason::ImplausibleMotion),
    ("s as ms", InputFault::Scale(&["time"], 1e-3), "time_scale", Reason::ImplausibleMotion),
    ("t as kg", InputFault::Mass(1e-3), "mass_scale", Reason::ImplausibleMass),
    ("direction", InputFault::Direction, "direction_reversed", Reason::ImplausibleMotion),
    ("% as permille", InputFault::Gradient(0.1), "gradient_scale", Reason::ImplausibleGradient),
    ("falls for climbs", InputFault::Gradient(-1.0), "gradient_sign", Reason::ImplausibleGradient),
    ("kPa as Pa", PRESSURE_KPA, "pressure_scale", Reason::ImplausiblePressure),
    ("bar as Pa", PRESSURE_BAR, "pressure_scale", Reason::ImplausiblePressure),
];
/// Gradients in another unit by less than ordinary effects do to a few windows: whole runs show it.
const GRADIENTS: [(&str, InputFault); 4] = [
    ("deg as %", InputFault::Gradient(0.573)),
    ("% as deg", InputFault::Gradient(1.745)),
    ("deg as permille", InputFault::Gradient(0.0573)),
    ("permille as ft/mi", InputFault::Gradient(0.189)),
];
const PRESSURE_KPA: InputFault = InputFault::Scale(&["brake_cylinder_pressure"], 1e-3);
const PRESSURE_BAR: InputFault = InputFault::Scale(&["brake_cylinder_pressure"], 1e-5);

impl InputFault {
    /// Applies it to a line of a file.
    fn line(self, file: &str, line: &str) -> String {
        let key = line.split(" =").next().unwrap_or_default();
        match self {
            InputFault::Scale(quantities, factor) if quantities.contains(&key) => {
                scaled(line, factor)
            }
            InputFault::Exchange if key == "control_force" => scaled(line, -1.0),
            InputFault::Exchange if key == "traction_force" => {
                line.replacen("traction_force =", "brake_force =", 1)
            }
            InputFault::Exchange if key == "brake_force" => {
                line.replacen("brake_force =", "traction_force =", 1)
            }
            InputFault::Mass(factor) if file == "dataset.toml" && key == "mass_t" => {
                let mass_t: f64 = line.split("= ").nth(1).unwrap().parse().unwrap();
                format!("mass_t = {:.4}", mass_t * factor)
            }
            InputFault::Direction if key == "direction" => {
                let direction: i32 = line.split("= ").nth(1).unwrap().parse().unwrap();
                format!("direction = {}", -direction)
            }
            // Curves have three numbers.
            InputFault::Gradient(factor)
                if file == "track.toml" && line.matches(',').count() == 2 =>
            {
                let Some((from, permille)) =
                    line.trim().trim_matches(['[', ']', ',']).split_once(", ")
                else {
                    return line.into();
                };
                let permille: f64 = permille.parse().unwrap();
                // Tunnels have two numbers as well, the second a chainage.
                if permille.abs() > 100.0 {
                    return line.into();
                }
                format!("  [{from}, {:.4}],", permille * factor)
            }
            _ => line.into(),
        }
    }
}

/// A column's mapping with one more factor.
fn scaled(line: &str, factor: f64) -> String {
    let (mapping, own) = match line.split_once(", scale = ") {
        Some((mapping, scale)) => (mapping, scale.trim_end_matches(" }").parse().unwrap()),
        None => (line.trim_end_matches(" }"), 1.0),
    };
    format!("{mapping}, scale = {} }}", own * factor)
}

fn settings(seed: u64, train_type: TrainType, effects: EffectRequest) -> SimulatorSettings {
    SimulatorSettings {
        train_type: Some(train_type),
        runs: 3,
        holdout_runs: 1,
        ..SimulatorSettings::new(seed, effects)
    }
}

/// The files of a dataset, by path.
fn files(settings: &SimulatorSettings) -> Vec<(String, String)> {
    dataset_files(&simulate(settings))
}

/// Writes a dataset with an input fault.
fn write(files: &[(String, String)], fault: Option<InputFault>, folder: &Path) {
    std::fs::create_dir_all(folder.join("runs")).unwrap();
    for (path, text) in files {
        let changed = |fault: InputFault| {
            let lines = text.lines().map(|line| fault.line(path, line) + "\n");
            lines.collect::<String>()
        };
        let text = match fault {
            Some(fault) if path.ends_with(".toml") => changed(fault),
            _ => text.clone(),
        };
        std::fs::write(folder.join(path), text).unwrap();
    }
}

/// Returns the terminal output of a command, on one line, and its answer, or its error, as where no sample is
/// usable.
fn printed(folder: &Path, command: &[&str]) -> (String, Value) {
    let file = folder.join(format!("{}.json", command[0]));
    let run = Command::new(DYNOCAR)
        .args([command[0], folder.to_str().unwrap()])
        .args(&command[1..])
        .args(["--json", file.to_str().unwrap()])
        .output()
        .unwrap();
    let text = String::from_utf8(run.stdout).unwrap() + &String::from_utf8(run.stderr).unwrap();
    let text = text.replace("\n  ", " ").replace("  ", " ");
    (text, serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap())
}

fn has_note(answer: &Value, code: &str) -> bool {
    let diagnostics = answer["notes"].as_array().expect("a list of diagnostics");
    diagnostics.iter().any(|diagnostic| {
        diagnostic["code"] == code
            && diagnostic["text"].as_str().is_some_and(|text| text.contains('?'))
    })
}

/// A freight train with forces of their own, and a metro with a signed one.
const TRAINS: [(u64, TrainType); 2] = [(401, TrainType::Freight), (402, TrainType::Metro)];

#[test]
fn every_input_fault_is_named_by_check_identify_and_explain_on_the_terminal_and_in_json() {
    for (seed, train_type) in TRAINS {
        let files = files(&settings(seed, train_type, EffectRequest::none()));
        let live = FAULTS.map(|(name, fault, code, _)| (name, fault, code));
        let of_whole_runs = GRADIENTS.map(|(name, fault)| (name, fault, "gradient_scale"));
        for (name, fault, code) in live.iter().chain(&of_whole_runs).copied() {
            let folder = tempfile::tempdir().unwrap();
            let folder = folder.path();
            write(&files, Some(fault), folder);
            let case = format!("{name}, {}", train_type.name());
            let dataset = dataset::load(folder).unwrap();
            let diagnostic = dataset.diagnostics().into_iter().find(|it| it.code == code).unwrap();
            // A run on gentle gradients does not show the fault by itself.
            let least = if of_whole_runs.iter().any(|it| it.0 == name) { 2 } else { 3 };
            assert!(diagnostic.runs.len() >= least, "{case}: {diagnostic}");
            let words: String =
                diagnostic.text.split_whitespace().take(4).collect::<Vec<_>>().join(" ");
            let report = folder.join("report.html");
            let commands: [&[&str]; 3] = [
                &["check"],
                &["identify", "--estimator", "rls"],
                &["explain", "--report", report.to_str().unwrap()],
            ];
            let mut explained = Value::Null;
            for command in commands {
                let (text, answer) = printed(folder, command);
                assert!(text.contains(&words), "{}: {case}: {text}", command[0]);
                let is_error = answer["error"]["message"].as_str().is_some();
                assert!(is_error || has_note(&answer, code), "{}: {case}", command[0]);
                explained = answer;
            }
            // Where no sample is usable there is no answer, and the error names the input fault.
            if let Some(message) = explained["error"]["message"].as_str() {
                assert!(message.contains(&words), "explain: {case}: {message}");
                continue;
            }
            if diagnostic.severity < Severity::Fundamental {
                continue;
            }
            assert_eq!(explained["verdict"], "insufficient_data", "{case}");
            assert_eq!(explained["effects"], Value::Array(Vec::new()), "{case}");
            let page = std::fs::read_to_string(report).unwrap();
            let (diagnostics, verdict) = (page.find("id=\"notes\""), page.find("id=\"verdict\""));
            assert!(diagnostics.unwrap() < verdict.unwrap(), "{case}: the diagnostics stand above");
            assert!(!page.contains("class=\"verdict none\""), "{case}: no green box");
        }
    }
}

/// Files of a dataset whose runs are cut into pieces of this many rows, each a run of its own.
fn in_pieces(files: &[(String, String)], rows: usize) -> Vec<(String, String)> {
    let mut pieces = Vec::new();
    for (path, text) in files {
        let Some(stem) = path.strip_suffix(".csv") else { continue };
        let lines: Vec<&str> = text.lines().collect();
        for (number, piece) in lines[1..].chunks(rows).enumerate() {
            let text = format!("{}\n{}\n", lines[0], piece.join("\n"));
            pieces.push((format!("{stem}-{number}.csv"), text));
        }
    }
    let entry = |line: &str| {
        let path = line.split('"').find(|it| it.ends_with(".csv"));
        let stem = path.and_then(|it| it.strip_suffix(".csv"));
        stem.map(str::to_owned).filter(|_| line.contains("file = "))
    };
    for (path, text) in files.iter().filter(|(path, _)| path.ends_with(".toml")) {
        let mut changed = String::new();
        let mut blocks = text.split("[[runs]]");
        changed += blocks.next().unwrap_or_default();
        for block in blocks {
            let stem = block.lines().find_map(entry).unwrap();
            let own = pieces.iter().filter(|(it, _)| it.starts_with(&format!("{stem}-")));
            for (piece, _) in own {
                changed += &format!("[[runs]]{}", block.replace(&format!("{stem}.csv"), piece));
            }
        }
        pieces.push((path.clone(), changed));
    }
    pieces
}

#[test]
fn short_runs_show_together_that_gradients_are_in_another_unit() {
    let (seed, train_type) = TRAINS[0];
    let whole = files(&settings(seed, train_type, EffectRequest::none()));
    let files = in_pieces(&whole, 1000);
    for (name, fault) in [("right", None)].into_iter().chain(GRADIENTS.map(|it| (it.0, Some(it.1))))
    {
        let folder = tempfile::tempdir().unwrap();
        write(&files, fault, folder.path());
        let dataset = dataset::load(folder.path()).unwrap();
        assert!(dataset.runs.len() > 6, "{}", dataset.runs.len());
        let said = dataset.diagnostics().into_iter().find(|it| it.code == "gradient_scale");
        assert_eq!(said.is_some(), fault.is_some(), "{name}: {said:?}");
    }
}

#[test]
fn no_pipeline_trusts_samples_that_cannot_be_true() {
    let (seed, train_type) = TRAINS[1];
    let files = files(&settings(seed, train_type, EffectRequest::none()));
    for (name, fault, _, reason) in FAULTS {
        let folder = tempfile::tempdir().unwrap();
        write(&files, Some(fault), folder.path());
        let dataset = dataset::load(folder.path()).unwrap();
        let samples = published_samples(&dataset, TrainId(1));
        for settings in frugal_estimators() {
            let kind = settings.kind();
            let snapshot = identify(&dataset, &samples, &settings).unwrap().estimate();
            if reason == Reason::ImplausiblePressure && snapshot.reason() != Some(reason) {
                // Masses and resistances do not rest on the pressure.
                assert!(!kind.name().starts_with("brake_"), "{name}: {kind}");
                continue;
            }
            assert_ne!(snapshot.status(), Status::Estimated, "{name}: {kind}");
            assert_eq!(snapshot.reason(), Some(reason), "{name}: {kind}");
        }
    }
}

/// Diagnostics that are no account of single bad rows.
fn notes_on(settings: &SimulatorSettings) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    write(&files(settings), None, folder.path());
    let diagnostics = dataset::load(folder.path()).unwrap().diagnostics();
    let of_rows = ["off_the_line", "stands_still"];
    diagnostics.iter().filter(|it| !of_rows.contains(&it.code)).map(ToString::to_string).collect()
}

#[test]
fn no_effect_however_large_and_no_poor_recording_is_taken_for_an_input_fault() {
    let none: [String; 0] = [];
    let mut cases: Vec<EffectRequest> = EffectKind::ALL
        .iter()
        .filter(|&&kind| kind != EffectKind::None)
        .map(|&kind| EffectRequest::Kinds(vec![kind]))
        .collect();
    let heavier = |run| {
        let window =
            dynocar_tests::simulator::effects::TrueRunWindow { run, start_s: 0.0, end_s: 1e4 };
        (window, 1.4)
    };
    cases.push(EffectRequest::Exactly(vec![
        TrueEffect::TractionGain { gain: 0.85 },
        TrueEffect::WheelDiameter { speed_scale: 1.04 },
        TrueEffect::MassChangeWindows((0..3).map(heavier).collect()),
    ]));
    cases.push(EffectRequest::none());
    for (seed, effects) in (500..).zip(cases) {
        for (train_type, defects) in [
            (TrainType::ALL[seed as usize % 4], Defects::NONE),
            (TrainType::ALL[(seed as usize + 1) % 4], Defects::ALL),
        ] {
            let settings =
                SimulatorSettings { defects, ..settings(seed, train_type, effects.clone()) };
            assert_eq!(notes_on(&settings), none, "seed {seed}, {effects:?}, {train_type:?}");
        }
    }
}
