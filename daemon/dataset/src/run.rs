//! One run, from its file to the samples that the pipelines take.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::mem::take;

use dynocar_core::plausibility::InputFault;
use dynocar_core::plausibility::window_balance::WindowBalance;
use dynocar_model::train::PowerTrain;
use dynocar_model::units::Unit;
use dynocar_shared::{SampleField, TrainSample};

use super::diagnosing::diagnostics;
use super::diagnostic::{Diagnostic, read_as};
use super::error::{DatasetError, SourcePosition};

use super::force_faults::BRAKE_ALWAYS_ZERO;
use super::forces::{self, ForceSource};
use super::format::{RunColumns, RunContent};
use super::formats;
use super::manifest::{Manifest, Role, RunEntry};
use super::quality::{self, Judge, RunQuality};
use super::quantity::Quantity;
use super::resolved::{Context, GradientSource, Resolved};
use super::speed_and_position::PositionSource;
use super::table::Table;
use super::text_layout::TrainRows;
use super::trains::{TrainsColumn, keep_only, only};

const DAY_S: i64 = 86_400;
/// A slower run in m/s is that of a standing train, as any other.
const MOVING_MPS: f64 = 1.0;

/// Quantities that a sample does not carry and a run keeps in addition, with name and unit. The power from the line
/// comes from its own column, or from voltage and current.
pub const EXTRAS: [(Quantity, &str); 11] = [
    (Quantity::RelativeHumidity, "relative_humidity"),
    (Quantity::WindSpeed, "wind_speed_mps"),
    (Quantity::Passengers, "passengers"),
    (Quantity::Altitude, "altitude_m"),
    (Quantity::Latitude, "latitude_deg"),
    (Quantity::Longitude, "longitude_deg"),
    (Quantity::Course, "course_deg"),
    (Quantity::Curvature, "curvature_per_m"),
    (Quantity::DoorOpen, "door_open"),
    (Quantity::TractionPower, "traction_power_w"),
    (Quantity::LinePower, "line_power_w"),
];

/// Values of a quantity, one for each sample, `None` where missing.
pub type QuantitySeries = Vec<Option<f64>>;

/// A recorded run.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// Path of its file, as the dataset names it.
    pub file: String,
    /// Number of the run in the dataset, from 1; `run` of its samples.
    pub number: u32,
    /// Role of the run.
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
    /// Places in `samples`, in order, of those whose speed sticks out from its neighbours.
    pub speed_outliers: Vec<usize>,
    /// Those of [`EXTRAS`] that are recorded.
    pub extras: Vec<(Quantity, QuantitySeries)>,
    /// Where the positions come from.
    pub position_source: PositionSource,
    /// Where the gradient comes from.
    pub gradient_source: GradientSource,
    /// Where the traction force comes from.
    pub traction_source: ForceSource,
    /// Where the brake force comes from.
    pub brake_source: ForceSource,
    /// How forces, gradients and accelerations go together over all of it.
    pub balance: WindowBalance,
    /// The same with the gradients of the line read from its other end, where positions and the line's length are known.
    pub mirrored: WindowBalance,
    /// The unit in which its gradients were read.
    pub gradient_unit: Unit,
    /// Quality of the data.
    pub quality: RunQuality,
    /// Hash of its motion, by which copies of a run are known; `None` where the train hardly moves.
    pub motion_hash: Option<u64>,
    /// Diagnostics: likely mistakes, or facts to know.
    pub diagnostics: Vec<Diagnostic>,
}

/// The validity bits of both forces.
const FORCES: u16 = SampleField::TractionForce.bit() | SampleField::BrakeForce.bit();

impl Run {
    /// Returns the power in W that the traction force comes from, one value for each sample, and whether it includes
    /// auxiliary power; `None` where the force comes from elsewhere.
    pub fn power(&self) -> Option<(&[Option<f64>], bool)> {
        if self.traction_source != ForceSource::Power {
            return None;
        }
        let own = self.extra(Quantity::TractionPower);
        match own.filter(|values| values.iter().any(Option::is_some)) {
            Some(own) => Some((own, false)),
            None => Some((self.extra(Quantity::LinePower)?, true)),
        }
    }

