//! `dynocar brakes` over simulated emergency stops, and its output.

use std::fmt::Write as _;
use std::process::{Command, Output};

use dynocar_tests::process::DaemonSite;
use serde_json::Value;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");

const TRAIN: &str = "[train]\nmass_t = 100\nlength_m = 80\nrotating_mass_factor = 0.05\n\
    [resistance]\na = 1\nb = 0.02\nc = 0.0004\n[brake]\nmax_force_kn = 100\n";

/// Deceleration in m/s² of the true brake.
fn true_mps2(speed_mps: f64) -> f64 {
    0.5 + 0.5 / (1.0 + speed_mps / 10.0)
}

/// Twelve stops from 30 m/s, each with a brake a few percent stronger or weaker, and this handle; `slides` marks
/// sliding wheels.
fn recording(handle: f64, slides: bool) -> String {
    let mut text = String::from("t,v,b,s\n");
    let (mut time_s, step_s) = (0.0, 0.02);
    for stop in 0..12 {
        let factor = 1.0 + 0.01 * f64::from(stop % 5 - 2);
        let (mut speed_mps, mut rows) = (30.0_f64, 0);
        let applied_s = time_s + 20.0;
        let mut stands_s = 0.0;
        while stands_s < 5.0 {
            if rows % 10 == 0 {
                let is_braking = f64::from(u8::from(time_s >= applied_s)) * handle;
                writeln!(text, "{time_s:.2},{speed_mps:.2},{is_braking},{}", u8::from(slides))
                    .unwrap();
            }
            if time_s >= applied_s + 1.0 {
                speed_mps = (speed_mps - step_s * factor * true_mps2(speed_mps)).max(0.0);
            }
            stands_s += if speed_mps == 0.0 { step_s } else { 0.0 };
            time_s += step_s;
            rows += 1;
        }
        // Away again before the next, faster than anything that is looked for.
        for k in 0..150 {
            writeln!(text, "{:.2},{:.2},0,0", time_s + 0.2 * f64::from(k), 0.2 * f64::from(k))
                .unwrap();
        }
        time_s += 30.0;
    }
    text
}

fn site(handle: f64, slides: bool, train: &str) -> DaemonSite {
    let site = DaemonSite::new();
    let manifest = "[dataset]\nname = \"brake\"\n[train]\nfile = \"train.toml\"\n[columns]\n\
        time = { column = \"t\", unit = \"s\" }\nspeed = { column = \"v\", unit = \"m/s\" }\n\
        brake_handle = { column = \"b\", unit = \"1\" }\nwheel_slide = { column = \"s\", unit = \"1\" }\n\
        [[runs]]\nfile = \"run.csv\"\n";
    site.write("dataset.toml", manifest);
    site.write("train.toml", train);
    site.write("run.csv", &recording(handle, slides));
    site
}

fn dynocar(arguments: &[&str]) -> Output {
    Command::new(DYNOCAR).args(arguments).output().unwrap()
}

