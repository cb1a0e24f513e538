//! Quality of a run's data: counts, ranges, the train's motion, and the refusals by the admission that also checks live
//! samples.

use std::ops::RangeInclusive;
use std::sync::Arc;

use dynocar_core::pipeline::admission::Admission;
use dynocar_core::pipeline::{Echo, Outcome};
use dynocar_core::plausibility::window_balance::{WindowBalance, WindowMean};
use dynocar_core::plausibility::{DetectedFaults, gradient_fault};
use dynocar_model::force::ForceResolver;
use dynocar_model::terms::wheel::STILL_MPS;
use dynocar_model::track::Track;
use dynocar_shared::resistance::GRAVITY_MPS2;
use dynocar_shared::{RejectionReason, SampleField, TrainSample};
use serde::{Serialize, Serializer};

use super::forces::Force;
use super::order::{OrderCounts, pairs};
use super::quantity::Quantity;
use super::resolved::{Context, DATASET_TRAIN, GradientSource, Resolved};
use super::speed_and_position::PositionSource;
use super::table::LineCounts;

/// Share of the greatest force below which a force counts as zero.
const COASTING_SHARE: f64 = 0.005;

/// Quality of a run's data.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunQuality {
    /// Rows of the file, and lines that are no plain rows.
    pub lines: LineCounts,
    /// Rows without a time, which cannot become samples.
    pub rows_without_time: usize,
    /// Order and regularity in time.
    pub order: OrderCounts,
    /// First time in s, as in the file.
    pub start_s: f64,
    /// From the first to the last row in order, in s.
    pub duration_s: f64,
    /// Missing cells of every mapped quantity that has some, among rows with a time.
    pub missing: Vec<QuantityCount>,
    /// Values that stick out from their neighbours.
    pub outliers: Vec<QuantityCount>,
    /// Values below zero by noise: speeds set to zero, forces counted as the other force.
    pub noise_below_zero: Vec<QuantityCount>,
    /// Samples that validation refuses, by reason.
    pub refused: Vec<ReasonCount>,
    /// Lowest and highest speed in m/s, without outliers; `None` without speeds.
    pub speed_range_mps: Option<(f64, f64)>,
    /// Lowest and highest chainage of the train's centre in m; `None` without positions.
    pub position_range_m: Option<(f64, f64)>,
    /// The mass in kg that the samples carry; `None` where they carry none, so that the train's nominal
    /// one holds.
    pub mass_kg: Option<MeanAndRange>,
    /// Distance in m by integrating the speed.
    pub distance_m: f64,
    /// Phases of the train's motion, and their durations.
    pub phases: Phases,
}

impl RunQuality {
    /// Returns the number of samples: one for each row with a time.
    pub fn samples(&self) -> usize {
        self.lines.rows - self.rows_without_time
    }
}

/// A count for a quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct QuantityCount {
    /// The quantity.
    pub quantity: Quantity,
    /// How many.
    pub count: usize,
}

/// A count for a reason.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ReasonCount {
    /// The reason.
    #[serde(serialize_with = "by_name")]
    pub reason: RejectionReason,
    /// How many.
    pub count: usize,
    /// Line in the file, from 1, of the first.
    pub first_line: usize,
    /// Time in s of the first.
    pub first_s: f64,
}

fn by_name<S: Serializer>(reason: &RejectionReason, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(reason.name())
}

/// Mean and range of a quantity over a run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MeanAndRange {
    /// The mean over the samples.
    pub mean: f64,
    /// The lowest.
    pub low: f64,
    /// The highest.
    pub high: f64,
}

/// Time in s that the train spent in each phase.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Phases {
    /// Speed below 0.1 m/s.
    pub standstill_s: f64,
    /// Moving without traction or brake.
    pub coasting_s: f64,
    /// Traction outweighs the brake.
    pub traction_s: f64,
    /// The brake outweighs traction.
    pub braking_s: f64,
    /// Speed or forces are missing, or rows are.
    pub unknown_s: f64,
}

impl RunQuality {
    /// Returns the number of samples that validation refuses, for all reasons together.
    pub fn refused_in_all(&self) -> usize {
        self.refused.iter().map(|refused| refused.count).sum()
    }
}

/// Looks at a run that is read, whose samples were judged.
pub(super) fn assess(run: &Resolved, samples: &[TrainSample], judge: &Judge) -> RunQuality {
    let time = |row: Option<usize>| row.map_or(0.0, |row| run.times_s[row]);
    let (start_s, end_s) = (time(run.order.rows().next()), time(run.order.rows().next_back()));
    let speeds = run.speeds.speed_mps.iter().zip(&run.speeds.is_spike);
    let speeds = speeds.filter(|(_, is_spike)| !**is_spike).map(|(speed, _)| *speed);
    let refused = judge.refused().map(|(reason, count, row)| {
        let (first_line, first_s) = (run.table.line(row), run.times_s[row]);
        ReasonCount { reason, count, first_line, first_s }
    });
    RunQuality {
        lines: run.table.lines,
        rows_without_time: run.rows_without_time,
        order: run.order.counts,
        start_s,
        duration_s: end_s - start_s,
        missing: missing(run),
        outliers: outliers(run),
        noise_below_zero: noise_below_zero(run),
        refused: refused.collect(),
        speed_range_mps: range(speeds),
        position_range_m: range(run.position_m.iter().copied()),
        mass_kg: spread(samples.iter().filter_map(|sample| sample.get(SampleField::Mass))),
        distance_m: distance_m(run, 0..=usize::MAX),
        phases: phases(run),
    }
}

