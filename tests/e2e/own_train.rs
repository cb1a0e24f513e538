//! The guide for a new user's first half hour, command by command.

use std::fmt::Write as _;
use std::path::Path;

use dynocar::dataset::load;
use dynocar_analysis::dataset::Run;
use dynocar_shared::SampleField;
use dynocar_tests::process::{DaemonSite, Process};
use rustix::process::Signal;

use crate::commands::DYNOCAR;
use crate::guide::{ROOT, blocks, guide, install, run};

/// Returns a run of the demo in the form of a German recorder.
fn recording(run: &Run, header: &str) -> String {
    let comma = |value: f64, decimals: usize| format!("{value:.decimals$}").replace('.', ",");
    let mut text = format!("{header}\n");
    for sample in &run.samples {
        let of = |field| sample.get(field).unwrap_or(0.0);
        let cells = [
            comma(sample.time_ns as f64 * 1e-9, 1),
            comma(of(SampleField::Position), 1),
            comma(of(SampleField::Speed) * 3.6, 2),
            "80".into(),
            comma(of(SampleField::TractionForce) / 1e3, 2),
            comma(of(SampleField::BrakeForce) / 1e3, 2),
            comma(gradient_permille(of(SampleField::Position)), 2),
        ];
        writeln!(text, "{}", cells.join(";")).unwrap();
    }
    text
}

/// The gradient of the demo's line, climbing positive as the chainage grows.
fn gradient_permille(chainage_m: f64) -> f64 {
    use std::sync::OnceLock;
    static LINE: OnceLock<Vec<(f64, f64)>> = OnceLock::new();
    let line = LINE.get_or_init(|| {
        let demo = load(&Path::new(ROOT).join("config/demo")).unwrap();
        demo.track.unwrap().gradient().unwrap().entries().collect()
    });
    let before = line.iter().rev().find(|(from_m, _)| *from_m <= chainage_m);
    before.unwrap_or(&line[0]).1
}

/// Starts the daemon of a command line that ends in `&`, from the site's folder.
fn daemon(site: &DaemonSite, line: &str) -> Process {
    let config = line.split_whitespace().nth(3).expect("a configuration").to_owned();
    let config = site.path().join(config).display().to_string();
    let process = site.start(DYNOCAR, &["run", "--config", &config]);
    process.await_error("serving");
    process
}

#[test]
fn every_command_of_the_guide_succeeds_in_an_empty_folder() {
    let guide = guide("own_train.md");
    let site = DaemonSite::new();
    install(&site);
    let shown = blocks(&guide, "text");
    let demo = load(&Path::new(ROOT).join("config/demo")).unwrap();
    for (run, day) in demo.runs.iter().zip(["monday", "tuesday", "wednesday"]) {
        let text = recording(run, shown[0]);
        assert_eq!(text.lines().nth(1).map(|row| row.matches(';').count()), Some(6));
        site.write(&format!("{day}.csv"), &text);
    }
    let monday = std::fs::read_to_string(site.path().join("monday.csv")).unwrap();
    for row in &shown {
        assert!(monday.contains(row), "the guide shows {row}");
    }
    let commands = blocks(&guide, "sh");
    assert!(commands.len() >= 10, "the commands are found: {commands:?}");
    let mut running = Vec::new();
    for line in commands {
        if line.ends_with('&') {
            running.push(daemon(&site, line));
            continue;
        }
        run(&site, line);
    }
    assert_eq!(running.len(), 1, "the guide starts a daemon");
    for mut process in running {
        process.signal(Signal::TERM);
        assert_eq!(process.wait().code(), Some(0), "{}", process.errors());
    }
    let written = std::fs::read_to_string(site.path().join("my_train/dataset.toml")).unwrap();
    for line in blocks(&guide, "toml") {
        assert!(written.contains(line), "the guide shows {line:?}; written:\n{written}");
    }
    for file in ["report.html", "identified.json", "grown/train.toml", "man/dynocar.1"] {
        assert!(site.path().join(file).is_file(), "{file}");
    }
}
