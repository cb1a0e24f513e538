//! `dynocar stops` over recordings of speed and command alone.

use std::fmt::Write as _;
use std::process::{Command, Output};

use dynocar_tests::process::DaemonSite;
use serde_json::Value;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");

const TRAIN: &str = "[train]\nmass_t = 100\nlength_m = 80\nrotating_mass_factor = 0.05\n\
    [resistance]\na = 1\nb = 0.02\nc = 0.0004\n[brake]\nmax_force_kn = 1\n";

/// Returns a recording and the distance of its stop in m. The train cruises for 30 s, then stops with a friction that
/// grows as the speed falls, scaled by a factor. The recording has time, speed and command at 5 Hz, the speed in steps
/// of 0.1 km/h.
fn recording(factor: f64, from_mps: f64) -> (String, f64) {
    let (mut text, mut speed_mps, mut distance_m) = (String::from("t,v,b\n"), from_mps, 0.0);
    let step_s = 0.01;
    for k in 0..20_000 {
        let time_s = step_s * f64::from(k);
        let is_braking = time_s >= 30.0;
        if k % 20 == 0 {
            let shown_kmh = (36.0 * speed_mps).round() / 10.0;
            writeln!(text, "{time_s:.1},{shown_kmh:.1},{}", i32::from(is_braking)).unwrap();
        }
        if time_s >= 31.0 {
            let deceleration_mps2 = factor * (0.35 + 0.6 / (1.0 + speed_mps / 10.0));
            speed_mps = (speed_mps - step_s * deceleration_mps2).max(0.0);
        }
        distance_m += if is_braking { step_s * speed_mps } else { 0.0 };
    }
    (text, distance_m)
}

fn site(runs: &[(&str, String)], columns: &str) -> DaemonSite {
    let site = DaemonSite::new();
    let mut manifest = format!(
        "[dataset]\nname = \"stops\"\n[train]\nfile = \"train.toml\"\n[columns]\n\
         time = {{ column = \"t\", unit = \"s\" }}\n{columns}"
    );
    for (index, (role, text)) in runs.iter().enumerate() {
        write!(manifest, "[[runs]]\nfile = \"{index}.csv\"\nrole = \"{role}\"\n").unwrap();
        site.write(&format!("{index}.csv"), text);
    }
    site.write("dataset.toml", &manifest);
    site.write("train.toml", TRAIN);
    site
}

const COLUMNS: &str = "speed = { column = \"v\", unit = \"km/h\" }\n\
    brake_handle = { column = \"b\", unit = \"1\" }\n";

fn stops(site: &DaemonSite, options: &[&str]) -> Output {
    let folder = site.path().display().to_string();
    Command::new(DYNOCAR).arg("stops").arg(folder).args(options).output().unwrap()
}

