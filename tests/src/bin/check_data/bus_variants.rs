//! Variants of the bus's trips left out: mapped as another day's recordings, and with the force computed from power.

use std::path::Path;

use dynocar::dataset;
use dynocar_analysis::dataset::{Dataset, Role};
use dynocar_analysis::explain::answer::WithStd;
use dynocar_analysis::explain::evidence::{Density, FitProblem};
use dynocar_analysis::explain::{explain, found_forces};
use dynocar_model::train::PowerTrain;
use dynocar_shared::SampleField;
use dynocar_workshop::survey::survey_folder;

/// Greatest increase in m/s of the error of recordings, over all pairs of trips, if they are mapped rather than
/// surveyed with the others.
const WORSE_MAX_MPS: f64 = 0.01;
/// Range of the efficiency from a linear regression of the recorded force on power, without any balance of forces.
const EFFICIENCY: [f64; 2] = [0.90, 0.96];
/// Largest difference between the force computed from power and the recorded force, as a share of the latter: one and a
/// half times the residual of such a regression (8 %).
const APART_MAX: f64 = 0.12;

/// Errors over 60 s in m/s of two trips: mapped as another day's, and surveyed with the others.
#[derive(Clone, Copy, Debug)]
pub struct OtherDay {
    apart_mps: f64,
    together_mps: f64,
}

/// Estimates from the power of six trips, and their errors on the two left out.
#[derive(Clone, Copy, Debug)]
pub struct ByPower {
    efficiency: WithStd,
    auxiliaries_kw: WithStd,
    /// Root mean square difference from the recorded force, as a share of it.
    apart: f64,
    /// Error over 60 s in m/s.
    error_mps: f64,
}

fn root_mean_square(values: impl Iterator<Item = f64>) -> f64 {
    let (count, sum) = values.fold((0.0, 0.0), |(n, sum), it| (n + 1.0, sum + it * it));
    f64::sqrt(sum / count)
}

/// Returns the verdict on all pairs mapped as another day's.
pub fn other_days(pairs: &[OtherDay]) -> Result<String, String> {
    let each: Vec<f64> = pairs.iter().map(|it| it.apart_mps).collect();
    let apart_mps = root_mean_square(each.iter().copied());
    let together_mps = root_mean_square(pairs.iter().map(|it| it.together_mps));
    let words = format!(
        "{apart_mps:.3} m/s, by pair {each:.3?}, surveyed with the others {together_mps:.3} m/s"
    );
    if apart_mps <= together_mps + WORSE_MAX_MPS { Ok(words) } else { Err(words) }
}

/// Returns the verdict on all pairs with their force from power.
pub fn powers(pairs: &[ByPower]) -> Result<String, String> {
    let apart = root_mean_square(pairs.iter().map(|it| it.apart));
    let error_mps = root_mean_square(pairs.iter().map(|it| it.error_mps));
    let estimated = |it: WithStd| format!("{:.3} ± {:.3}", it.value, 1.96 * it.std);
    let efficiencies: Vec<String> = pairs.iter().map(|it| estimated(it.efficiency)).collect();
    let kw: Vec<String> = pairs.iter().map(|it| estimated(it.auxiliaries_kw)).collect();
    let words = format!(
        "efficiency {}, auxiliaries {} kW, {:.1} % of the recorded force apart, {error_mps:.3} m/s",
        efficiencies.join(", "),
        kw.join(", "),
        100.0 * apart
    );
    let is_inside = |it: &ByPower| (EFFICIENCY[0]..=EFFICIENCY[1]).contains(&it.efficiency.value);
    if pairs.iter().all(is_inside) && apart <= APART_MAX { Ok(words) } else { Err(words) }
}

/// Open-loop error over 60 s in m/s of the runs held out of a dataset.
fn held_out_mps(dataset: &Dataset) -> Result<f64, String> {
    let explained = explain(dataset, &|_, _| {}).map_err(|error| error.to_string())?;
    let error = explained.score.holdout_window60[0].rmse_mps();
    error.ok_or_else(|| "no trip is held out".into())
}

