//! The dataset that a survey makes.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use dynocar_analysis::dataset::keys::{self, run, track};
use dynocar_analysis::dataset::written::{TomlText, set};
use dynocar_analysis::dataset::{DatasetFiles, MANIFEST_FILE};
use dynocar_analysis::survey::alignment::FoundCurve;
use dynocar_analysis::survey::layout::HEIGHT_STEP_M;
use dynocar_analysis::survey::profile::GradientEntry;
use dynocar_analysis::survey::stops::SurveyedStop;
use dynocar_analysis::survey::{Survey, SurveyedProfile};
use dynocar_model::train::numbers::{
    DAVIS_A, DAVIS_B, DAVIS_C, FORCE_PER_PRESSURE, MASS, PASSENGER_MASS, RELEASE_PRESSURE,
};
use toml::{Table, Value};

use super::read::{Material, SurveyFailure};
use super::trip_rows::{TripColumn, columns, run_csv};
use crate::dataset::open;
use dynocar::models::text::{TRACK_FILE, TRAIN_FILE};
use dynocar::output::{require_replaceable, write_in_folder};

/// Length of the beginning by which a file of a survey is known.
const MARK_LENGTH: usize = 20;
/// First line of a survey's TOML files.
const MARK: &str = "# By `dynocar survey`";
/// A profile reaches beyond its alignment by this many m.
const BEYOND_M: f64 = 60.0;

/// The file of a trip, from its number from 0.
pub fn trip_file(number: usize) -> String {
    format!("runs/{:03}.csv", number + 1)
}

/// Writes the whole folder; gives its files.
///
/// # Errors
///
/// When a declared file cannot be read or one cannot be written.
pub fn write(material: &Material, folder: &Path) -> Result<Vec<PathBuf>, SurveyFailure> {
    let mut files: Vec<(String, String)> = vec![
        (TRAIN_FILE.into(), train_toml(material)?),
        (MANIFEST_FILE.into(), dataset_toml(material)),
    ];
    match material.line {
        Some(line) => files.extend(copied_line(line)?),
        None => {
            files.push((TRACK_FILE.into(), track_toml(material)));
            files.push(("alignment.csv".into(), alignment(material.survey, 1)));
            if !material.survey.alignments.is_one_track() {
                files.push(("alignment_falling.csv".into(), alignment(material.survey, -1)));
            }
        }
    }
    for (number, trip) in material.survey.trips.iter().enumerate() {
        files.push((trip_file(number), run_csv(material, trip)));
    }
    for (name, text) in &files {
        // A file that begins otherwise was not written by a survey: the raw recordings, most likely.
        let mark = text.get(..MARK_LENGTH.min(text.len())).unwrap_or_default();
        require_replaceable(&folder.join(name), mark)?;
    }
    let written = files.iter().map(|(name, text)| {
        let path = folder.join(name);
        let parent = path.parent().unwrap_or(folder);
        let file = path.file_name().and_then(|name| name.to_str()).unwrap_or(name);
        Ok(write_in_folder(parent, file, text)?)
    });
    written.collect()
}

/// A known line with its alignments, under their own names.
fn copied_line(line: &Path) -> Result<Vec<(String, String)>, SurveyFailure> {
    let read = |path: &Path| {
        dynocar::dataset::read_text(path).map_err(|problem| SurveyFailure::SurveyedLine {
            path: path.into(),
            problem: problem.to_string(),
        })
    };
    let track = dynocar::dataset::load_track(line)?;
    let mut files = vec![(TRACK_FILE.to_string(), read(line)?)];
    for name in [&track.survey.alignment, &track.survey.alignment_falling].into_iter().flatten() {
        files.push((name.clone(), read(&line.parent().unwrap_or(Path::new(".")).join(name))?));
    }
    Ok(files)
}

/// The declared train with what was learned.
fn train_toml(material: &Material) -> Result<String, SurveyFailure> {
    let (files, head) = open(material.source)?;
    let path = &head.manifest.train_file.path;
    let wrong = |problem: String| SurveyFailure::SurveyedLine { path: path.into(), problem };
    let text = files.read(path).map_err(|problem| wrong(problem.to_string()))?;
    let Some(profile) = &material.survey.profile else {
        return Ok(format!("{MARK}: {path} as declared.\n{text}"));
    };
    let mut train: Table =
        text.parse().map_err(|error: toml::de::Error| wrong(error.message().to_string()))?;
    let common = &profile.learned.profile.common;
    let mut set = |key, value| set(&mut train, key, value);
    for (key, value) in [&DAVIS_A, &DAVIS_B, &DAVIS_C].into_iter().zip(common.davis()) {
        set(key, rounded(value, 1e-6));
    }
    let prior = &material.vehicle.prior;
    if !prior.is_weighed {
        set(&MASS, rounded(prior.mass_kg * (1.0 + common.mass_share()) / 1e3, 1e-4));
    }
    if prior.has_passengers {
        set(&PASSENGER_MASS, rounded(common.passenger_kg(), 0.01));
    }
    if let Some(brake) = &profile.learned.brake {
        set(&FORCE_PER_PRESSURE, rounded(brake.gain_n_per_pa.value, 1e-5));
        set(&RELEASE_PRESSURE, rounded(brake.release_pa, 1.0));
    }
    let inertial_t =
        prior.mass_kg * (1.0 + common.mass_share()) * (1.0 + prior.rotating_mass_factor) / 1e3;
    Ok(format!(
        "{MARK} from {path}: mass, resistance and brake as the balance of forces has them.\n\
         # Rotating parts inside, the vehicle weighs {inertial_t:.2} t; the rotating share stays as declared.\n{train}"
    ))
}

