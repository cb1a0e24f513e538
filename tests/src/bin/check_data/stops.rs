//! Results of a measured emergency stop.

use std::path::Path;

use dynocar::dataset;
use dynocar_analysis::stops::{FindSettings, Study, StudySettings};

use super::Report;

const MANIFEST: &str = "[dataset]\nname = \"stop\"\n[train]\nfile = \"train.toml\"\n[columns]\n\
    time = { column = \"time_ms\", unit = \"ms\" }\n\
    speed = { column = \"FR_Hz\", unit = \"mph\", scale = 0.488953 }\n\
    brake_handle = { column = \"VRD_pct\", unit = \"1\", scale = -0.02326, offset = 1.0 }\n\
    [[runs]]\nfile = \"run.csv\"\n";
const TRAIN: &str = "[train]\nmass_t = 240\nlength_m = 104\ncars = 4\nrotating_mass_factor = 0.08\n\
    [resistance]\na = 1.5\nb = 0.02\nc = 0.0008\n[brake]\nmax_force_kn = 200\n";

/// Compares the deceleration of the recorded stop with an independent evaluation of the same data.
pub fn check(report: &mut Report, folder: &Path) {
    let source = folder.join("measured/metra-highliner/runs/10-48.csv");
    report.note(&format!("{}: the stop is read", source.display()), decelerations(&source));
}

fn decelerations(source: &Path) -> Result<String, String> {
    let words = |error: std::io::Error| error.to_string();
    let place = tempfile::tempdir().map_err(words)?;
    std::fs::write(place.path().join("dataset.toml"), MANIFEST).map_err(words)?;
    std::fs::write(place.path().join("train.toml"), TRAIN).map_err(words)?;
    std::fs::copy(source, place.path().join("run.csv")).map_err(words)?;
    let dataset = dataset::load(place.path()).map_err(|error| error.to_string())?;
    let settings = StudySettings { find: FindSettings::default(), repeatability: 0.03 };
    let study = Study::new(&dataset, &settings, &[]);
    let law = study.law.ok_or("no stop is found")?;
    let mean = |from_mps: f64, to_mps: f64| {
        let within = law.points.iter().filter(|it| (from_mps..=to_mps).contains(&it.speed_mps));
        let (count, sum) =
            within.fold((0.0, 0.0), |(n, sum), it| (n + 1.0, sum + it.deceleration_mps2));
        sum / count
    };
    let (fast, slow) = (mean(25.0, 30.0), mean(5.0, 10.0));
    let detail = format!("{fast:.3} m/s² at 25 to 30 m/s, {slow:.3} at 5 to 10");
    let is_right = (fast - 0.40).abs() < 0.03 && (slow - 0.90).abs() < 0.06;
    if is_right { Ok(detail) } else { Err(detail) }
}
