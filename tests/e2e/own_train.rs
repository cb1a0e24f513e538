//! The guide of a new user's first half hour, command by command.

use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use dynocar::dataset::load;
use dynocar_core::dataset::Run;
use dynocar_shared::SampleField;
use dynocar_tests::process::{Process, Site};
use rustix::process::Signal;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");
const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

fn guide() -> String {
    std::fs::read_to_string(Path::new(ROOT).join("docs/guides/own_train.md")).expect("the guide")
}

/// The lines of the guide's code blocks in a language.
fn blocks<'g>(guide: &'g str, language: &str) -> Vec<&'g str> {
    let mark = format!("```{language}\n");
    let blocks = guide.split(&mark).skip(1).filter_map(|rest| rest.split("```").next());
    blocks.flat_map(str::lines).collect()
}

/// A run of the demo as a recorder with German habits would have written it.
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

fn shell(site: &Site, line: &str) -> Output {
    let path = std::env::var("PATH").unwrap_or_default();
    Command::new("sh")
        .args(["-c", line])
        .current_dir(site.path())
        .env("PATH", format!("{}:{path}", site.path().join("bin").display()))
        .env("DYNOCAR_ROOT", site.host().root())
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

/// Starts the daemon of a command line that ends in `&`, from the site's folder.
fn daemon(site: &Site, line: &str) -> Process {
    let config = line.split_whitespace().nth(3).expect("a configuration").to_owned();
    let config = site.path().join(config).display().to_string();
    let process = site.start(DYNOCAR, &["run", "--config", &config]);
    process.await_error("serving");
    process
}

#[test]
fn every_command_of_the_guide_succeeds_in_an_empty_folder() {
    let guide = guide();
    let site = Site::new();
    std::fs::create_dir(site.path().join("bin")).unwrap();
    std::os::unix::fs::symlink(DYNOCAR, site.path().join("bin/dynocar")).unwrap();
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
        let output = shell(&site, line);
        let words = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{line}: {words}");
        assert!(!words.contains("panicked"), "{line}: {words}");
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
