//! Files of other projects: every valid one is imported, every invalid one refused, and an imported train of
//! railtoolkit has the figures of railtoolkit's own program.

use std::path::{Path, PathBuf};

use dynocar_analysis::import::{ImportReading, ImportSource, Imported, import};

use super::Report;
use super::trainruns::{THEIR_GRAVITY_MPS2, TRAINS};

/// Largest relative difference from figures that were read from results.
const TOLERANCE: f64 = 1e-6;

/// Checks the files of `imports` and of `independent/trainruns`.
pub fn check(report: &mut Report, folder: &Path) {
    let railtoolkit = folder.join("imports/railtoolkit");
    for version in ["2022.05", "main"] {
        for kind in ["rolling-stock", "running-path"] {
            let tests = railtoolkit.join(version).join("test").join(kind);
            let valid = files(&tests.join("valid"));
            // Trains stand in another file than their vehicles.
            let outcome = read(&valid, 0.0).and_then(|it| some(&it));
            report.note(&format!("railtoolkit {version}: valid {kind} is imported"), outcome);
            for invalid in files(&tests.join("invalid")) {
                let outcome = refused(&invalid, &valid);
                report.note(&format!("{} is refused", invalid.display()), outcome);
            }
        }
    }
    for track in files(&folder.join("imports/ttobench/tracks")) {
        if track.extension().is_some_and(|extension| extension == "json") {
            let outcome = read(std::slice::from_ref(&track), 0.0).and_then(|it| some(&it));
            report.note(&format!("{} is imported", track.display()), outcome);
        }
    }
    let trainruns = folder.join("independent/trainruns");
    for train in &TRAINS {
        let file = trainruns.join(format!("train_{}.yaml", train.name));
        let outcome = read(&[file], 1.0).and_then(|it| {
            let found = it.trains.first().ok_or("no train")?;
            let davis = found.resistance.ok_or("no resistance")?;
            let factor = found.rotating_mass_factor.ok_or("no rotating mass")?;
            let mass_kg = found.mass_kg.unwrap_or_default();
            let weight_kn = mass_kg * THEIR_GRAVITY_MPS2 / 1000.0;
            let pairs = [
                (mass_kg, train.mass_kg),
                (found.length_m.unwrap_or_default(), train.length_m),
                (mass_kg * (1.0 + factor), train.inertia_kg),
                (davis.a * weight_kn, train.resistance[0]),
                (davis.b * weight_kn, train.resistance[1]),
                (davis.c * weight_kn, train.resistance[2]),
            ];
            let worst = pairs.map(|(found, stated)| (found / stated - 1.0).abs());
            let worst = worst.into_iter().fold(0.0, f64::max);
            let detail = format!("at most {worst:.1e} away");
            if worst <= TOLERANCE { Ok(detail) } else { Err(format!("{detail}: {pairs:?}")) }
        });
        report.note(&format!("TrainRuns.jl: the imported {} train", train.name), outcome);
    }
    for path in ["const", "slope", "speed", "realworld"] {
        let file = trainruns.join(format!("path_{path}.yaml"));
        let outcome = read(&[file], 0.0).and_then(|it| some(&it));
        report.note(&format!("TrainRuns.jl: the path {path} is imported"), outcome);
    }
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    files.sort();
    files
}

fn read(files: &[PathBuf], load_share: f64) -> Result<Imported, String> {
    let mut texts = Vec::new();
    for file in files {
        let label = file.display().to_string();
        let text = std::fs::read_to_string(file).map_err(|error| format!("{label}: {error}"))?;
        texts.push((label, text));
    }
    let sources: Vec<ImportSource> =
        texts.iter().map(|(label, text)| ImportSource { label, text }).collect();
    let reading = ImportReading { load_share, mode: None };
    import(&sources, None, &reading).map_err(|error| error.to_string())
}

fn some(imported: &Imported) -> Result<String, String> {
    match (imported.trains.len(), imported.lines.len()) {
        (0, 0) => Err("nothing came out".into()),
        (trains, lines) => Ok(format!("{trains} trains, {lines} lines")),
    }
}

/// An invalid file must be refused for its own sake: trains get the vehicles that they are made of.
fn refused(invalid: &Path, valid: &[PathBuf]) -> Result<String, String> {
    let text = std::fs::read_to_string(invalid).map_err(|error| error.to_string())?;
    let mut files = vec![invalid.to_path_buf()];
    if text.contains("trains:") {
        let is_stock = |file: &&PathBuf| file.file_stem().is_some_and(|name| name == "vehicles");
        files.extend(valid.iter().filter(is_stock).cloned());
    }
    match read(&files, 0.0) {
        Ok(_) => Err("it was imported".into()),
        Err(words) => Ok(words),
    }
}
