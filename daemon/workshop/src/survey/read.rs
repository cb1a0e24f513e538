//! Inputs of a survey.

use std::path::{Path, PathBuf};

use dynocar::dataset::{DatasetSource, LoadError, load_track, read_text};
use dynocar::output::OutputError;
use dynocar_analysis::dataset::keys::track::ALIGNMENT;
use dynocar_analysis::dataset::{Dataset, ForceSource, Quantity, Role, Run};
use dynocar_analysis::survey::alignment::{Alignment, LocalPlane};
use dynocar_analysis::survey::driven_line::{Alignments, FallingAlignment};
use dynocar_analysis::survey::observation::Prior;
use dynocar_analysis::survey::recording::RawRecording;
use dynocar_analysis::survey::{KnownLine, Survey, SurveyError, Vehicle};
use dynocar_model::track::Track;
use dynocar_shared::SampleField;

/// Returns a run's rows in order of time, as numbers of its samples.
pub fn rows_in_order(run: &Run) -> Vec<usize> {
    let mut last_ns = i64::MIN;
    let mut rows = Vec::with_capacity(run.samples.len());
    for (row, sample) in run.samples.iter().enumerate() {
        if sample.time_ns > last_ns {
            last_ns = sample.time_ns;
            rows.push(row);
        }
    }
    rows
}

/// Returns the runs of a dataset as recordings.
pub fn recordings(dataset: &Dataset) -> Vec<RawRecording> {
    dataset.runs.iter().map(|run| recording(dataset, run)).collect()
}

fn recording(dataset: &Dataset, run: &Run) -> RawRecording {
    let rows = rows_in_order(run);
    let of = |field: SampleField| -> Vec<f64> {
        rows.iter().map(|&row| run.samples[row].get(field).unwrap_or(f64::NAN)).collect()
    };
    let extra = |quantity| -> Vec<f64> {
        let Some(values) = run.extra(quantity) else { return Vec::new() };
        rows.iter().map(|&row| values[row].unwrap_or(f64::NAN)).collect()
    };
    let position = |quantity| match extra(quantity) {
        none if none.is_empty() => vec![f64::NAN; rows.len()],
        values => values,
    };
    let (traction, brake) = (of(SampleField::TractionForce), of(SampleField::BrakeForce));
    let pressure = of(SampleField::BrakeCylinderPressure);
    let has_pressure = pressure.iter().any(|pressure| pressure.is_finite());
    // A brake force of its own column is all there is; a declared gain has been used already.
    let is_apart = matches!(run.brake_source, ForceSource::ControlForce | ForceSource::None)
        && dataset.train.brake_gear.friction_brake.is_none();
    let control_n = traction.iter().zip(&brake).map(|(traction, brake)| {
        match (run.brake_source, has_pressure) {
            (ForceSource::None, true) => *traction,
            // Without traction the force of an unknown brake may act.
            (ForceSource::None, false) if *traction > 0.0 => *traction,
            _ => traction - brake,
        }
    });
    let passengers = extra(Quantity::Passengers);
    let mass_kg = rows.iter().enumerate().map(|(index, &row)| {
        match passengers.get(index).is_some_and(|count| count.is_nan()) {
            true => f64::NAN,
            false => run.samples[row].get(SampleField::Mass).unwrap_or(run.mass_kg),
        }
    });
    RawRecording {
        source: run.file.clone(),
        is_fit: run.role == Role::Fit,
        time_s: rows.iter().map(|&row| run.samples[row].time_ns as f64 * 1e-9).collect(),
        speed_mps: of(SampleField::Speed),
        control_n: control_n.collect(),
        friction_pa: if has_pressure && is_apart { pressure } else { Vec::new() },
        latitude_deg: position(Quantity::Latitude),
        longitude_deg: position(Quantity::Longitude),
        altitude_m: extra(Quantity::Altitude),
        door_open: extra(Quantity::DoorOpen),
        mass_kg: mass_kg.collect(),
        passengers,
    }
}

/// Returns the declared vehicle.
pub fn vehicle(dataset: &Dataset) -> Vehicle {
    let train = &dataset.train;
    let has_passengers = dataset.runs.iter().any(|run| run.extra(Quantity::Passengers).is_some());
    let is_declared = |run: &Run| {
        run.samples.iter().any(|sample| sample.get(SampleField::Mass).is_some())
            && run.extra(Quantity::Passengers).is_none()
    };
    Vehicle {
        prior: Prior {
            mass_kg: train.mass_kg,
            passenger_kg: train.passenger_mass_kg,
            rotating_mass_factor: train.rotating_mass_factor,
            davis: [train.resistance.a, train.resistance.b, train.resistance.c],
            speed_mps: 10.0,
            is_weighed: dataset.runs.iter().all(is_declared),
            has_passengers,
        },
        length_m: train.length_m,
        curve_constant_n_per_kn_m: train.curve_constant_n_per_kn_m,
    }
}

