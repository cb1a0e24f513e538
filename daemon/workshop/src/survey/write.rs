//! The dataset that a survey makes: its description, and the file of each trip in SI units, with a chainage for each
//! row and each force at the time when it acts.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use dynocar::models::text::{TRACK_FILE, TRAIN_FILE};
use dynocar::output::{require_replaceable, write_in_folder};
use dynocar_analysis::dataset::keys::{run, track};
use dynocar_analysis::dataset::written::{TomlText, set};
use dynocar_analysis::dataset::{
    Dataset, DatasetFiles, ForceSource, MANIFEST_FILE, Quantity, Run, is_stamped_late, keys,
    stamped_late,
};
use dynocar_analysis::survey::alignment::FoundCurve;
use dynocar_analysis::survey::normal::HEIGHT_STEP_M;
use dynocar_analysis::survey::profile::GradientEntry;
use dynocar_analysis::survey::trips::SurveyedStop;
use dynocar_analysis::survey::{Survey, SurveyedProfile, Trip};
use dynocar_model::train::numbers::{
    DAVIS_A, DAVIS_B, DAVIS_C, FORCE_PER_PRESSURE, MASS, PASSENGER_MASS, RELEASE_PRESSURE,
};
use dynocar_shared::{SampleField, TrainSample};
use toml::{Table, Value};

use super::read::{Material, SurveyFailure, rows_in_order};
use crate::dataset::open;

/// Length of the beginning by which a file of a survey is recognised.
const MARK_LENGTH: usize = 20;
/// First line of a survey's TOML files.
const MARK: &str = "# By `dynocar survey`";
/// A profile reaches beyond its alignment by this many m.
const BEYOND_M: f64 = 60.0;

/// Returns the file of a trip, from its number from 0.
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

/// Returns a known line with its alignments, under their own names.
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

/// Returns the declared train with the learned values.
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
    text.value(&track::LENGTH, format!("{:.1}", survey.length_m()));
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

/// Returns the seconds by which forces are stamped late and are moved, 0 for none.
pub fn late_s(survey: &Survey) -> f64 {
    let Some(profile) = &survey.profile else { return 0.0 };
    let (late_s, std_s) =
        (profile.learned.profile.common.delay_s(), profile.learned.profile.common_std.delay_s());
    // A force that acts after its stamp is an actuator's delay, which is explained, not mended.
    if is_stamped_late(late_s, std_s) { late_s } else { 0.0 }
}

/// Where a column's values are from.
#[derive(Clone, Copy)]
enum Source {
    /// A field of the samples.
    Field(SampleField),
    /// Quantity recorded in addition to the samples.
    Extra,
    /// Made of several, see `run_csv`.
    Made,
}

/// A column of the trips' files.
#[derive(Clone, Copy)]
pub struct TripColumn {
    /// Quantity of the column.
    pub quantity: Quantity,
    /// Its unit.
    pub unit: &'static str,
    decimals: usize,
    source: Source,
}

/// Every column that there may be.
const COLUMNS: [TripColumn; 19] = {
    use Source::{Extra, Field, Made};
    [
        column(Quantity::Time, "s", 3, Made),
        column(Quantity::Position, "m", 2, Made),
        column(Quantity::Speed, "m/s", 4, Made),
        column(Quantity::ControlForce, "N", 1, Made),
        column(Quantity::TractionForce, "N", 1, Made),
        column(Quantity::BrakeForce, "N", 1, Made),
        column(Quantity::BrakeCylinderPressure, "Pa", 1, Field(SampleField::BrakeCylinderPressure)),
        column(Quantity::TractionPower, "W", 0, Extra),
        column(Quantity::LinePower, "W", 0, Extra),
        column(Quantity::Acceleration, "m/s2", 5, Field(SampleField::Acceleration)),
        column(Quantity::SpecificForce, "m/s2", 5, Field(SampleField::SpecificForce)),
        column(Quantity::TrainMass, "kg", 1, Made),
        column(Quantity::Passengers, "1", 0, Extra),
        column(Quantity::AmbientTemperature, "degC", 2, Field(SampleField::AmbientTemperature)),
        column(Quantity::Altitude, "m", 2, Extra),
        column(Quantity::Latitude, "deg", 7, Extra),
        column(Quantity::Longitude, "deg", 7, Extra),
        column(Quantity::DoorOpen, "1", 0, Extra),
        column(Quantity::WheelSlide, "1", 0, Made),
    ]
};

const fn column(
    quantity: Quantity,
    unit: &'static str,
    decimals: usize,
    source: Source,
) -> TripColumn {
    TripColumn { quantity, unit, decimals, source }
}

