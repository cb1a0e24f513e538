//! `dynocar import`: files of other projects as train.toml and track.toml; `dynocar check --draw`.

use std::fs::{create_dir_all, read_to_string};
use std::path::Path;

use dynocar::dataset::{load_track, load_train};
use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;
use dynocar_shared::resistance::GRAVITY_MPS2;
use dynocar_tests::browser::Browser;
use dynocar_tests::process::DaemonSite;

use crate::commands::{done, dynocar, said};
use crate::guide::{blocks, guide, install, run};

const CORPUS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/corpus/import");

fn corpus(name: &str) -> String {
    format!("{CORPUS}/{name}")
}

/// Imports a file of the corpus into the folder `made`; returns the printed text.
fn import(site: &DaemonSite, name: &str, more: &[&str]) -> String {
    let file = corpus(name);
    done(site, &[&["import", &file, "-o", "made"], more].concat())
}

fn train(site: &DaemonSite) -> TrainModel {
    load_train(&site.path().join("made/train.toml")).unwrap()
}

fn track(site: &DaemonSite) -> Track {
    load_track(&site.path().join("made/track.toml")).unwrap()
}

fn assert_close(found: f64, expected: f64) {
    assert!((found - expected).abs() <= 1e-7 * expected.abs(), "{found} for {expected}");
}

#[test]
fn an_imported_train_is_read_back_with_the_numbers_of_its_source() {
    let site = DaemonSite::new();
    let printed = import(&site, "rolling_stock.yaml", &["--train", "ore", "--load", "0.5"]);
    let ore = train(&site);
    assert_eq!((ore.name.as_str(), ore.cars), ("Ore train", 3));
    assert_close(ore.mass_kg, 180e3);
    assert_close(ore.length_m, 40.0);
    assert_close(ore.rotating_mass_factor, 130.0 / 120.0 - 1.0);
    assert_close(ore.resistance.a, 366.2 / 180.0);
    assert_close(ore.resistance.c, 0.008064);
    assert_eq!(ore.traction.unwrap().points(), [(0.0, 200e3), (10.0, 180e3), (30.0, 60e3)]);
    for words in [
        "vehicles.load_limit",
        "not taken: 'vehicles.speed_limit': train.toml holds no speed limit",
        "not taken: 'vehicles.a_braking': not understood",
        "written: made/train.toml",
        "dynocar check made/train.toml --draw made",
    ] {
        assert!(printed.contains(words), "{words}: {printed}");
    }
    let text = read_to_string(site.path().join("made/train.toml")).unwrap();
    assert!(!text.contains("# DEFAULT") && !printed.contains("defaults"), "{text}");
    assert!(done(&site, &["check", "made/train.toml"]).contains("180 t"));

    let site = DaemonSite::new();
    let printed = import(&site, "osrd_each_kg.json", &[]);
    assert_close(train(&site).resistance.a, 8.0 / GRAVITY_MPS2);
    assert!(printed.contains("for each kg: 4.49 N/kN at 40.0 m/s"), "{printed}");
    let site = DaemonSite::new();
    import(&site, "osrd_whole.json", &["--mode", "1500V", "--format", "osrd"]);
    assert_eq!(train(&site).traction.unwrap().points(), [(0.0, 100e3), (25.0, 40e3)]);
}

#[test]
fn an_imported_line_is_read_back_with_the_numbers_of_its_source() {
    let site = DaemonSite::new();
    let printed = import(&site, "ttobench_track.json", &[]);
    let line = track(&site);
    assert_eq!(line.length_m, Some(6000.0));
    assert_eq!(line.gradient_permille(1600.0, 0.0), Some(-6.67));
    assert_close(1.0 / line.curvature_per_m(600.0, 0.0).unwrap(), 500.0);
    let at_m: Vec<f64> = line.survey.stops.iter().map(|stop| stop.0).collect();
    assert_eq!(at_m, [0.0, 2500.0, 6000.0]);
    assert_close(line.survey.permitted_speed_mps.as_ref().unwrap().value_at(1200.0), 30.0);
    assert!(printed.contains("not taken: 'altitude': track.toml holds gradients"), "{printed}");
    assert!(printed.contains("not in the file: tunnels: the format has none"), "{printed}");

    let site = DaemonSite::new();
    import(&site, "running_path_2022.yaml", &[]);
    let line = track(&site);
    assert_eq!(line.gradient_permille(2000.0, 0.0), Some(12.5));
    assert!(!line.knows_curves() && !line.knows_tunnels());
    let text = read_to_string(site.path().join("made/track.toml")).unwrap();
    assert!(text.contains("#   curves is not known: the format has none"), "{text}");
    assert!(done(&site, &["check", "made/track.toml"]).contains("72 to 108 km/h"));
}