    /// Moves the samples and their extra quantities out of the run, and returns them with a copy of the rest.
    pub fn split_off_samples(&mut self) -> Run {
        let (samples, extras) = (take(&mut self.samples), take(&mut self.extras));
        Run { samples, extras, ..self.clone() }
    }

    /// Forgets the forces of all samples without traction, for a train whose friction brake is not
    /// recorded: there the true force is unknown. While it pulls no brake acts, be one recorded or not, and faults of
    /// a recorded brake spoil nothing.
    pub fn keep_traction_only(&mut self) {
        for sample in &mut self.samples {
            let pulls = sample.get(SampleField::TractionForce).is_some_and(|force| force > 0.0);
            let brake_n = sample.get(SampleField::BrakeForce).unwrap_or(0.0);
            if !pulls || brake_n > 0.0 {
                sample.valid &= !FORCES;
            } else {
                sample.set(SampleField::BrakeForce, brake_n);
            }
        }
        let of_brake = |it: &Diagnostic| {
            it.code == BRAKE_ALWAYS_ZERO
                || it.fault.is_some_and(|(detected, _)| detected.fault == InputFault::BrakeScale)
        };
        self.diagnostics.retain(|it| !of_brake(it));
    }

    /// Forgets the forces of all samples outside a part of the line, in m of chainage, so that nothing follows from
    /// them.
    pub fn forget_forces_beyond(&mut self, [low_m, high_m]: [f64; 2]) {
        for sample in &mut self.samples {
            if sample.get(SampleField::Position).is_some_and(|it| it < low_m || it > high_m) {
                sample.valid &= !FORCES;
            }
        }
    }

    /// Returns whether a sample has a force.
    pub fn has_forces(&self) -> bool {
        self.samples.iter().any(|sample| sample.valid & FORCES != 0)
    }

    /// Returns the record of a quantity beyond those of a sample.
    pub fn extra(&self, quantity: Quantity) -> Option<&QuantitySeries> {
        self.extras.iter().find(|(other, _)| *other == quantity).map(|(_, values)| values)
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
                    sample.set(field, forces::stamped_late(here_n, ahead_n, step_s, late_s));
                }
            }
        }
    }

    /// Takes a force that comes from power anew: by another drive than it was read with.
    pub(super) fn retake_forces(&mut self, before: PowerTrain, after: PowerTrain) {
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

/// Reads one run from its file's content; `number` is its place in the manifest, from 1.
pub(super) fn read(
    context: Context,
    number: u32,
    entry: &RunEntry,
    label: &str,
    content: RunContent,
) -> Result<Run, DatasetError> {
    let table = match content {
        RunContent::Text(text) => of_text(context.manifest, label, &text)?,
        RunContent::Columns(columns) => of_columns(context.manifest, label, columns)?,
    };
    let rows = table.lines.rows;
    let has_speed = table.filled(Quantity::Speed).is_some();
    let resolved = Resolved::new(context, entry, table);
    let column = |quantity| context.manifest.mapping(quantity).map_or("", |it| &it.column);
    for (quantity, is_there) in
        [(Quantity::Time, !resolved.times_s.is_empty()), (Quantity::Speed, has_speed)]
    {
        if !is_there {
            return Err(SourcePosition::whole(label).problem(format!(
                "column '{}': expected values of {quantity}, found none in {rows} rows",
                column(quantity)
            )));
        }
    }
    let (time_s, rows) = (resolved.times_s[0], resolved.times_s.len());
    if rows > 1 && resolved.times_s.iter().all(|&other| other == time_s) {
        return Err(SourcePosition::whole(label).problem(format!(
            "column '{}': expected times that grow, found {time_s} s in all {rows} rows",
            column(Quantity::Time)
        )));
    }
    let mut judge = Judge::new(context, &resolved);
    let samples: Vec<TrainSample> =
        resolved.samples(number, context.train).inspect(|sample| judge.take(sample)).collect();
    let quality = quality::assess(&resolved, &samples, &judge);
    let diagnostics = diagnostics(context, &resolved, &quality, &judge);
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
        speed_outliers: resolved.speeds.outliers().collect(),
        balance: judge.balance(),
        mirrored: judge.mirrored(),
        gradient_unit: read_as(context.manifest, InputFault::GradientScale),
        motion_hash: quality
            .speed_range_mps
            .filter(|range| range.1 > MOVING_MPS)
            .map(|_| motion_hash(&resolved)),
        quality,
        diagnostics,
    })
}