fn counts(all: impl IntoIterator<Item = (Quantity, usize)>) -> Vec<QuantityCount> {
    all.into_iter()
        .filter(|(_, count)| *count > 0)
        .map(|(quantity, count)| QuantityCount { quantity, count })
        .collect()
}

fn missing(run: &Resolved) -> Vec<QuantityCount> {
    counts(
        run.table.columns().map(|(quantity, values)| {
            (quantity, values.iter().filter(|value| value.is_nan()).count())
        }),
    )
}

/// Returns the mapped quantities behind the two forces.
fn force_quantities(run: &Resolved) -> (Quantity, Quantity) {
    let mapped = |choices: [Quantity; 2], otherwise| {
        choices.into_iter().find(|&q| run.table.column(q).is_some()).unwrap_or(otherwise)
    };
    let control = Quantity::ControlForce;
    (
        mapped([Quantity::TractionForce, Quantity::TractionHandle], control),
        mapped([Quantity::BrakeForce, Quantity::BrakeHandle], control),
    )
}

/// Counts something of both forces, together when they come from one column.
fn of_forces(run: &Resolved, count: impl Fn(&Force) -> usize) -> Vec<(Quantity, usize)> {
    let (traction, brake) = force_quantities(run);
    let (of_traction, of_brake) = (count(&run.forces.traction), count(&run.forces.brake));
    if traction == brake {
        return vec![(traction, of_traction + of_brake)];
    }
    vec![(traction, of_traction), (brake, of_brake)]
}

fn outliers(run: &Resolved) -> Vec<QuantityCount> {
    let marked = |marks: &[bool]| marks.iter().filter(|&&mark| mark).count();
    let mut all = vec![(Quantity::Speed, run.speeds.outliers().count())];
    all.extend(of_forces(run, |force| marked(&force.is_spike) + force.handle_out_of_range));
    counts(all)
}

fn noise_below_zero(run: &Resolved) -> Vec<QuantityCount> {
    let mut all = vec![(Quantity::Speed, run.speeds.zeroed)];
    all.extend(of_forces(run, |force| force.zeroed));
    counts(all)
}

fn spread(values: impl Iterator<Item = f64>) -> Option<MeanAndRange> {
    let (mut low, mut high, mut sum, mut count) = (f64::INFINITY, f64::NEG_INFINITY, 0.0, 0.0);
    for value in values {
        (low, high, sum, count) = (low.min(value), high.max(value), sum + value, count + 1.0);
    }
    (count > 0.0).then_some(MeanAndRange { mean: sum / count, low, high })
}

fn range(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.filter(|value| !value.is_nan()).fold(None, |range, value| match range {
        None => Some((value, value)),
        Some((low, high)) => Some((f64::min(low, value), f64::max(high, value))),
    })
}

/// Returns the integral of the speed over the rows in order within some, by trapezoids between good speeds.
pub(super) fn distance_m(run: &Resolved, within: RangeInclusive<usize>) -> f64 {
    let speeds = &run.speeds;
    let is_good = |row: &usize| {
        within.contains(row) && !speeds.speed_mps[*row].is_nan() && !speeds.is_spike[*row]
    };
    pairs(run.order.rows().filter(is_good))
        .map(|(from, to)| {
            let mean_mps = 0.5 * (run.speeds.speed_mps[from] + run.speeds.speed_mps[to]);
            mean_mps * (run.times_s[to] - run.times_s[from])
        })
        .sum()
}

/// Returns the times of the phases; each step counts for the phase of the row at its start.
fn phases(run: &Resolved) -> Phases {
    let mut phases = Phases::default();
    let least_n = COASTING_SHARE * run.forces.greatest_n;
    for (row, next) in pairs(run.order.rows()) {
        let step_s = run.times_s[next] - run.times_s[row];
        let speed_mps = run.speeds.speed_mps[row];
        let control_n = run.forces.traction.force_n[row] - run.forces.brake.force_n[row];
        let phase = if run.order.counts.is_gap(step_s) || speed_mps.is_nan() {
            &mut phases.unknown_s
        } else if speed_mps < STILL_MPS {
            &mut phases.standstill_s
        } else if control_n.is_nan() {
            &mut phases.unknown_s
        } else if control_n > least_n {
            &mut phases.traction_s
        } else if control_n < -least_n {
            &mut phases.braking_s
        } else {
            &mut phases.coasting_s
        };
        *phase += step_s;
    }
    phases
}