/// Maps the recordings of the trips held out on the line that was surveyed without them, as another day's recordings of
/// the learned train, and compares their errors on that line.
pub fn of_another_day(
    raw: &Path,
    surveyed: &Path,
    held_out: [usize; 2],
) -> Result<OtherDay, String> {
    let words = |error: std::io::Error| error.to_string();
    let together_mps = held_out_mps(&loaded(surveyed)?)?;
    let day = tempfile::tempdir().map_err(words)?;
    let out = tempfile::tempdir().map_err(words)?;
    std::fs::create_dir(day.path().join("runs")).map_err(words)?;
    std::fs::copy(surveyed.join("train.toml"), day.path().join("train.toml")).map_err(words)?;
    let manifest = std::fs::read_to_string(raw.join("dataset.toml")).map_err(words)?;
    let mut manifest = manifest.split("[[runs]]").next().unwrap_or_default().to_string();
    for trip in held_out {
        let file = format!("runs/{trip}.csv");
        std::fs::copy(raw.join(&file), day.path().join(&file)).map_err(words)?;
        manifest += &format!("[[runs]]\nfile = \"{file}\"\n");
    }
    std::fs::write(day.path().join("dataset.toml"), manifest).map_err(words)?;
    let line = surveyed.join("track.toml");
    let mapped = survey_folder(day.path(), Some(&line), out.path());
    let mapped = mapped.map_err(|error| error.to_string())?.answer.trips;
    let trips = loaded(surveyed)?;
    let files: Vec<&String> =
        trips.runs.iter().filter(|run| run.role == Role::Holdout).map(|run| &run.file).collect();
    if mapped.len() != files.len() {
        return Err(format!("{} trips mapped, {} held out", mapped.len(), files.len()));
    }
    let whole = tempfile::tempdir().map_err(words)?;
    copy_dataset(surveyed, whole.path()).map_err(words)?;
    for (trip, file) in mapped.iter().zip(files) {
        std::fs::copy(out.path().join(&trip.file), whole.path().join(file)).map_err(words)?;
    }
    let apart_mps = held_out_mps(&loaded(whole.path())?)?;
    Ok(OtherDay { apart_mps, together_mps })
}

/// Takes the force of a surveyed dataset from the power that is recorded with it.
pub fn by_power(surveyed: &Path) -> Result<ByPower, String> {
    let words = |error: std::io::Error| error.to_string();
    let folder = tempfile::tempdir().map_err(words)?;
    copy_dataset(surveyed, folder.path()).map_err(words)?;
    let manifest = std::fs::read_to_string(surveyed.join("dataset.toml")).map_err(words)?;
    let without = manifest.lines().filter(|line| !line.starts_with("control_force"));
    let without: Vec<&str> = without.collect();
    std::fs::write(folder.path().join("dataset.toml"), without.join("\n")).map_err(words)?;
    let (recorded, powered) = (loaded(surveyed)?, loaded(folder.path())?);
    let (problem, _) =
        FitProblem::of(&powered, Density::Recorded).map_err(|error| error.to_string())?;
    let declared = powered.train.drive;
    let estimated = found_forces::estimated_drive(&problem, declared).ok_or("no power")?;
    let apart = apart(&recorded, &powered.with_drive(estimated.drive))?;
    let error_mps = held_out_mps(&powered)?;
    let auxiliaries_kw = estimated.answer.auxiliary_power_kw.ok_or("no auxiliaries")?;
    Ok(ByPower { efficiency: estimated.answer.efficiency, auxiliaries_kw, apart, error_mps })
}

/// Returns the root mean square difference of the control forces of the runs held out, as a share of that of the
/// recorded ones.
fn apart(recorded: &Dataset, powered: &Dataset) -> Result<f64, String> {
    let (mut difference, mut size) = (0.0, 0.0);
    let pairs =
        recorded.runs.iter().zip(&powered.runs).filter(|(run, _)| run.role == Role::Holdout);
    for (one, other) in pairs.flat_map(|(one, other)| one.samples.iter().zip(&other.samples)) {
        let control = |sample: &dynocar_shared::TrainSample| {
            Some(sample.get(SampleField::TractionForce)? - sample.get(SampleField::BrakeForce)?)
        };
        if one.speed_mps < PowerTrain::USUAL.speed_min_mps {
            continue;
        }
        let Some((one_n, other_n)) = control(one).zip(control(other)) else { continue };
        difference += (one_n - other_n) * (one_n - other_n);
        size += one_n * one_n;
    }
    if size > 0.0 { Ok(f64::sqrt(difference / size)) } else { Err("no forces".into()) }
}

fn loaded(folder: &Path) -> Result<Dataset, String> {
    dataset::load(folder).map_err(|error| error.to_string())
}

fn copy_dataset(from: &Path, to: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(to.join("runs"))?;
    for folder in ["", "runs"] {
        for entry in std::fs::read_dir(from.join(folder))? {
            let entry = entry?;
            if entry.file_type()?.is_file() {
                std::fs::copy(entry.path(), to.join(folder).join(entry.file_name()))?;
            }
        }
    }
    Ok(())
}