/// Returns the hash of a run's times since its start, in whole ms, and of its speeds.
fn motion_hash(run: &Resolved) -> u64 {
    let mut hasher = DefaultHasher::new();
    for (time_s, speed_mps) in run.times_s.iter().zip(&run.speeds.speed_mps) {
        let since_ms = (1e3 * (time_s - run.times_s[0])).round() as i64;
        (since_ms, speed_mps.to_bits()).hash(&mut hasher);
    }
    hasher.finish()
}

/// Reads the rows of the train of a text.
fn of_text(manifest: &Manifest, label: &str, text: &str) -> Result<Table, DatasetError> {
    let Manifest { layout, columns, train_rows, .. } = manifest;
    let own = match train_rows {
        TrainRows::Of { column, value } => only(label, text, layout, (column, value))?,
        TrainRows::All | TrainRows::Unsaid => text.into(),
    };
    let table = Table::parse(label, &own, (layout, columns))?;
    if *train_rows == TrainRows::Unsaid
        && let Some(trains) = TrainsColumn::new(text, layout)
    {
        trains.refuse(label, &table)?;
    }
    Ok(table)
}

/// Reads the rows of the train of a file's columns.
fn of_columns(
    manifest: &Manifest,
    label: &str,
    RunColumns { columns, trains }: RunColumns,
) -> Result<Table, DatasetError> {
    let mut table = Table::of_columns(label, columns, &manifest.columns)?;
    match &manifest.train_rows {
        TrainRows::Of { column, value } => {
            keep_only(label, &mut table, trains.as_ref(), (column, value))?;
        }
        TrainRows::Unsaid => {
            if let Some(trains) = trains.as_ref().and_then(TrainsColumn::of_table) {
                trains.refuse(label, &table)?;
            }
        }
        TrainRows::All => {}
    }
    Ok(table)
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
    // A row that breaks off may break off within a letter.
    let whole = text[..=text.rfind('\n')?].to_owned();
    let rows = formats::of_run(&entry.file).rows(whole).ok()?;
    let table = Table::parse("", &rows, (&manifest.layout, &manifest.columns)).ok()?;
    let mut times_s = table.column(Quantity::Time)?.iter().copied();
    recorded(manifest, entry, table.first_day, times_s.find(|time_s| !time_s.is_nan())?)
}

/// Returns whether a run's times are those of a day.
fn counts_from_midnight(manifest: &Manifest, entry: &RunEntry) -> bool {
    let has_format = manifest.mapping(Quantity::Time).is_some_and(|it| it.format.is_some());
    has_format && !formats::of_run(&entry.file).needs_library()
}

/// Returns the time of a run's recording, whose first time is a number of seconds, on this day.
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

fn extras(table: &Table) -> Vec<(Quantity, QuantitySeries)> {
    let held = |&it: &f64| (!it.is_nan()).then_some(it);
    let extra = |(quantity, _): (Quantity, _)| {
        let values = match quantity {
            Quantity::LinePower => forces::line_power_w(table)?,
            quantity => table.column(quantity)?.into(),
        };
        Some((quantity, values.iter().map(held).collect()))
    };
    EXTRAS.into_iter().filter_map(extra).collect()
}