/// Returns the columns of a dataset's trips.
pub fn columns(dataset: &Dataset) -> Vec<TripColumn> {
    let any = |is_there: &dyn Fn(&Run) -> bool| dataset.runs.iter().any(is_there);
    let has = |field: SampleField| any(&|run| run.samples.iter().any(|it| it.get(field).is_some()));
    let is_signed = any(&|run| run.traction_source == ForceSource::ControlForce);
    let is_there = |column: &TripColumn| match (column.source, column.quantity) {
        (Source::Field(field), _) => has(field),
        (Source::Extra, quantity) => any(&|run| run.extra(quantity).is_some()),
        (_, Quantity::ControlForce) => is_signed,
        (_, Quantity::TractionForce) => !is_signed && has(SampleField::TractionForce),
        (_, Quantity::BrakeForce) => !is_signed && any(&has_own_brake),
        (_, Quantity::TrainMass) => has(SampleField::Mass),
        (_, Quantity::WheelSlide) => any(&|run| run.samples.iter().any(|it| it.flags != 0)),
        _ => true,
    };
    COLUMNS.into_iter().filter(is_there).collect()
}

/// Returns whether the brake force has a source of its own besides the pressure.
fn has_own_brake(run: &Run) -> bool {
    !matches!(run.brake_source, ForceSource::None | ForceSource::Pressure)
}

/// Returns the text of a trip's file.
pub fn run_csv(material: &Material, trip: &Trip) -> String {
    let columns = columns(material.dataset);
    let run = &material.dataset.runs[trip.recording];
    let ordered = rows_in_order(run);
    let late_s = late_s(material.survey);
    let traction = |sample: &TrainSample| sample.get(SampleField::TractionForce);
    let own_brake = |sample: &TrainSample| {
        let friction =
            material.dataset.train.brake_gear.friction_brake.and_then(|brake| {
                Some(brake.force_n(sample.get(SampleField::BrakeCylinderPressure)?))
            });
        Some(sample.get(SampleField::BrakeForce)? - friction.unwrap_or(0.0))
    };
    let names: Vec<&str> = columns.iter().map(|column| column.quantity.name()).collect();
    let mut text = names.join(",") + "\n";
    for (row, &along_m) in trip.rows().zip(&trip.along.chainage_m) {
        let sample = &run.samples[ordered[row]];
        let next = ordered.get(row + 1).map(|&next| &run.samples[next]).filter(|_| late_s > 0.0);
        let late = |force: &dyn Fn(&TrainSample) -> Option<f64>| {
            let here = force(sample)?;
            let Some(next) = next else { return Some(here) };
            let step_s = (next.time_ns - sample.time_ns) as f64 * 1e-9;
            Some(stamped_late(here, force(next).unwrap_or(here), step_s, late_s))
        };
        let value = |column: &TripColumn| match (column.source, column.quantity) {
            (Source::Field(field), _) => sample.get(field),
            (Source::Extra, quantity) => run.extra(quantity)?[ordered[row]],
            (_, Quantity::Time) => Some(sample.time_ns as f64 * 1e-9),
            (_, Quantity::Position) => {
                Some(material.survey.alignments.chainage_m(trip.direction, along_m))
            }
            (_, Quantity::Speed) => sample.get(SampleField::Speed),
            (_, Quantity::ControlForce) => late(&|it| Some(traction(it)? - own_brake(it)?)),
            (_, Quantity::TractionForce) => late(&traction),
            (_, Quantity::BrakeForce) => late(&own_brake),
            (_, Quantity::TrainMass) => mass_kg(material, run, ordered[row]),
            (_, Quantity::WheelSlide) => Some(f64::from(sample.flags & 1)),
            _ => None,
        };
        let cell = |column: &TripColumn| {
            value(column).map_or(String::new(), |value| format!("{value:.*}", column.decimals))
        };
        text += &(columns.iter().map(cell).collect::<Vec<_>>().join(",") + "\n");
    }
    text
}

/// Returns the mass of a row, corrected by the learned masses.
fn mass_kg(material: &Material, run: &Run, row: usize) -> Option<f64> {
    let declared_kg = run.samples[row].get(SampleField::Mass)?;
    let Some(profile) = &material.survey.profile else { return Some(declared_kg) };
    let (common, prior) = (&profile.learned.profile.common, &material.vehicle.prior);
    if prior.is_weighed {
        return Some(declared_kg);
    }
    let passengers = run.extra(Quantity::Passengers).and_then(|it| it[row]).unwrap_or(0.0);
    let per_passenger_kg = common.passenger_kg() - prior.passenger_kg;
    Some(declared_kg + prior.mass_kg * common.mass_share() + passengers * per_passenger_kg)
}
