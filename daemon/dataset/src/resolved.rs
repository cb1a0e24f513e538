//! Columns of a run in SI units, for any layout of its file, and the samples made of them.

use std::sync::Arc;

use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;
use dynocar_shared::sample::FLAG_WHEEL_SLIDE;
use dynocar_shared::{SampleField, TrainId, TrainSample};
use serde::Serialize;

use super::altitude::{self, Recorded};
use super::clock_faults::{self, ClockFaults};
use super::fill_values::{self, FillValue};
use super::forces::Forces;
use super::manifest::{Manifest, RunEntry};
use super::order::TimeOrder;
use super::quantity::Quantity;
use super::speed_and_position::{Placement, PositionSource, Speeds};
use super::table::Table;

/// The train's id in the samples of a dataset; a replay may set another.
pub const DATASET_TRAIN: TrainId = TrainId(1);

/// Where the gradient under the train comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum GradientSource {
    /// The line's file, at the train's position.
    Track,
    /// The mapped `gradient` column.
    Column,
    /// `specific_force` minus dv/dt, formed when the forces are resolved (see
    /// [`dynocar_model::force::ForceResolver`]): there dv/dt cancels against the change of speed.
    SpecificForce,
    /// The slope of the mapped `altitude` over the distance.
    Altitude,
    /// Nothing shows it.
    Unknown,
}

/// Declarations around a run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Context<'d> {
    pub manifest: &'d Manifest,
    pub train: &'d Arc<TrainModel>,
    pub track: Option<&'d Arc<Track>>,
}

/// The columns of a run after all that is particular to its file.
pub(super) struct Resolved<'d> {
    pub entry: &'d RunEntry,
    pub table: Table,
    pub times_s: Vec<f64>,
    pub order: TimeOrder,
    pub clock_faults: ClockFaults,
    pub fill_values: Vec<FillValue>,
    pub rows_without_time: usize,
    pub speeds: Speeds,
    pub forces: Forces,
    pub position_m: Vec<f64>,
    pub position_source: PositionSource,
    pub gradient_permille: Option<Vec<f64>>,
    pub gradient_source: GradientSource,
}

impl<'d> Resolved<'d> {
    pub fn new(context: Context<'d>, entry: &'d RunEntry, mut table: Table) -> Self {
        let (mut timeless_before, rows_without_time) = drop_timeless(&mut table);
        let clock_faults = mend_times(&mut table, &mut timeless_before);
        let fill_values = fill_values::take_out(&mut table, context.manifest);
        table.hold_last(Quantity::Passengers);
        let column = |quantity| table.column(quantity).unwrap_or_default();
        let times_s = column(Quantity::Time).to_vec();
        let order = TimeOrder::new(&times_s, timeless_before);
        let speeds = Speeds::new(column(Quantity::Speed), &order);
        let forces = Forces::new(&table, &speeds.speed_mps, context.train, &order);
        let placement = Placement {
            reference: context.manifest.position_reference,
            direction: f64::from(entry.direction),
            train_length_m: context.train.length_m,
            start_m: entry.start_m,
        };
        let (position_m, position_source) = match table.filled(Quantity::Position) {
            Some(column) => (placement.centre_m(column), PositionSource::Column),
            None => {
                let position_m = placement.integrate(&times_s, &speeds, &order);
                (position_m, PositionSource::IntegratedSpeed)
            }
        };
        let (gradient_permille, gradient_source) =
            gradient((context.track.map(Arc::as_ref), placement), &table, &position_m);
        Resolved {
            entry,
            times_s,
            order,
            clock_faults,
            fill_values,
            rows_without_time,
            speeds,
            forces,
            position_m,
            position_source,
            gradient_permille,
            gradient_source,
            table,
        }
    }