/// Judges the samples of a recorded run, one after the other, as a pipeline would.
pub(super) struct Judge {
    admission: Admission,
    resolver: ForceResolver,
    balance: WindowBalance,
    /// The windows of motion, each with the row that ended it.
    windows: Vec<(usize, WindowMean)>,
    mirrored: Option<MirroredLine>,
    rows: usize,
    /// How many samples are refused for each reason, and the row of the first.
    refused: [(usize, usize); RejectionReason::ALL.len()],
}

impl Judge {
    /// Returns a judge that has seen no sample of its run.
    pub fn new(context: Context, run: &Resolved) -> Self {
        let is_position_recorded = run.position_source == PositionSource::Column;
        let mut admission = Admission::new(DATASET_TRAIN, context.train.clone());
        admission.set_position_measured(is_position_recorded);
        let is_mapped = is_position_recorded && run.gradient_source == GradientSource::Track;
        let mirrored = context.track.filter(|_| is_mapped);
        Judge {
            admission,
            resolver: ForceResolver::new(context.train.clone(), context.track.cloned()),
            balance: WindowBalance::of_all(),
            windows: Vec::new(),
            mirrored: mirrored
                .and_then(|track| MirroredLine::new(track.clone(), context.train.length_m)),
            rows: 0,
            refused: [(0, 0); RejectionReason::ALL.len()],
        }
    }

    /// Takes in the sample of the next row.
    pub fn take(&mut self, sample: &TrainSample) {
        let outcome = self.admission.take(sample, &mut self.resolver, &mut Echo);
        if let Outcome::Rejected(reason) = outcome {
            let (count, first_row) = &mut self.refused[reason as usize];
            *first_row = if *count == 0 { self.rows } else { *first_row };
            *count += 1;
        }
        let window = self.admission.ended_window();
        if let Some(window) = window {
            self.balance.push(window);
            self.windows.push((self.rows, *window));
        }
        self.rows += 1;
        if let Some(mirrored) = &mut self.mirrored {
            mirrored.take(sample, window);
        }
    }

    /// Returns the impossibilities of the samples: those that a pipeline would see, else those that only the run as a
    /// whole shows.
    pub fn detected(&self) -> DetectedFaults {
        let live = self.admission.detected();
        if live.is_empty() {
            gradient_fault(&self.balance).into_iter().collect()
        } else {
            live.clone()
        }
    }

    /// Returns the windows of motion, each with the row that ended it.
    pub fn windows(&self) -> &[(usize, WindowMean)] {
        &self.windows
    }

    /// Returns how forces, gradients and accelerations go together over the whole run.
    pub fn balance(&self) -> WindowBalance {
        self.balance
    }

    /// Returns the same with the gradients of the line read from its other end; no window where that is not known.
    pub fn mirrored(&self) -> WindowBalance {
        self.mirrored.as_ref().map_or_else(WindowBalance::of_all, |mirrored| mirrored.balance)
    }

    /// Returns the reasons for which validation refuses samples, how many, and the row of the first.
    pub fn refused(&self) -> impl Iterator<Item = (RejectionReason, usize, usize)> {
        let counts = RejectionReason::ALL.iter().copied().zip(self.refused);
        counts
            .filter(|(_, (count, _))| *count > 0)
            .map(|(reason, (count, row))| (reason, count, row))
    }
}

/// How forces and accelerations go together with the gradients of a line that is read from its other end.
struct MirroredLine {
    track: Arc<Track>,
    line_m: f64,
    train_m: f64,
    /// Position in m where the present window began.
    from_m: Option<f64>,
    balance: WindowBalance,
}

impl MirroredLine {
    /// Returns one without windows, for a train of a length in m; `None` for a line of unknown length.
    fn new(track: Arc<Track>, train_m: f64) -> Option<Self> {
        let (line_m, balance) = (track.length_m?, WindowBalance::of_all());
        Some(MirroredLine { track, line_m, train_m, from_m: None, balance })
    }

    /// Takes in a sample, with the means of the window of motion that it ended.
    fn take(&mut self, sample: &TrainSample, window: Option<&WindowMean>) {
        let position_m = sample.get(SampleField::Position);
        if let (Some(window), Some(from_m), Some(to_m)) = (window, self.from_m, position_m) {
            let middle_m = self.line_m - 0.5 * (from_m + to_m);
            let permille = self.track.gradient_permille(middle_m, self.train_m).unwrap_or(0.0);
            let climb = -1e-3 * f64::from(sample.direction) * permille;
            let gradient_mps2 = GRAVITY_MPS2 * climb;
            self.balance.push(&WindowMean { gradient_mps2, ..*window });
        }
        if window.is_some() || self.from_m.is_none() {
            self.from_m = position_m;
        }
    }
}
