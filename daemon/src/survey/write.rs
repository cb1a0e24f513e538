//! The dataset that a survey makes.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use dynocar_core::dataset::{Dataset, DatasetFiles, ForceSource, Quantity, Run};
use dynocar_core::survey::layout::HEIGHT_STEP_M;
use dynocar_core::survey::{Survey, SurveyedProfile, Trip, Vehicle};
use dynocar_shared::{SampleField, TrainSample};
use toml::{Table, Value};

use super::SurveyFailure;
use super::read::rows_in_order;
use crate::dataset::open;
use crate::output::{require_file, write_in_folder};

/// Forces stamped late by less than so many s, or standard deviations, stay as they are.
const LATE_MIN: (f64, f64) = (0.01, 3.0);
/// A force is not taken across a longer step in s.
const STEP_MAX_S: f64 = 2.5;
/// Length of the beginning by which a file of a survey is known.
const MARK_LENGTH: usize = 20;
/// What a survey's TOML files begin with.
const MARK: &str = "# By `dynocar survey`";
/// A profile reaches beyond its way by so many m.
const BEYOND_M: f64 = 60.0;

/// What the files are made of.
pub struct Material<'m> {
    /// Where the raw dataset lies.
    pub source: &'m Path,
    /// The raw dataset.
    pub dataset: &'m Dataset,
    /// What was declared of the vehicle.
    pub vehicle: &'m Vehicle,
    /// What was found.
    pub survey: &'m Survey,
    /// The line's file that was given, if any.
    pub line: Option<&'m Path>,
}

/// The file of a trip, from its number from 0.
pub fn trip_file(number: usize) -> String {
    format!("runs/{:03}.csv", number + 1)
}

/// Seconds by which forces are stamped late and are moved, 0 for none.
pub fn late_s(survey: &Survey) -> f64 {
    let Some(profile) = &survey.profile else { return 0.0 };
    let (late_s, std_s) =
        (profile.learned.profile.common.delay_s(), profile.learned.profile.common_std.delay_s());
    // A force that acts after its stamp is an actuator's delay, which is explained, not mended.
    if late_s > LATE_MIN.0 && late_s > LATE_MIN.1 * std_s { late_s } else { 0.0 }
}

/// Writes the whole folder; gives its files.
///
/// # Errors
///
/// When a declared file cannot be read or one cannot be written.
pub fn write(material: &Material, folder: &Path) -> Result<Vec<PathBuf>, SurveyFailure> {
    let mut files: Vec<(String, String)> = vec![
        ("train.toml".into(), train_toml(material)?),
        ("dataset.toml".into(), dataset_toml(material)),
    ];
    match material.line {
        Some(line) => files.extend(copied_line(line)?),
        None => {
            files.push(("track.toml".into(), track_toml(material)));
            files.push(("alignment.csv".into(), alignment(material.survey, 1)));
            if !material.survey.ways.is_one_track() {
                files.push(("alignment_falling.csv".into(), alignment(material.survey, -1)));
            }
        }
    }
    for (number, trip) in material.survey.trips.iter().enumerate() {
        files.push((trip_file(number), run_csv(material, trip)));
    }
    for (name, text) in &files {
        // What is there and begins otherwise is no survey's: the raw recordings, most likely.
        let mark = text.get(..MARK_LENGTH.min(text.len())).unwrap_or_default();
        let path = folder.join(name);
        if path.exists() {
            require_file(&path, mark)?;
        }
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
        crate::dataset::read_text(path).map_err(|problem| SurveyFailure::Line {
            path: path.into(),
            problem: problem.to_string(),
        })
    };
    let track = crate::dataset::load_track(line)?;
    let mut files = vec![("track.toml".to_string(), read(line)?)];
    for name in [&track.survey().alignment, &track.survey().alignment_falling].into_iter().flatten()
    {
        files.push((name.clone(), read(&line.parent().unwrap_or(Path::new(".")).join(name))?));
    }
    Ok(files)
}