    /// Returns the samples, one for each row, as they are made.
    ///
    /// The mass is the row's, else the run's declared one, else that of the empty train and its
    /// counted passengers.
    pub fn samples(&self, number: u32, train: &TrainModel) -> impl Iterator<Item = TrainSample> {
        let column = |quantity| self.table.column(quantity).unwrap_or_default();
        let source = |quantity| match quantity {
            Quantity::Position => &self.position_m,
            Quantity::Speed => &self.speeds.speed_mps,
            Quantity::TractionForce => &self.forces.traction.force_n,
            Quantity::BrakeForce => &self.forces.brake.force_n,
            Quantity::Gradient => self.gradient_permille.as_deref().unwrap_or_default(),
            other => column(other),
        };
        let filled = Quantity::ALL.into_iter().filter_map(|it| Some((it.field()?, source(it))));
        let fields: Vec<(SampleField, &[f64])> =
            filled.filter(|(_, values)| !values.is_empty()).collect();
        let passengers = column(Quantity::Passengers);
        let wheel_slide = column(Quantity::WheelSlide);
        let is_there =
            |values: &[f64], row: usize| values.get(row).copied().filter(|v| v.is_finite());
        let mut sequence = 0;
        (0..self.times_s.len()).map(move |row| {
            sequence += 1 + self.order.lost_before[row];
            let mut sample = TrainSample::empty(DATASET_TRAIN);
            sample.time_ns = (self.times_s[row] * 1e9).round() as i64;
            sample.sequence = sequence;
            sample.run = number;
            sample.direction = self.entry.direction;
            let counted = is_there(passengers, row)
                .map(|count| train.mass_kg + count * train.passenger_mass_kg);
            if let Some(mass_kg) = self.entry.mass_kg.or(counted) {
                sample.set(SampleField::Mass, mass_kg);
            }
            for &(field, values) in &fields {
                if let Some(value) = is_there(values, row) {
                    let is_signed = field != SampleField::CurveRadius;
                    sample.set(field, if is_signed { value } else { value.abs() });
                }
            }
            if is_there(wheel_slide, row).is_some_and(|slide| slide > 0.5) {
                sample.flags |= FLAG_WHEEL_SLIDE;
            }
            sample
        })
    }
}

/// Drops the rows whose time is missing; gives how many went before each kept row and in all.
fn drop_timeless(table: &mut Table) -> (Vec<u64>, usize) {
    let times = table.column(Quantity::Time).unwrap_or_default();
    // Nanoseconds in an i64 reach 292 years; a time beyond is no time.
    // Counts since the year 0 or 1, and Julian days, are later counted from the first row.
    let is_far = times.iter().find(|time| !time.is_nan()).is_some_and(|time| time.abs() > 9.2e9);
    let most_s = if is_far { 2.2e11 } else { 9.2e9 };
    let keep: Vec<bool> = times.iter().map(|time| time.abs() < most_s).collect();
    let (mut before, mut dropped) = (Vec::with_capacity(keep.len()), 0);
    for &is_kept in &keep {
        if is_kept {
            before.push(std::mem::take(&mut dropped));
        } else {
            dropped += 1;
        }
    }
    let total = keep.len() - before.len();
    if total > 0 {
        table.retain(&keep);
    }
    (before, total)
}

/// Corrects times, and puts the rows into their order. If the order changes, the rows without a time before each row
/// are no longer known.
fn mend_times(table: &mut Table, timeless_before: &mut [u64]) -> ClockFaults {
    let column = |quantity| table.column(quantity).unwrap_or_default();
    let (mut times_s, speed_mps) = (column(Quantity::Time).to_vec(), column(Quantity::Speed));
    let is_repeated = |row: usize| {
        let others = table.columns().filter(|(quantity, _)| *quantity != Quantity::Time);
        let same = |one: f64, other: f64| one == other || (one.is_nan() && other.is_nan());
        others.into_iter().all(|(_, values)| same(values[row], values[row - 1]))
    };
    let (faults, order) = clock_faults::mend(&mut times_s, speed_mps, is_repeated);
    if table.column(Quantity::Time) != Some(&times_s) {
        table.replace(Quantity::Time, times_s);
    }
    if let Some(order) = order {
        table.reorder(&order);
        timeless_before.fill(0);
    }
    faults
}

/// Returns the gradient that the samples carry, and where the gradient comes from first.
///
/// A mapped `gradient` goes into the samples even if the line's file has gradients, since it counts where the position
/// is missing.
fn gradient(
    (track, placement): (Option<&Track>, Placement),
    table: &Table,
    position_m: &[f64],
) -> (Option<Vec<f64>>, GradientSource) {
    let column = table.filled(Quantity::Gradient).map(<[f64]>::to_vec);
    if track.is_some_and(|track| track.gradient().is_some()) {
        return (column, GradientSource::Track);
    }
    if column.is_some() {
        return (column, GradientSource::Column);
    }
    if table.filled(Quantity::SpecificForce).is_some() {
        return (None, GradientSource::SpecificForce);
    }
    let slope = table
        .filled(Quantity::Altitude)
        .map(|altitude_m| {
            let point_m: Vec<f64> =
                position_m.iter().map(|it| placement.reference_m(*it)).collect();
            let (centre_m, length_m) = (position_m, placement.train_length_m);
            let recorded = Recorded { centre_m, point_m: &point_m, altitude_m, length_m };
            altitude::gradient_permille(&recorded)
        })
        .filter(|slope| slope.iter().any(|slope| !slope.is_nan()));
    match slope {
        Some(slope) => (Some(slope), GradientSource::Altitude),
        None => (None, GradientSource::Unknown),
    }
}