#[test]
fn what_a_file_does_not_show_is_a_marked_default_unless_somebody_says_it() {
    let site = DaemonSite::new();
    let printed = import(&site, "ttobench_train.json", &[]);
    let text = read_to_string(site.path().join("made/train.toml")).unwrap();
    assert!(text.contains("length_m = 75.0 ") && text.contains("# DEFAULT; m, over"), "{text}");
    assert!(
        printed.contains("defaults in train.toml, nobody's figures: length_m = 75.0"),
        "{printed}"
    );
    assert!(printed.contains("not in the file: length_m: the format has none"), "{printed}");
    let site = DaemonSite::new();
    let printed = import(&site, "ttobench_train.json", &["--length-m", "74.08", "--name", "T 1"]);
    assert!(!printed.contains("defaults"), "{printed}");
    let model = train(&site);
    assert_eq!((model.length_m, model.name.as_str()), (74.08, "T 1"));
    assert_close(model.resistance.a, 2200.0 / (150.0 * GRAVITY_MPS2));
}

#[test]
fn a_train_and_a_line_of_several_files_go_into_one_folder() {
    let site = DaemonSite::new();
    let (stock, path) = (corpus("rolling_stock.yaml"), corpus("running_path_2024.yaml"));
    let both = ["import", &stock, &path, "--out", "made"];
    let refused = |more: &[&str]| {
        let output = dynocar(&site, &[&both, more].concat());
        assert_eq!(output.status.code(), Some(2), "{}", said(&output));
        assert!(!site.path().join("made").exists());
        said(&output)
    };
    let message = refused(&[]);
    assert!(
        message.contains("hold 2 trains; say which: --train ID, of 'ore', 'express'"),
        "{message}"
    );
    let message = refused(&["--train", "ore"]);
    assert!(message.contains("hold 2 lines; say which: --line ID, of '1', '2'"), "{message}");
    let message = refused(&["--train", "ore", "--line", "3"]);
    assert!(message.contains("--line 3: expected one of '1', '2'"), "{message}");
    done(&site, &[&both[..], &["--train", "express", "--line", "1"]].concat());
    assert_eq!(train(&site).name, "Express");
    assert_eq!(track(&site).gradient_permille(1000.0, 0.0), Some(-2.5));
}