fn words(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn the_parameters_are_written_for_osrd_read_back_and_reported() {
    let components = "units = 16\nfriction_std = 0.05\nfailure_probability = 0.001\n";
    let site = site(1.0, false, &format!("{TRAIN}{components}"));
    let at = |name: &str| site.path().join(name).display().to_string();
    let (folder, etcs, page) =
        (site.path().display().to_string(), at("etcs.json"), at("page.html"));
    let table = at("table.csv");
    let options = ["--etcs", &etcs, "--report", &page, "--distances", &table, "--k-wet", "0.8"];
    let output = dynocar(&[&["brakes", &folder][..], &options, &["--json", "-"]].concat());
    assert!(output.status.success(), "{}", words(&output));
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(answer["stops"][0], 12, "{answer}");
    let levels = answer["parameters"]["k_dry"].as_array().unwrap();
    assert_eq!(levels.len(), 10);
    // Twelve stops show one in ten and no rarer ones; beyond speak the components, ever weaker.
    assert!(levels[1]["measured"].is_number() && levels[2]["measured"].is_null(), "{levels:?}");
    let modelled: Vec<f64> = levels.iter().map(|it| it["modelled"].as_f64().unwrap()).collect();
    assert!(modelled.windows(2).all(|it| it[1] < it[0]) && modelled[9] > 0.3, "{modelled:?}");
    let written: Value = serde_json::from_str(&std::fs::read_to_string(&etcs).unwrap()).unwrap();
    for key in [
        "gamma_emergency",
        "gamma_service",
        "gamma_normal_service",
        "k_dry",
        "k_wet",
        "k_n_pos",
        "k_n_neg",
    ] {
        let list = |name: &str| written[key][name].as_array().unwrap().len();
        assert!(
            list("values") == list("boundaries") + 1 && list("values") <= 7,
            "{key}: {written}"
        );
    }
    let values = written["gamma_emergency"]["values"].as_array().unwrap();
    assert!(values.iter().all(|it| (0.55..1.0).contains(&it.as_f64().unwrap())), "{values:?}");
    let (t_be, page) = (written["t_be"].as_f64().unwrap(), std::fs::read_to_string(&page).unwrap());
    assert!((0.7..2.0).contains(&t_be), "{t_be}");
    assert!(page.contains("no safety case") && page.contains("<svg"));
    let out = at("imported");
    let output = dynocar(&["import", &etcs, "--out", &out]);
    assert!(output.status.success(), "{}", words(&output));
    let train = std::fs::read_to_string(at("imported/train.toml")).unwrap();
    assert!(train.contains("[brake]\neffort = ["), "{train}");
    // The table of distances is read as a brake of the same kind.
    let output = dynocar(&["brakes", "--table", &table, "--json", "-"]);
    assert!(output.status.success(), "{}", words(&output));
    let laws: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(laws[0]["error_median"].as_f64().unwrap() < 0.02, "{laws}");
    let text = String::from_utf8(dynocar(&["brakes", &folder]).stdout).unwrap();
    assert!(text.contains("no safety case") && text.contains("A_brake_emergency"), "{text}");
}

#[test]
fn stops_that_show_no_brake_are_named_with_what_remains() {
    for (handle, slides, expected) in
        [(0.5, false, "0.85 of its effort"), (1.0, true, "the wheels slid")]
    {
        let site = site(handle, slides, TRAIN);
        let output = dynocar(&["brakes", &site.path().display().to_string()]);
        assert_eq!(output.status.code(), Some(2));
        let said = words(&output);
        assert!(said.contains(expected) && said.contains("dynocar stops"), "{said}");
    }
    let site = site(1.0, false, TRAIN);
    let folder = site.path().display().to_string();
    let etcs = site.path().join("etcs.json").display().to_string();
    let output = dynocar(&["brakes", &folder, "--etcs", &etcs, "--ebcl", "6"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(words(&output).contains("12 stops support no such level"), "{}", words(&output));
    let wrong = "{\"gamma_emergency\": {\"boundaries\": [9, 5], \"values\": [1, 1, 1]}}";
    site.write("wrong.json", wrong);
    let (wrong, out) = (site.path().join("wrong.json"), site.path().join("out"));
    let (wrong, out) = (wrong.display().to_string(), out.display().to_string());
    let output = dynocar(&["import", &wrong, "--out", &out]);
    assert_eq!(output.status.code(), Some(2));
    assert!(words(&output).contains("a speed above the one before"), "{}", words(&output));
}

#[test]
fn a_train_that_cannot_be_true_is_refused_and_gives_no_brake() {
    let in_kg = TRAIN.replace("mass_t = 100", "mass_t = 100000");
    let site = site(1.0, false, &in_kg);
    let etcs = site.path().join("etcs.json");
    let folder = site.path().display().to_string();
    let output = dynocar(&["brakes", &folder, "--etcs", etcs.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(2), "{}", words(&output));
    assert!(words(&output).contains("the data cannot be true as described"), "{}", words(&output));
    assert!(!etcs.exists());
}

#[test]
fn every_value_of_the_form_says_what_it_rests_on_and_guesses_say_so() {
    let site = site(1.0, false, TRAIN);
    let recorded = std::fs::read_to_string(site.path().join("run.csv")).unwrap();
    let (mut text, mut commanded_s) = (String::from("t,v,b,s,f\n"), None);
    for row in recorded.lines().skip(1) {
        let cells: Vec<f64> = row.split(',').map(|it| it.parse().unwrap()).collect();
        let is_commanded = cells[2] > 0.0;
        commanded_s = if is_commanded { commanded_s.or(Some(cells[0])) } else { None };
        let is_driven = commanded_s.is_none_or(|since_s| cells[0] < since_s + 0.79);
        writeln!(text, "{row},{}", if is_driven { 20 } else { 0 }).unwrap();
    }
    site.write("run.csv", &text);
    let manifest = std::fs::read_to_string(site.path().join("dataset.toml")).unwrap();
    let force = "[columns]\ntraction_force = { column = \"f\", unit = \"kN\" }\n";
    site.write("dataset.toml", &manifest.replace("[columns]\n", force));
    let folder = site.path().display().to_string();
    let etcs = site.path().join("etcs.json").display().to_string();
    let output = dynocar(&["brakes", &folder, "--etcs", &etcs, "--json", "-"]);
    assert!(output.status.success(), "{}", words(&output));
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    let basis = |key: &str| {
        let all = answer["rests_on"].as_array().unwrap();
        let found = all.iter().find(|it| it["key"] == key).unwrap();
        (found["is_guess"].as_bool().unwrap(), found["rests_on"].as_str().unwrap().to_owned())
    };
    // The form is whole, its factors lie at the boundaries of the emergency steps, and unknown values are marked as
    // guesses.
    let written: Value = serde_json::from_str(&std::fs::read_to_string(&etcs).unwrap()).unwrap();
    for key in written.as_object().unwrap().keys() {
        assert!(!basis(key).1.is_empty(), "{key}");
    }
    for key in ["k_dry", "k_wet"] {
        assert_eq!(written[key]["boundaries"], written["gamma_emergency"]["boundaries"], "{key}");
    }
    assert_eq!(written["gamma_service"], written["gamma_emergency"]);
    for (key, is_guess, expected) in [
        ("gamma_emergency", false, "12 stops by all of the brake"),
        ("gamma_service", true, "the emergency steps"),
        ("gamma_normal_service", true, "gamma_service"),
        ("k_dry", false, "level 1"),
        ("k_wet", true, "not known"),
        ("t_traction_cut_off", false, "12 stops"),
        ("t_bs1", true, "t_be"),
    ] {
        let (guess, words) = basis(key);
        assert!(guess == is_guess && words.contains(expected), "{key}: {guess} {words}");
    }
    let cut_off_s = written["t_traction_cut_off"].as_f64().unwrap();
    assert!((0.75..1.05).contains(&cut_off_s), "{cut_off_s}");
    let said = String::from_utf8(dynocar(&["brakes", &folder]).stdout).unwrap();
    for expected in [
        "k_wet (a guess)",
        "the gradient is unknown in 12",
        "T_traction_cut_off: ",
        "end while the train moves",
    ] {
        assert!(said.contains(expected), "{expected}: {said}");
    }
}