#[test]
fn one_stop_predicts_the_next_and_shows_how_friction_goes_with_speed() {
    let (first, first_m) = recording(1.0, 30.0);
    let (second, second_m) = recording(0.97, 28.0);
    let site = site(&[("fit", first), ("holdout", second)], COLUMNS);
    let output = stops(&site, &["--json", "-"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    let number = |value: &Value| value.as_f64().unwrap();
    let recorded = answer["stops"].as_array().unwrap();
    assert_eq!(recorded.len(), 2);
    assert!((number(&recorded[0]["distance_m"]) / first_m - 1.0).abs() < 0.005);
    let said = &recorded[1]["predicted"];
    let (said_m, bound_m) = (number(&said["distance_m"]), number(&said["distance_bound_m"]));
    assert!((said_m * 1.02 / second_m - 1.0).abs() < 0.03, "{said_m} and {second_m}");
    assert!(bound_m > second_m, "{bound_m}");
    let response = &answer["law"]["response"];
    let lost_s = number(&response["dead_time_s"]) + 0.5 * number(&response["build_up_s"]);
    assert!((lost_s - 1.0).abs() < 0.3, "{response}");
    let points = answer["law"]["points"].as_array().unwrap();
    for point in points.iter().filter(|it| (3.0..26.0).contains(&number(&it["speed_mps"]))) {
        let truth = 0.35 + 0.6 / (1.0 + number(&point["speed_mps"]) / 10.0);
        let off = (number(&point["deceleration_mps2"]) - truth).abs();
        assert!(off < 0.04 * truth, "{point}: {truth}");
    }
    let friction = recorded[0]["friction"].as_array().unwrap();
    let (fast, slow) = (&friction[2], friction.last().unwrap());
    assert!(number(&slow["share"]) > 1.3 * number(&fast["share"]), "{fast} {slow}");
    let text = String::from_utf8(stops(&site, &[]).stdout).unwrap();
    assert!(text.contains("the repeatability is assumed"), "{text}");
    assert!(text.contains("the gradient is unknown"), "{text}");
}

#[test]
fn speed_alone_is_enough_and_what_is_missing_is_reported() {
    let speed = "speed = { column = \"v\", unit = \"km/h\" }\n";
    let site = site(&[("fit", recording(1.0, 30.0).0)], speed);
    let text = String::from_utf8(stops(&site, &["--from", "20"]).stdout).unwrap();
    assert!(text.contains("speed") && text.contains("its command is not recorded"), "{text}");
}

#[test]
fn recordings_without_a_stop_and_speeds_never_seen_are_refused_in_words() {
    let cruising: String =
        recording(1.0, 30.0).0.lines().take(100).flat_map(|it| [it, "\n"]).collect();
    let without = site(&[("fit", cruising)], COLUMNS);
    let refused = stops(&without, &[]);
    assert_eq!(refused.status.code(), Some(2));
    let words = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(words.contains("no run holds a stop"), "{words}");
    let with = site(&[("fit", recording(1.0, 20.0).0)], COLUMNS);
    for (options, expected) in [
        (["--from", "50"], "nothing is reported of faster ones"),
        (["--from", "0"], "a speed above 0"),
        (["--repeatability", "2"], "a share above 0"),
    ] {
        let refused = stops(&with, &options);
        assert_eq!(refused.status.code(), Some(2), "{options:?}");
        let words = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(words.contains(expected), "{words}");
    }
}

#[test]
fn a_modulated_stop_is_reported_with_what_it_holds_and_gives_no_law() {
    let recorded = recording(1.0, 25.0).0;
    let halved = recorded.lines().enumerate().map(|(index, row)| match row.strip_suffix(",1") {
        Some(rest) if index > 0 => format!("{rest},0.5\n"),
        _ => format!("{row}\n"),
    });
    let site = site(&[("fit", halved.collect())], COLUMNS);
    let output = stops(&site, &["--json", "-"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(answer["law"].is_null(), "{answer}");
    let stop = &answer["stops"][0];
    assert_eq!(
        (&stop["manner"], stop["from_s"].as_f64().unwrap().round()),
        (&"modulated".into(), 30.0)
    );
    assert!(stop["no_law"].as_str().unwrap().contains("0.85 of its effort"), "{stop}");
    assert!(stop["decelerations"].as_array().unwrap().len() > 20, "{stop}");
    let text = String::from_utf8(stops(&site, &[]).stdout).unwrap();
    assert!(text.contains("stops with a modulated brake") && text.contains("at 15 m/s"), "{text}");
    let refused = stops(&site, &["--from", "20"]);
    assert_eq!(refused.status.code(), Some(2));
    let words = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(words.contains("no run to fit holds a stop by all of the brake"), "{words}");
}

#[test]
fn a_speed_of_one_sample_that_its_neighbours_contradict_is_no_stop() {
    let (clean, _) = recording(1.0, 30.0);
    let faulty = |(line, row): (usize, &str)| match line {
        0 => row.to_owned(),
        _ if line % 41 == 0 => replaced(row, "0"),
        _ if line % 43 == 0 => replaced(row, "359.9"),
        _ => row.to_owned(),
    };
    let rows: Vec<String> = clean.lines().enumerate().map(faulty).collect();
    for columns in [COLUMNS, "speed = { column = \"v\", unit = \"km/h\" }\n"] {
        let answer = |text: &str| -> Value {
            let output = stops(&site(&[("fit", text.to_owned())], columns), &["--json", "-"]);
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
            serde_json::from_slice(&output.stdout).unwrap()
        };
        let (of_clean, of_faulty) = (answer(&clean), answer(&rows.join("\n")));
        let stops = |answer: &Value| answer["stops"].as_array().unwrap().clone();
        assert_eq!((stops(&of_clean).len(), stops(&of_faulty).len()), (1, 1));
        let metres = |answer: &Value| stops(answer)[0]["distance_m"].as_f64().unwrap();
        let ratio = metres(&of_faulty) / metres(&of_clean);
        assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
    }
}

/// Returns a row with another speed.
fn replaced(row: &str, speed: &str) -> String {
    let mut cells: Vec<&str> = row.split(',').collect();
    cells[1] = speed;
    cells.join(",")
}