#[test]
fn nothing_is_overwritten_and_nothing_is_written_of_bad_input() {
    let site = DaemonSite::new();
    create_dir_all(site.path().join("made")).unwrap();
    let mine = site.write("made/train.toml", "mine");
    let (tram, track) = (corpus("osrd_whole.json"), corpus("ttobench_track.json"));
    let output = dynocar(&site, &["import", &tram, &track, "-o", "made"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        said(&output).starts_with("dynocar: made/train.toml: exists already"),
        "{}",
        said(&output)
    );
    assert_eq!(read_to_string(mine).unwrap(), "mine");
    assert!(!site.path().join("made/track.toml").exists());
    let tram = read_to_string(tram).unwrap();
    let cases = [
        ("a.xml", "<railml version='2.2'/>".to_string(), "a.xml: railML is not imported: its"),
        ("a.yaml", "schema: [".to_string(), "not valid YAML"),
        ("a.json", tram[..200].to_string(), "not valid JSON"),
        ("b.json", tram.replace("mass\": 80000.0", "mass\": 80"), "b.json:5: mass = 80: expected"),
        ("c.json", tram.replace("80000.0", "NaN"), "c.json:5: mass = NaN: expected a mass in kg"),
        ("a.csv", "t,v\n0,1\n".to_string(), "a.csv:1: the format is not recognised"),
    ];
    for (name, text, words) in cases {
        site.write(name, &text);
        let output = dynocar(&site, &["import", name, "-o", "new"]);
        assert_eq!(output.status.code(), Some(2), "{name}: {}", said(&output));
        assert!(said(&output).contains(words), "{words}: {}", said(&output));
        assert!(!site.path().join("new").exists(), "{name}");
    }
    let output = dynocar(&site, &["import", &track, "-o", "new", "--mass-t", "3"]);
    assert!(said(&output).contains("the files hold no train"), "{}", said(&output));
    let output = dynocar(&site, &["import", &track, "-o", "new", "--load", "2"]);
    assert!(said(&output).contains("expected a share from 0 to 1"), "{}", said(&output));
}

/// Returns a drawing as a browser sees it: its root, the number of its lines, its texts.
fn look(browser: &mut Browser, file: &Path) -> (String, u64, String) {
    browser.open(&format!("file://{}", file.display()));
    assert!(browser.conduct().console_errors.is_empty(), "{:?}", browser.conduct());
    let root = browser.value("document.documentElement.tagName");
    let lines = browser.value("document.querySelectorAll('polyline, path, line').length");
    let texts = browser
        .value("[...document.querySelectorAll('text')].map(it => it.textContent.trim()).join('|')");
    let text = |value: serde_json::Value| value.as_str().unwrap_or_default().to_string();
    (text(root), lines.as_u64().unwrap_or(0), text(texts))
}

#[test]
fn check_draws_the_line_and_the_effort_as_pictures_that_a_browser_opens() {
    let site = DaemonSite::new();
    import(&site, "ttobench_track.json", &[]);
    import(&site, "osrd_whole.json", &[]);
    let output = dynocar(&site, &["check", "made/track.toml", "--draw", "drawn"]);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert_eq!(said(&output), "drawn: drawn/line.svg\n");
    let output = dynocar(&site, &["check", "made/train.toml", "--draw", "drawn"]);
    assert_eq!(said(&output), "drawn: drawn/effort.svg\n");
    let mut browser = Browser::start(1280, false);
    let (root, lines, texts) = look(&mut browser, &site.path().join("drawn/line.svg"));
    assert_eq!(root, "svg");
    assert!(lines > 4 + 3, "{lines}");
    for label in
        ["Height above the start, m", "Gradient, ‰", "Permitted speed, km/h", "Curvature 1/R"]
    {
        assert!(texts.contains(label), "{label}: {texts}");
    }
    let (root, _, texts) = look(&mut browser, &site.path().join("drawn/effort.svg"));
    assert_eq!(root, "svg");
    assert!(texts.contains("traction") && texts.contains("resistance on level track"), "{texts}");
    let demo = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/demo");
    let output = dynocar(&site, &["check", demo, "--draw", "demo"]);
    assert!(said(&output).contains("drawn: demo/line.svg"), "{}", said(&output));
}

#[test]
fn what_cannot_be_drawn_is_said() {
    let site = DaemonSite::new();
    site.write("track.toml", "[track]\n");
    let output = dynocar(&site, &["check", "track.toml", "--draw", "drawn"]);
    assert_eq!(output.status.code(), Some(0));
    assert!(said(&output).starts_with("nothing drawn: no gradient"), "{}", said(&output));
    let config = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/daemon.toml");
    let output = dynocar(&site, &["check", config, "--draw", "drawn"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(said(&output).contains("--draw: expected a dataset, a train or a track"));
    site.write("file", "");
    let output = dynocar(&site, &["check", "track.toml", "--draw", "file"]);
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
}

#[test]
fn every_command_of_the_guide_of_imports_succeeds_on_files_of_that_kind() {
    let site = DaemonSite::new();
    install(&site);
    for (name, source) in [
        ("rolling_stock.yaml", "rolling_stock.yaml"),
        ("path.yaml", "running_path_2024.yaml"),
        ("CH_Track.json", "ttobench_track.json"),
        ("CH_Train.json", "ttobench_train.json"),
        ("tram.json", "osrd_whole.json"),
        ("express.json", "osrd_each_kg.json"),
    ] {
        std::fs::copy(corpus(source), site.path().join(name)).unwrap();
    }
    let guide = guide("imports.md");
    let commands = blocks(&guide, "sh");
    assert_eq!(commands.len(), 8, "a command that is new needs its files: {commands:?}");
    for line in &commands {
        let printed = run(&site, line);
        assert!(!line.contains(" --draw ") || printed.starts_with("drawn: "), "{line}: {printed}");
    }
    for file in ["my_train/line.svg", "my_train/effort.svg", "metro/track.toml"] {
        assert!(site.path().join(file).is_file(), "{file}");
    }
    for folder in ["my_train", "half_loaded", "metro", "tram", "express"] {
        load_train(&site.path().join(folder).join("train.toml")).unwrap();
    }
}
