//! One run, from its file to the samples that the pipelines take.

use dynocar_model::train::Drive;
use dynocar_shared::{SampleField, TrainSample};

use super::diagnosing::diagnostics;
use super::diagnostic::Diagnostic;
use super::error::{DatasetError, Problem, SourcePosition};
use super::forces::ForceSource;
use super::judge::Judge;
use super::manifest::{Manifest, Role, RunEntry};
use super::motion::PositionSource;
use super::power;
use super::quality::{self, RunQuality};
use super::quantity::Quantity;
use super::resolved::{Context, GradientSource, Resolved};
use super::run_content::RunContent;
use super::stamps;
use super::table::Table;

const DAY_S: i64 = 86_400;

/// Quantities that a sample does not carry, one value for each sample, `None` where missing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Extras {
    /// Relative humidity, 0 to 1.
    pub relative_humidity: Option<Vec<Option<f64>>>,
    /// Wind speed in m/s, as recorded.
    pub wind_speed_mps: Option<Vec<Option<f64>>>,
    /// Number of passengers.
    pub passengers: Option<Vec<Option<f64>>>,
    /// Altitude in m.
    pub altitude_m: Option<Vec<Option<f64>>>,
    /// Latitude in degrees.
    pub latitude_deg: Option<Vec<Option<f64>>>,
    /// Longitude in degrees.
    pub longitude_deg: Option<Vec<Option<f64>>>,
    /// Course in degrees, clockwise from north.
    pub course_deg: Option<Vec<Option<f64>>>,
    /// Measured curvature in 1/m, turning left positive.
    pub curvature_per_m: Option<Vec<Option<f64>>>,
    /// 1 while a door is open.
    pub door_open: Option<Vec<Option<f64>>>,
    /// Power of the drive in W.
    pub traction_power_w: Option<Vec<Option<f64>>>,
    /// Power from the line in W, by its own column or by voltage and current.
    pub line_power_w: Option<Vec<Option<f64>>>,
}

/// A recorded run.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// Path of its file, as the dataset names it.
    pub file: String,
    /// Number of the run in the dataset, from 1; `run` of its samples.
    pub number: u32,
    /// What it is for.
    pub role: Role,
    /// 1 while the chainage grows, -1 while it falls.
    pub direction: i8,
    /// When it was recorded, in s since 1970 UTC, where its file or the dataset holds that.
    pub recorded_unix_s: Option<i64>,
    /// The run's declared gross mass in kg, else the train's nominal one.
    pub mass_kg: f64,
    /// The rows that have a time, in the file's order.
    ///
    /// `sequence` counts the recorder's cycles from 1: it skips rows without a time and rows
    /// that are missing by the time that passed, so that they count as lost. Rows out of order
    /// or repeated are kept for validation to refuse and count.
    pub samples: Vec<TrainSample>,
    /// Quantities beyond those of a sample.
    pub extras: Extras,
    /// Where the positions come from.
    pub position_source: PositionSource,
    /// Where the gradient comes from.
    pub gradient_source: GradientSource,
    /// Where the traction force comes from.
    pub traction_source: ForceSource,
    /// Where the brake force comes from.
    pub brake_source: ForceSource,
    /// What the data are like.
    pub quality: RunQuality,
    /// What looks like a mistake, or should be known.
    pub diagnostics: Vec<Diagnostic>,
}

impl Run {
    /// The power in W that the traction force comes from, one value for each sample, and whether it
    /// holds what is fed in addition to the drive; `None` where the force comes from elsewhere.
    pub fn power(&self) -> Option<(&[Option<f64>], bool)> {
        if self.traction_source != ForceSource::Power {
            return None;
        }
        let filled = |values: &'_ Option<Vec<Option<f64>>>| {
            values.as_ref().is_some_and(|values| values.iter().any(Option::is_some))
        };
        let extras = &self.extras;
        match filled(&extras.traction_power_w) {
            true => Some((extras.traction_power_w.as_ref()?, false)),
            false => Some((extras.line_power_w.as_ref()?, true)),
        }
    }

    /// Takes forces that act `late_s` before their stamps where they act.
    pub(super) fn move_forces(&mut self, late_s: f64) {
        let mut rows: Vec<usize> = (0..self.samples.len()).collect();
        let mut last_ns = i64::MIN;
        // Rows out of order are refused later on.
        rows.retain(|&row| {
            let is_next = self.samples[row].time_ns > last_ns;
            last_ns = last_ns.max(self.samples[row].time_ns);
            is_next
        });
        for pair in rows.windows(2) {
            let ahead = self.samples[pair[1]];
            let sample = &mut self.samples[pair[0]];
            let step_s = (ahead.time_ns - sample.time_ns) as f64 * 1e-9;
            for field in [SampleField::TractionForce, SampleField::BrakeForce] {
                if let Some((here_n, ahead_n)) = sample.get(field).zip(ahead.get(field)) {
                    sample.set(field, stamps::stamped_late(here_n, ahead_n, step_s, late_s));
                }
            }
        }
    }

    /// Takes a force that comes from power anew: by another drive than it was read with.
    pub(super) fn retake_forces(&mut self, before: Drive, after: Drive) {
        let Some((power_w, _)) = self.power() else { return };
        let power_w = power_w.to_vec();
        let is_brake = self.brake_source == ForceSource::Power;
        for (sample, power_w) in self.samples.iter_mut().zip(power_w) {
            let more = power_w.and_then(|w| after.beyond_n(before, w, sample.speed_mps));
            let Some([traction_n, brake_n]) = more else { continue };
            if let Some(before_n) = sample.get(SampleField::TractionForce) {
                sample.set(SampleField::TractionForce, (before_n + traction_n).max(0.0));
            }
            if let Some(before_n) = sample.get(SampleField::BrakeForce).filter(|_| is_brake) {
                sample.set(SampleField::BrakeForce, (before_n + brake_n).max(0.0));
            }
        }
    }
}