/// Returns a line surveyed before, from its `track.toml` and the alignments next to it.
///
/// # Errors
///
/// When a file cannot be read or names no alignment.
pub fn known_line(path: &Path) -> Result<(KnownLine, Track), SurveyFailure> {
    let track = load_track(path)?;
    let wrong =
        |path: &Path, problem: String| SurveyFailure::SurveyedLine { path: path.into(), problem };
    let Some(alignment) = &track.survey.alignment else {
        let expected = ALIGNMENT.assign("\"…csv\"");
        let problem = format!("expected {expected}, the line on the map, got none");
        return Err(wrong(path, problem));
    };
    let folder = path.parent().unwrap_or(Path::new("."));
    let points = |name: &str| {
        let file = folder.join(name);
        alignment_points(&file).map_err(|problem| wrong(&file, problem))
    };
    let growing = points(alignment)?;
    let middle = growing[growing.len() / 2];
    let plane = LocalPlane::around(middle[1], middle[2], 0.0);
    let through = |points: &[[f64; 3]]| {
        let projected: Vec<_> = points.iter().map(|it| plane.project(it[1], it[2])).collect();
        let problem = || "expected a line of some length, got one place".into();
        Alignment::through(&projected).ok_or_else(|| wrong(&folder.join(alignment), problem()))
    };
    let one = through(&growing)?;
    let chained_m = growing[growing.len() - 1][0] - growing[0][0];
    let chainage_per_m = chained_m / one.length_m();
    let falling = match &track.survey.alignment_falling {
        None => {
            let back: Vec<[f64; 3]> = growing.iter().rev().copied().collect();
            let alignment = through(&back)?;
            let start_chainage_m = alignment.length_m();
            FallingAlignment { alignment, start_chainage_m, is_same: true }
        }
        Some(name) => {
            let points = points(name)?;
            let (alignment, start_chainage_m) = (through(&points)?, points[0][0] / chainage_per_m);
            FallingAlignment { alignment, start_chainage_m, is_same: false }
        }
    };
    let alignments = Alignments { growing: one, falling: Some(falling), chainage_per_m };
    Ok((KnownLine { plane, alignments }, track))
}

/// Returns the rows of chainage in m, latitude and longitude in degrees.
fn alignment_points(path: &Path) -> Result<Vec<[f64; 3]>, String> {
    let text = read_text(path).map_err(|problem| problem.to_string())?;
    let mut points = Vec::new();
    for (index, line) in text.lines().enumerate().skip(1) {
        let cells: Vec<f64> = line.split(',').filter_map(|cell| cell.trim().parse().ok()).collect();
        let Ok(point) = <[f64; 3]>::try_from(cells) else {
            let form = "chainage_m,latitude_deg,longitude_deg";
            return Err(format!("line {}: expected {form}, got '{line}'", index + 1));
        };
        points.push(point);
    }
    if points.len() < 2 { Err("expected two places or more".into()) } else { Ok(points) }
}

/// Material of the files.
pub struct Material<'m> {
    /// Where the raw dataset lies.
    pub source: DatasetSource<'m>,
    /// The raw dataset.
    pub dataset: &'m Dataset,
    /// Declared vehicle.
    pub vehicle: &'m Vehicle,
    /// Findings of the survey.
    pub survey: &'m Survey,
    /// The line's file that was given, if any.
    pub line: Option<&'m Path>,
}

/// Why a survey comes to no dataset.
#[derive(Debug, thiserror::Error)]
pub enum SurveyFailure {
    /// The dataset or the line cannot be read.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// Nothing can be surveyed in it.
    #[error(transparent)]
    Survey(#[from] SurveyError),
    /// A line's file lacks the data that mapping needs, or its alignment cannot be read.
    #[error("{}: {problem}", path.display())]
    SurveyedLine {
        /// The file.
        path: PathBuf,
        /// Expected and found contents.
        problem: String,
    },
    /// A file cannot be written, or would cost data.
    #[error(transparent)]
    Output(#[from] OutputError),
}