/// The declared train with what was learned.
fn train_toml(material: &Material) -> Result<String, SurveyFailure> {
    let (files, head) = open(material.source)?;
    let path = &head.manifest.train_file.path;
    let wrong = |problem: String| SurveyFailure::Line { path: path.into(), problem };
    let text = files.read(path).map_err(|problem| wrong(problem.to_string()))?;
    let Some(profile) = &material.survey.profile else {
        return Ok(format!("{MARK}: {path} as declared.\n{text}"));
    };
    let mut train: Table =
        text.parse().map_err(|error: toml::de::Error| wrong(error.message().to_string()))?;
    let common = &profile.learned.profile.common;
    let mut set = |section: &str, key: &str, value: f64| {
        let entry = train.entry(section).or_insert_with(|| Value::Table(Table::new()));
        if let Value::Table(section) = entry {
            section.insert(key.into(), Value::Float(value));
        }
    };
    for (key, value) in ["a", "b", "c"].into_iter().zip(common.davis()) {
        set("resistance", key, rounded(value, 1e-6));
    }
    let prior = &material.vehicle.prior;
    if !prior.is_weighed {
        set("train", "mass_t", rounded(prior.mass_kg * (1.0 + common.mass_share()) / 1e3, 1e-4));
    }
    if prior.has_passengers {
        set("train", "passenger_mass_kg", rounded(common.passenger_kg(), 0.01));
    }
    if let Some(brake) = &profile.learned.brake {
        set("brake", "force_per_pressure_n_per_pa", rounded(brake.gain_n_per_pa.value, 1e-5));
        set("brake", "release_pressure_pa", rounded(brake.release_pa, 1.0));
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

/// A column of the trips' files.
struct Column {
    quantity: Quantity,
    unit: &'static str,
    decimals: usize,
}

fn columns(dataset: &Dataset) -> Vec<Column> {
    let any = |is_there: fn(&Run) -> bool| dataset.runs.iter().any(is_there);
    let has = |field: SampleField| {
        dataset.runs.iter().any(|run| run.samples.iter().any(|it| it.get(field).is_some()))
    };
    let is_signed = any(|run| run.traction_source == ForceSource::ControlForce);
    let all = [
        (Quantity::Time, "s", 3, true),
        (Quantity::Position, "m", 2, true),
        (Quantity::Speed, "m/s", 4, true),
        (Quantity::ControlForce, "N", 1, is_signed),
        (Quantity::TractionForce, "N", 1, !is_signed && has(SampleField::TractionForce)),
        (Quantity::BrakeForce, "N", 1, !is_signed && any(has_own_brake)),
        (Quantity::BrakeCylinderPressure, "Pa", 1, has(SampleField::BrakeCylinderPressure)),
        (Quantity::Acceleration, "m/s2", 5, has(SampleField::Acceleration)),
        (Quantity::SpecificForce, "m/s2", 5, has(SampleField::SpecificForce)),
        (Quantity::TrainMass, "kg", 1, has(SampleField::Mass)),
        (Quantity::Passengers, "1", 0, any(|run| run.extras.passengers.is_some())),
        (Quantity::AmbientTemperature, "degC", 2, has(SampleField::AmbientTemperature)),
        (Quantity::Altitude, "m", 2, any(|run| run.extras.altitude_m.is_some())),
        (Quantity::Latitude, "deg", 7, any(|run| run.extras.latitude_deg.is_some())),
        (Quantity::Longitude, "deg", 7, any(|run| run.extras.longitude_deg.is_some())),
        (Quantity::DoorOpen, "1", 0, any(|run| run.extras.door_open.is_some())),
        (Quantity::WheelSlide, "1", 0, any(|run| run.samples.iter().any(|it| it.flags != 0))),
    ];
    all.into_iter()
        .filter(|it| it.3)
        .map(|(quantity, unit, decimals, _)| Column { quantity, unit, decimals })
        .collect()
}

/// True where the brake force is more than what the pressure says.
fn has_own_brake(run: &Run) -> bool {
    !matches!(run.brake_source, ForceSource::None | ForceSource::Pressure)
}

fn dataset_toml(material: &Material) -> String {
    let dataset = material.dataset;
    let quoted = |text: &str| Value::String(text.into()).to_string();
    let mut text = format!("{MARK}.\n[dataset]\nname = {}\n", quoted(&dataset.name));
    if let Some(description) = &dataset.description {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "description = {}", quoted(description));
    }
    text += "[train]\nfile = \"train.toml\"\n[track]\nfile = \"track.toml\"\n[columns]\n";
    for Column { quantity, unit, .. } in columns(dataset) {
        let name = quantity.name();
        let _ = writeln!(text, "{name} = {{ column = \"{name}\", unit = \"{unit}\" }}");
    }
    for (number, trip) in material.survey.trips.iter().enumerate() {
        let role = dataset.runs[trip.recording].role.name();
        let direction = trip.direction;
        let _ = writeln!(
            text,
            "[[runs]]\nfile = \"{}\"\nrole = \"{role}\"\ndirection = {direction}",
            trip_file(number)
        );
    }
    text
}

fn run_csv(material: &Material, trip: &Trip) -> String {
    let columns = columns(material.dataset);
    let run = &material.dataset.runs[trip.recording];
    let ordered = rows_in_order(run);
    let late_s = late_s(material.survey);
    let names: Vec<&str> = columns.iter().map(|column| column.quantity.name()).collect();
    let mut text = names.join(",") + "\n";
    for (index, row) in trip.rows().enumerate() {
        let sample = &run.samples[ordered[row]];
        let next = ordered.get(row + 1).map(|&next| &run.samples[next]);
        let along_m = trip.along.chainage_m[index];
        let position_m = material.survey.ways.chainage_m(trip.direction, along_m);
        for (k, column) in columns.iter().enumerate() {
            let value = match column.quantity {
                Quantity::Position => Some(position_m),
                Quantity::TrainMass => mass_kg(material, run, ordered[row]),
                quantity => value(material, run, ordered[row], sample, next, late_s, quantity),
            };
            if k > 0 {
                text.push(',');
            }
            if let Some(value) = value {
                let _ = write!(text, "{value:.*}", column.decimals);
            }
        }
        text.push('\n');
    }
    text
}

/// The mass of a row with what was learned of it.
fn mass_kg(material: &Material, run: &Run, row: usize) -> Option<f64> {
    let declared_kg = run.samples[row].get(SampleField::Mass)?;
    let Some(profile) = &material.survey.profile else { return Some(declared_kg) };
    let (common, prior) = (&profile.learned.profile.common, &material.vehicle.prior);
    if prior.is_weighed {
        return Some(declared_kg);
    }
    let passengers = run.extras.passengers.as_ref().and_then(|it| it[row]).unwrap_or(0.0);
    let per_passenger_kg = common.passenger_kg() - prior.passenger_kg;
    Some(declared_kg + prior.mass_kg * common.mass_share() + passengers * per_passenger_kg)
}

#[allow(clippy::too_many_arguments)]
fn value(
    material: &Material,
    run: &Run,
    row: usize,
    sample: &TrainSample,
    next: Option<&TrainSample>,
    late_s: f64,
    quantity: Quantity,
) -> Option<f64> {
    let extra = |values: &Option<Vec<Option<f64>>>| values.as_ref()?[row];
    let late = |force: &dyn Fn(&TrainSample) -> Option<f64>| {
        let here = force(sample)?;
        let Some(next) = next.filter(|_| late_s > 0.0) else { return Some(here) };
        let step_s = (next.time_ns - sample.time_ns) as f64 * 1e-9;
        let ahead = force(next).filter(|_| step_s <= STEP_MAX_S).unwrap_or(here);
        Some(here + (late_s / step_s).min(1.0) * (ahead - here))
    };
    let traction = |sample: &TrainSample| sample.get(SampleField::TractionForce);
    let own_brake = |sample: &TrainSample| {
        let friction =
            material.dataset.train.brake_gear.friction_brake.and_then(|brake| {
                Some(brake.force_n(sample.get(SampleField::BrakeCylinderPressure)?))
            });
        Some(sample.get(SampleField::BrakeForce)? - friction.unwrap_or(0.0))
    };
    match quantity {
        Quantity::Time => Some(sample.time_ns as f64 * 1e-9),
        Quantity::Speed => sample.get(SampleField::Speed),
        Quantity::ControlForce => late(&|sample| Some(traction(sample)? - own_brake(sample)?)),
        Quantity::TractionForce => late(&traction),
        Quantity::BrakeForce => late(&own_brake),
        Quantity::BrakeCylinderPressure => sample.get(SampleField::BrakeCylinderPressure),
        Quantity::Acceleration => sample.get(SampleField::Acceleration),
        Quantity::SpecificForce => sample.get(SampleField::SpecificForce),
        Quantity::AmbientTemperature => sample.get(SampleField::AmbientTemperature),
        Quantity::Passengers => extra(&run.extras.passengers),
        Quantity::Altitude => extra(&run.extras.altitude_m),
        Quantity::Latitude => extra(&run.extras.latitude_deg),
        Quantity::Longitude => extra(&run.extras.longitude_deg),
        Quantity::DoorOpen => extra(&run.extras.door_open),
        Quantity::WheelSlide => Some(f64::from(sample.flags & 1)),
        _ => None,
    }
}

/// Entries of (chainage in m, gradient and its standard deviation in ‰) of a direction's profile,
/// climbing positive as the chainage grows.
pub fn gradient_entries(
    survey: &Survey,
    profile: &SurveyedProfile,
    direction: i8,
) -> Vec<(f64, f64, f64)> {
    let ways = &survey.ways;
    let block = usize::from(direction < 0);
    let length_m = ways.of(direction).map_or(0.0, |way| way.length_m());
    let entries = profile.learned.profile.gradient_permille(block);
    let inside = entries
        .into_iter()
        .filter(|(at_m, ..)| (-BEYOND_M - HEIGHT_STEP_M..length_m + BEYOND_M).contains(at_m));
    let mut list: Vec<(f64, f64, f64)> = inside
        .map(|(at_m, gradient, std)| match direction {
            1 => (ways.chainage_m(1, at_m), gradient, std),
            // The cell's end along the way is its start by chainage.
            _ => (ways.chainage_m(-1, at_m + HEIGHT_STEP_M), -gradient, std),
        })
        .collect();
    list.sort_by(|one, other| one.0.total_cmp(&other.0));
    list
}

fn track_toml(material: &Material) -> String {
    let survey = material.survey;
    let Some(profile) = &survey.profile else { return String::new() };
    let ways = &survey.ways;
    let length_m = ways.chainage_per_m * ways.growing.length_m();
    let name = Value::String(format!("{}, surveyed", material.dataset.name)).to_string();
    let mut text = format!(
        "{MARK} from {} passes.\n[track]\nname = {name}\n\
         length_m = {length_m:.1}\nalignment = \"alignment.csv\"\n",
        profile.trips.len()
    );
    let mut list = |key: &str, entries: &mut dyn Iterator<Item = String>| {
        let _ = writeln!(text, "{key} = [");
        for entry in entries {
            let _ = writeln!(text, "  [{entry}],");
        }
        text += "]\n";
    };
    let growing = gradient_entries(survey, profile, 1);
    let bounded = |gradient: f64| gradient.clamp(-149.0, 149.0);
    list("gradient", &mut growing.iter().map(|it| format!("{:.2}, {:.3}", it.0, bounded(it.1))));
    list(
        "gradient_std",
        &mut growing.iter().step_by(5).map(|it| format!("{:.2}, {:.3}", it.0, it.2.min(149.0))),
    );
    if !ways.is_one_track() {
        let falling = gradient_entries(survey, profile, -1);
        let entry = |it: &(f64, f64, f64)| format!("{:.2}, {:.3}", it.0, bounded(it.1));
        list("gradient_falling", &mut falling.iter().map(entry));
    }
    if ways.is_one_track() {
        let per_m = ways.chainage_per_m;
        let entry = |curve: &dynocar_core::survey::curves::FoundCurve| {
            let (from_m, to_m) = (per_m * curve.from_m, per_m * curve.to_m);
            format!("{from_m:.1}, {to_m:.1}, {:.1}", curve.radius_m)
        };
        list("curves", &mut profile.curves.iter().map(entry));
    }
    let stop = |stop: &dynocar_core::survey::stops::Stop| {
        let name = Value::String(stop.name.clone()).to_string();
        format!("{:.1}, {name}", stop.chainage_m.value)
    };
    list("stops", &mut survey.stops.iter().map(stop));
    if !ways.is_one_track() {
        text += "alignment_falling = \"alignment_falling.csv\"\n";
    }
    text
}

fn alignment(survey: &Survey, direction: i8) -> String {
    let mut text = String::from("chainage_m,latitude_deg,longitude_deg\n");
    let Some(way) = survey.ways.of(direction) else { return text };
    for (node, &at_m) in way.nodes_m().iter().enumerate() {
        let chainage_m = survey.ways.chainage_m(direction, node as f64 * way.step_m());
        let [latitude, longitude] = survey.plane.unproject(at_m);
        let _ = writeln!(text, "{chainage_m:.3},{latitude:.8},{longitude:.8}");
    }
    text
}