fn rounded(value: f64, step: f64) -> f64 {
    (value / step).round() / (1.0 / step).round()
}

fn dataset_toml(material: &Material) -> String {
    let dataset = material.dataset;
    let quoted = |text: &str| Value::String(text.into());
    let named = |name: &str| format!("\"{name}\"");
    let mut text = TomlText::new(&format!("{MARK}.\n"), keys::dataset::TABLE);
    text.value(&keys::dataset::NAME, quoted(&dataset.name));
    if let Some(description) = &dataset.description {
        text.value(&keys::dataset::DESCRIPTION, quoted(description));
    }
    text.table(keys::train_file::TABLE);
    text.value(&keys::train_file::FILE, named(TRAIN_FILE));
    text.table(keys::track_file::TABLE);
    text.value(&keys::track_file::FILE, named(TRACK_FILE));
    text.table(keys::column::TABLE);
    for TripColumn { quantity, unit, .. } in columns(dataset) {
        text.plain_column(quantity, quantity.name(), unit);
    }
    for (number, trip) in material.survey.trips.iter().enumerate() {
        text.next_table(run::TABLE);
        text.value(&run::FILE, named(&trip_file(number)));
        text.value(&run::ROLE, named(dataset.runs[trip.recording].role.name()));
        text.value(&run::DIRECTION, trip.direction);
    }
    text.into_text()
}

/// Entries of (chainage in m, gradient and its standard deviation in ‰) of a direction's profile,
/// climbing positive as the chainage grows.
pub fn gradient_entries(
    survey: &Survey,
    profile: &SurveyedProfile,
    direction: i8,
) -> Vec<GradientEntry> {
    let alignments = &survey.alignments;
    let block = usize::from(direction < 0);
    let length_m = alignments.of(direction).map_or(0.0, |alignment| alignment.length_m());
    let entries = profile.learned.profile.gradient_permille(block);
    let driven_m = -BEYOND_M - HEIGHT_STEP_M..length_m + BEYOND_M;
    let mut list = entries;
    list.retain(|it| driven_m.contains(&it.from_m));
    for it in &mut list {
        // A cell's end along the falling alignment is its start by chainage.
        let (sign, start_m) = if direction == 1 { (1, 0.0) } else { (-1, HEIGHT_STEP_M) };
        it.from_m = alignments.chainage_m(sign, it.from_m + start_m);
        it.gradient_permille *= f64::from(sign);
    }
    list.sort_by(|one, other| one.from_m.total_cmp(&other.from_m));
    list
}

fn track_toml(material: &Material) -> String {
    let survey = material.survey;
    let Some(profile) = &survey.profile else { return String::new() };
    let alignments = &survey.alignments;
    let name = Value::String(format!("{}, surveyed", material.dataset.name));
    let mut text =
        TomlText::new(&format!("{MARK} from {} passes.\n", profile.trips.len()), track::TABLE);
    text.value(&track::NAME, name);
    text.value(&track::LENGTH, format!("{:.1}", alignments.length_m()));
    text.value(&track::ALIGNMENT, "\"alignment.csv\"");
    let growing = gradient_entries(survey, profile, 1);
    let bounded = |gradient: f64| gradient.clamp(-149.0, 149.0);
    let entry =
        |it: &GradientEntry| format!("{:.2}, {:.3}", it.from_m, bounded(it.gradient_permille));
    text.list(&track::GRADIENT, growing.iter().map(entry));
    let stds = growing.iter().step_by(5);
    text.list(
        &track::GRADIENT_STD,
        stds.map(|it| format!("{:.2}, {:.3}", it.from_m, it.std_permille.min(149.0))),
    );
    if !alignments.is_one_track() {
        let falling = gradient_entries(survey, profile, -1);
        text.list(&track::GRADIENT_FALLING, falling.iter().map(entry));
    } else {
        let per_m = alignments.chainage_per_m;
        let entry = |curve: &FoundCurve| {
            let (from_m, to_m) = (per_m * curve.from_m, per_m * curve.to_m);
            format!("{from_m:.1}, {to_m:.1}, {:.1}", curve.radius_m)
        };
        text.list(&track::CURVES, profile.curves.iter().map(entry));
    }
    let stop = |stop: &SurveyedStop| {
        format!("{:.1}, {}", stop.chainage_m, Value::String(stop.name.clone()))
    };
    text.list(&track::STOPS, survey.stops.iter().map(stop));
    if !alignments.is_one_track() {
        text.value(&track::ALIGNMENT_FALLING, "\"alignment_falling.csv\"");
    }
    text.into_text()
}

fn alignment(survey: &Survey, direction: i8) -> String {
    let mut text = String::from("chainage_m,latitude_deg,longitude_deg\n");
    let Some(alignment) = survey.alignments.of(direction) else { return text };
    for (node, &at_m) in alignment.nodes_m().iter().enumerate() {
        let chainage_m = survey.alignments.chainage_m(direction, node as f64 * alignment.step_m());
        let [latitude, longitude] = survey.plane.unproject(at_m);
        let _ = writeln!(text, "{chainage_m:.3},{latitude:.8},{longitude:.8}");
    }
    text
}