/// Reads one run from what its file holds; `number` is its place in the manifest, from 1.
pub(super) fn read(
    context: Context,
    number: u32,
    entry: &RunEntry,
    label: &str,
    content: RunContent,
) -> Result<Run, DatasetError> {
    let Manifest { layout, columns: mappings, .. } = context.manifest;
    let table = match content {
        RunContent::Text(text) => Table::parse(label, &text, (layout, mappings))?,
        RunContent::Columns(columns) => Table::of_columns(label, columns, mappings)?,
    };
    let rows = table.lines.rows;
    let has_speed = table.filled(Quantity::Speed).is_some();
    let resolved = Resolved::of(context, entry, table);
    let refuse = |problem| Err(SourcePosition::whole(label).problem(problem));
    let column =
        |quantity| context.manifest.mapping(quantity).map_or(String::new(), |it| it.column.clone());
    for (quantity, is_there) in
        [(Quantity::Time, !resolved.times_s.is_empty()), (Quantity::Speed, has_speed)]
    {
        if !is_there {
            return refuse(Problem::NoValues { quantity, column: column(quantity), rows });
        }
    }
    let (time_s, rows) = (resolved.times_s[0], resolved.times_s.len());
    if rows > 1 && resolved.times_s.iter().all(|&other| other == time_s) {
        return refuse(Problem::OneTime { column: column(Quantity::Time), time_s, rows });
    }
    let mut judge = Judge::new(context, resolved.position_source == PositionSource::Column);
    let samples: Vec<TrainSample> =
        resolved.samples(number, context.train).inspect(|sample| judge.take(sample)).collect();
    let quality = quality::assess(&resolved, &samples, &judge);
    let diagnostics = diagnostics(context, &resolved, &quality, judge.detected());
    Ok(Run {
        file: entry.file.clone(),
        number,
        role: entry.role,
        direction: entry.direction,
        recorded_unix_s: recorded(
            context.manifest,
            entry,
            resolved.table.first_day,
            quality.start_s,
        ),
        mass_kg: entry.mass_kg.unwrap_or(context.train.mass_kg),
        extras: extras(&resolved.table),
        position_source: resolved.position_source,
        gradient_source: resolved.gradient_source,
        traction_source: resolved.forces.traction.source,
        brake_source: resolved.forces.brake.source,
        samples,
        quality,
        diagnostics,
    })
}

/// When a run was recorded, in s since 1970 UTC, by the beginning of its file or as declared; `None` where
/// nothing says. The file's text is asked for where its times may hold it, and may break off anywhere.
pub fn recorded_unix_s(
    manifest: &Manifest,
    entry: &RunEntry,
    beginning: impl FnOnce() -> Option<String>,
) -> Option<i64> {
    if !counts_from_midnight(manifest, entry) {
        return entry.date_unix_s;
    }
    let text = beginning()?;
    // What breaks off within a line may break off within a letter.
    let whole = &text[..=text.rfind('\n')?];
    let table = Table::parse("", whole, (&manifest.layout, &manifest.columns)).ok()?;
    let mut times_s = table.column(Quantity::Time)?.iter().copied();
    recorded(manifest, entry, table.first_day, times_s.find(|time_s| !time_s.is_nan())?)
}

/// True where a run's times are those of a day.
fn counts_from_midnight(manifest: &Manifest, entry: &RunEntry) -> bool {
    let has_format = manifest.mapping(Quantity::Time).is_some_and(|it| it.format.is_some());
    has_format && !is_parquet(&entry.file)
}

/// When a run was recorded whose first time is so many s, of this day.
fn recorded(
    manifest: &Manifest,
    entry: &RunEntry,
    first_day: Option<i64>,
    first_s: f64,
) -> Option<i64> {
    if !counts_from_midnight(manifest, entry) {
        return entry.date_unix_s;
    }
    let declared = || entry.date_unix_s.map(|second| second.div_euclid(DAY_S));
    Some(first_day.or_else(declared)? * DAY_S + first_s.floor() as i64)
}

fn extras(table: &Table) -> Extras {
    let column = |quantity| {
        let values = table.column(quantity)?.iter();
        Some(values.map(|&value| (!value.is_nan()).then_some(value)).collect())
    };
    Extras {
        relative_humidity: column(Quantity::RelativeHumidity),
        wind_speed_mps: column(Quantity::WindSpeed),
        passengers: column(Quantity::Passengers),
        altitude_m: column(Quantity::Altitude),
        latitude_deg: column(Quantity::Latitude),
        longitude_deg: column(Quantity::Longitude),
        course_deg: column(Quantity::Course),
        curvature_per_m: column(Quantity::Curvature),
        door_open: column(Quantity::DoorOpen),
        traction_power_w: column(Quantity::TractionPower),
        line_power_w: power::line_power_w(table)
            .map(|values| values.iter().map(|&it| (!it.is_nan()).then_some(it)).collect()),
    }
}

/// True for the name of a Parquet file, which a run may be in place of CSV.
pub fn is_parquet(path: &str) -> bool {
    path.ends_with(".parquet")
}
