//! The driver over a real daemon, with few stops; no test depends on elapsed time.

use std::process::Command;

use serde_json::Value;

/// The answer of `dynocar-bench drive`; with so few stops a result may be worse by chance.
fn drive(arguments: &[&str]) -> Value {
    let few = ["drive", "--trains", "2", "--stops", "4", "--cycle-ms", "200", "--json", "-"];
    let program =
        Command::new(env!("CARGO_BIN_EXE_dynocar-bench")).args(few).args(arguments).output();
    let output = program.expect("the program");
    let errors = String::from_utf8_lossy(&output.stderr);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {errors}"))
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("{key} in {value}"))
}

/// Root mean square of the stopping error in m.
fn error_m(line: &Value) -> f64 {
    0.01 * number(line, "stop_error_mean_cm").hypot(number(line, "stop_error_std_cm"))
}

#[test]
fn a_driver_with_dynocar_is_no_worse_whatever_becomes_of_the_daemon() {
    for scenario in ["metro, ordinary", "metro, daemon dies", "regional, ordinary"] {
        let scored = drive(&["--scenario", scenario]);
        // Declared, Dynocar, true.
        let lines = scored["drives"].as_array().expect("drives");
        assert_eq!(lines.len(), 3, "{scored}");
        let of = |line: usize, key: &str| number(&lines[line], key);
        for line in lines {
            println!("{line}");
            assert_eq!(number(line, "stops"), 8.0);
            assert!(error_m(line) < 0.5, "{line}");
        }
        assert!(error_m(&lines[1]) < error_m(&lines[0]) + 0.1, "{scenario}");
        assert!(of(1, "energy_percent") < of(0, "energy_percent") + 1.0, "{scenario}");
        assert!(of(1, "late_s") < of(0, "late_s") + 1.0, "{scenario}");
        assert_eq!(of(1, "bounds_exceeded"), 0.0, "{scenario}");
        assert!(of(1, "bound_percent") < of(1, "fixed_bound_percent"));
        let mass = &scored["answers"][1];
        assert_eq!(mass["quantity"], "mass");
        // A daemon that comes back has to learn anew.
        let least = if scenario.contains("dies") { 40.0 } else { 80.0 };
        assert!(number(mass, "usable_percent") > least, "{mass}");
    }
}

#[test]
fn the_same_seed_gives_the_same_figures_and_the_picture_is_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("gain.svg");
    let arguments = ["--scenario", "metro, ordinary", "--first-seed", "31"];
    let once = drive(&[&arguments[..], &["--picture", picture.to_str().unwrap()]].concat());
    assert_eq!(once, drive(&arguments));
    let drawn = std::fs::read_to_string(picture).unwrap();
    assert!(drawn.contains("<svg") && drawn.contains("with Dynocar"), "{drawn}");
}

#[test]
fn what_cannot_be_driven_is_refused_in_words() {
    for (argument, value) in [("--scenario", "tram"), ("--cycle-ms", "5"), ("--trains", "0")] {
        let program = env!("CARGO_BIN_EXE_dynocar-bench");
        let output = Command::new(program).args(["drive", argument, value]).output().unwrap();
        assert_eq!(output.status.code(), Some(2));
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(said.contains(argument) && said.contains("expected"), "{said}");
    }
}
