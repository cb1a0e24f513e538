//! Where a learner works in tests: a folder with simulated runs, a configuration and a store of models.

use std::ops::Range;
use std::path::PathBuf;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

use dynocar::models::{ModelText, Store, TrainModels};
use dynocar_shared::TrainId;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::process::{DaemonSite, Process};
use dynocar_tests::simulator::dataset_writer::dataset_files;
use dynocar_tests::simulator::{EffectRequest, SimulatorSettings, simulate};
use dynocar_workshop::learn::{Bounds, LearnerSettings};

pub const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");
pub const SEED: u64 = 23;
pub const TRAIN: TrainId = TrainId(1);
/// Longest time for an explanation, which takes seconds, and many times longer on a busy machine.
const PATIENCE: Duration = Duration::from_secs(540);

/// A site with simulated runs, a configuration that declares their train and line, and a store.
pub struct Workplace {
    pub site: DaemonSite,
    files: Vec<(String, String)>,
}

impl Workplace {
    /// No run lies there yet.
    pub fn from_kinds(kinds: &[EffectKind]) -> Self {
        Self::new(&SimulatorSettings::new(SEED, EffectRequest::Kinds(kinds.to_vec())))
    }

    pub fn new(settings: &SimulatorSettings) -> Self {
        let site = DaemonSite::new();
        let files = dataset_files(&simulate(settings));
        for name in ["train.toml", "track.toml"] {
            site.write(name, text(&files, name));
        }
        let config = "[[trains]]\nid = 1\nfile = \"train.toml\"\ntrack = \"track.toml\"\n\
                      [[pipelines]]\nkind = \"residual_monitor\"\n";
        site.write("daemon.toml", config);
        std::fs::create_dir(site.path().join("runs")).unwrap();
        Workplace { site, files }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.site.path().join(name)
    }

    /// Puts some of the runs there as a dataset of this name, which appears as a whole.
    pub fn record(&self, name: &str, runs: Range<usize>) {
        let part = self.path("part");
        std::fs::create_dir_all(part.join("runs")).unwrap();
        let mut manifest: toml::Table = text(&self.files, "dataset.toml").parse().unwrap();
        let own = manifest["runs"].as_array().unwrap()[runs].to_vec();
        for (path, text) in &self.files {
            if !path.ends_with(".csv") || own.iter().any(|run| run["file"].as_str() == Some(path)) {
                std::fs::write(part.join(path), text).unwrap();
            }
        }
        manifest.insert("runs".into(), own.into());
        std::fs::write(part.join("dataset.toml"), manifest.to_string()).unwrap();
        std::fs::rename(part, self.path("runs").join(name)).unwrap();
    }

    pub fn arguments(&self) -> Vec<String> {
        let named = [("--config", "daemon.toml"), ("--runs", "runs"), ("--models", "models")];
        let named =
            named.map(|(option, name)| [option.into(), self.path(name).display().to_string()]);
        std::iter::once("learn".to_owned()).chain(named.into_iter().flatten()).collect()
    }

    /// Learns once; returns the printed text.
    pub fn learn(&self, more: &[&str]) -> String {
        let output = self.learn_once(more);
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{said}{errors}");
        said + &errors
    }

    pub fn learn_once(&self, more: &[&str]) -> Output {
        let mut command = Command::new(DYNOCAR);
        command.args(self.arguments()).arg("--once").args(more).output().expect("the program")
    }

    /// A learner that goes on.
    pub fn start(&self, more: &[&str]) -> Process {
        let arguments = self.arguments();
        let words: Vec<&str> =
            arguments.iter().map(String::as_str).chain(more.iter().copied()).collect();
        self.site.start(DYNOCAR, &words)
    }

    /// Those of a learner within this process.
    pub fn settings(&self, declared: ModelText, bounds: Bounds) -> LearnerSettings {
        LearnerSettings {
            store: Store::at(&self.path("models")),
            runs: self.path("runs"),
            trains: vec![(TRAIN, declared)],
            bounds,
            command: String::new(),
        }
    }

    pub fn models(&self) -> TrainModels {
        Store::at(&self.path("models")).train(TRAIN)
    }

    /// `dynocar models` with these words: exit status, standard output, standard error.
    pub fn say(&self, words: &[&str]) -> (Option<i32>, String, String) {
        let output = Command::new(DYNOCAR)
            .arg("models")
            .args(words)
            .arg("--models")
            .arg(self.path("models"))
            .output()
            .expect("the program");
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (output.status.code(), text(&output.stdout), text(&output.stderr))
    }
}

fn text<'f>(files: &'f [(String, String)], name: &str) -> &'f str {
    &files.iter().find(|(path, _)| path == name).expect("a file").1
}

pub fn await_long(mut condition: impl FnMut() -> bool, what: impl Fn() -> String) {
    let start = Instant::now();
    while !condition() {
        assert!(start.elapsed() < PATIENCE, "no {}", what());
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Models that were learned, not declared.
pub fn learned(models: &TrainModels) -> Vec<dynocar::models::Stored> {
    let listing = models.list().unwrap();
    listing.models.into_iter().filter(|it| it.origin.parent.is_some()).collect()
}
