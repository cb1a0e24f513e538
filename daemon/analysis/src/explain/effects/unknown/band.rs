//! A residual that is real but fits no kind of the library: an extra force in a range of some covariate, with the shapes
//! that it may have there. It is not an explanation; it shows where to look for one.

use std::collections::BTreeMap;
use std::sync::Arc;

use dynocar_model::force::ResolvedSample;
use dynocar_model::terms::Parameter;
use dynocar_model::terms::extra::Covariate;
use dynocar_shared::vocabulary::EffectKind;

use crate::explain::answer::{CovariateRange, Location};
use crate::explain::effects::{Candidate, Handling, Hypothesis, Nature, On, SharedHypothesis};
use crate::explain::evidence::{Bin, OUTSIDE_COST, RunData, SampleForces};
use crate::explain::places::{Axis, IntervalEnd, MAP_ERROR_PERMILLE, Reach};
use crate::explain::scan::{Scan, Tuple};
use crate::parallel;
use crate::statistics::{greatest_first, span};

/// Cells into which the range of a covariate is cut.
const CELLS: usize = 20;
/// Motion in s that a band must hold.
const BAND_MIN_S: f64 = 60.0;

#[derive(Clone, Debug)]
struct Band {
    axis: BandAxis,
    low: f64,
    high: f64,
    /// Least and greatest value of the covariate, and the width of a cell.
    span: [f64; 2],
    cell: f64,
    /// Files of all fit runs, by number, for the covariate `Run`.
    files: Vec<String>,
    choice_cost: f64,
}

/// Returns for each covariate the range in which an extra force explains most, with its gain; the best first.
pub fn bands(scan: &Scan) -> Vec<(f64, Candidate)> {
    let bands = parallel::of_each(&AXES, |&axis| best_band(scan, axis));
    let mut bands: Vec<(f64, Candidate)> = bands.into_iter().flatten().collect();
    greatest_first(&mut bands, |it| it.0);
    bands
}

/// Equal cells of the range of a covariate.
struct Cells {
    low: f64,
    width: f64,
    count: usize,
    /// Scan statistics of an extra force in each band.
    tuples: Vec<Tuple>,
    /// Motion in s in each.
    seconds: Vec<f64>,
}

impl Cells {
    /// `None` where the covariate does not vary.
    fn of(scan: &Scan, axis: BandAxis) -> Option<Self> {
        let runs = &scan.problem.runs;
        let by_run: Vec<Vec<Option<f64>>> = runs
            .iter()
            .enumerate()
            .map(|(number, run)| {
                let middles = run.bins.iter().map(Bin::middle);
                middles.map(|i| axis.value(run, Some(number), i)).collect()
            })
            .collect();
        let [low, high] = span(by_run.iter().flatten().flatten().copied())?;
        if high - low < 1e-6 || !(high - low).is_finite() {
            return None;
        }
        let is_run = axis == BandAxis::Run;
        let count = if is_run { runs.len() } else { CELLS };
        let width = if is_run { 1.0 } else { (high - low) / count as f64 * (1.0 + 1e-9) };
        let low = if is_run { -0.5 } else { low };
        let tuples = vec![Tuple::zero(scan.fit.theta.len()); count];
        let mut cells = Cells { low, width, count, tuples, seconds: vec![0.0; count] };
        for (number, values) in by_run.iter().enumerate() {
            cells.add_run(scan, axis, number, values);
        }
        Some(cells)
    }

    fn edge(&self, cell: usize) -> f64 {
        self.low + self.width * cell as f64
    }

    fn add_run(&mut self, scan: &Scan, axis: BandAxis, number: usize, values: &[Option<f64>]) {
        let run = &scan.problem.runs[number];
        let time_s = run.recording.time_s();
        let mut shapes: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
        for (k, (bin, value)) in run.bins.iter().zip(values).enumerate() {
            let Some(value) = value else { continue };
            let cell = (((value - self.low) / self.width) as usize).min(self.count - 1);
            let shape = shapes.entry(cell).or_insert_with(|| vec![0.0; run.bins.len()]);
            shape[k] = axis.shape(scan, &run.samples()[bin.middle()]);
            self.seconds[cell] += time_s[bin.end - 1] - time_s[bin.first];
        }
        for (cell, shape) in shapes {
            self.tuples[cell].add(&scan.shape_tuple(number, &shape));
        }
    }
}

/// The range of a covariate in which an extra force explains most.
fn best_band(scan: &Scan, axis: BandAxis) -> Option<(f64, Candidate)> {
    let cells = Cells::of(scan, axis)?;
    let count = cells.count;
    let mut best: Option<(f64, f64, usize, usize)> = None;
    for from in 0..count {
        let mut sum = Tuple::zero(scan.fit.theta.len());
        let mut seconds_s = 0.0;
        for to in from..count {
            sum.add(&cells.tuples[to]);
            let (gain, estimate) = scan.gain(&sum);
            seconds_s += cells.seconds[to];
            // A force that acts everywhere is a resistance or a scale.
            let is_part = to + 1 - from < count;
            if is_part && seconds_s > BAND_MIN_S && best.is_none_or(|best| gain > best.0) {
                best = Some((gain, estimate, from, to + 1));
            }
        }
    }
    let (gain, estimate, from, to) = best?;
    let structures = AXES.len() as f64 * (count * (count + 1)) as f64 / 2.0;
    let choice_cost = OUTSIDE_COST + 2.0 * structures.ln();
    let files = scan.problem.runs.iter().map(|run| run.file.clone()).collect();
    let (low, high) = (cells.edge(from), cells.edge(to));
    let span = [cells.edge(0), cells.edge(count)];
    let band = Band { axis, low, high, span, cell: cells.width, files, choice_cost };
    Some((gain, Candidate::new(band, vec![estimate])))
}

impl Band {
    /// The number of a run among the fit runs.
    fn number(&self, run: &RunData) -> Option<usize> {
        self.files.iter().position(|file| *file == run.file)
    }

    /// Returns whether a sample of a run with this number lies in it.
    #[inline]
    fn holds(&self, run: &RunData, number: Option<usize>, index: usize) -> bool {
        let value = self.axis.value(run, number, index);
        value.is_some_and(|value| value >= self.low && value < self.high)
    }
}

impl Hypothesis for Band {
    fn nature(&self) -> Nature<'_> {
        let is_on_line = self.axis == BandAxis::Of(Covariate::Chainage);
        let is_force = self.axis.is_force();
        Nature {
            choice_cost: self.choice_cost,
            // A band of chainage is an error of the map, which every passage has in full.
            shared_error: if is_on_line { MAP_ERROR_PERMILLE } else { 0.0 },
            handling: if is_force { Handling::Together } else { Handling::Added },
            affine_in: Some(|value| value),
            ..Nature::new(EffectKind::Unknown, self.axis.parameters())
        }
    }

    fn is_material(&self, parameters: &[f64], _c: f64) -> bool {
        let least = match self.axis {
            BandAxis::Of(Covariate::Chainage) => 0.3,
            BandAxis::Of(Covariate::TractionForce) | BandAxis::Of(Covariate::BrakeForce) => 0.02,
            _ => 0.1,
        };
        // At its bound a band stands for something of another form.
        let most = 0.9 * self.axis.parameters()[0].upper;
        (least..most).contains(&parameters[0].abs())
    }

    fn apply(&self, parameters: &[f64], On { run, first, .. }: On, forces: &mut [SampleForces]) {
        let number = self.number(run);
        for (i, force) in (first..).zip(forces) {
            if !self.holds(run, number, i) {
                continue;
            }
            match self.axis {
                BandAxis::Of(Covariate::Chainage) => {
                    force.gradient_permille += run.directions[i] * parameters[0];
                }
                BandAxis::Of(Covariate::TractionForce) => force.traction_n *= 1.0 + parameters[0],
                BandAxis::Of(Covariate::BrakeForce) => force.brake_n *= 1.0 + parameters[0],
                _ => force.resistance.other_n_per_kn += parameters[0],
            }
        }
    }

    fn unit_n_per_kn(&self, _others: &[f64], run: &RunData, n_per_kn: &mut Vec<f64>) {
        let number = self.number(run);
        let unit = |i: usize| match self.axis {
            _ if !self.holds(run, number, i) => 0.0,
            BandAxis::Of(Covariate::Chainage) => run.directions[i],
            _ => 1.0,
        };
        n_per_kn.clear();
        n_per_kn.extend((0..run.samples().len()).map(unit));
    }

    fn formula(&self, parameters: &[f64]) -> Option<String> {
        let (name, [low, high]) = (self.axis.name(), [self.low, self.high]);
        let parameter = &self.axis.parameters()[0];
        Some(format!("{} = {:.4} · ({low:.4} ≤ {name} < {high:.4})", parameter.name, parameters[0]))
    }

    fn ends(&self) -> Vec<IntervalEnd> {
        if self.axis == BandAxis::Run {
            return Vec::new();
        }
        // Bounds of the covariate itself are no ends.
        let end = |is_upper: bool, at: f64, low: f64, high: f64| IntervalEnd {
            axis: Axis::Covariate,
            part: 0,
            is_upper,
            at,
            reach: Reach::Between(low, high),
            fine: 0.1 * self.cell,
            run: None,
        };
        let lower = end(false, self.low, self.span[0], self.high - 0.5 * self.cell);
        let upper = end(true, self.high, self.low + 0.5 * self.cell, self.span[1]);
        let is_inside = |end: &IntervalEnd| end.at > self.span[0] && end.at < self.span[1];
        [lower, upper].into_iter().filter(is_inside).collect()
    }

    fn with_end(&self, end: &IntervalEnd, at: f64) -> Option<SharedHypothesis> {
        let (low, high) = if end.is_upper { (self.low, at) } else { (at, self.high) };
        (low < high).then(|| Arc::new(Band { low, high, ..self.clone() }) as SharedHypothesis)
    }

    fn place(&self) -> Location {
        let mut place = Location::default();
        match self.axis {
            BandAxis::Of(Covariate::Speed) => place.speed_range_mps = Some([self.low, self.high]),
            BandAxis::Of(Covariate::Chainage) => {
                place.intervals_m = Some(vec![[self.low, self.high]])
            }
            BandAxis::Run => {
                let inside = self.files.iter().enumerate().filter(|(k, _)| {
                    let k = *k as f64;
                    k >= self.low && k < self.high
                });
                place.runs = Some(inside.map(|(_, file)| file.clone()).collect());
            }
            _ => {}
        }
        place.covariate =
            Some(CovariateRange { name: self.axis.name().into(), range: [self.low, self.high] });
        place
    }
}

const RESISTANCE: [Parameter; 1] = [Parameter::new("extra_n_per_kn", (-50.0, 50.0), 0.01)];
const GRADIENT: [Parameter; 1] = [Parameter::new("gradient_error_permille", (-30.0, 30.0), 0.01)];
const SHARE: [Parameter; 1] = [Parameter::new("force_error_share", (-0.6, 0.6), 0.002)];

/// Axis along which the bands lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BandAxis {
    Of(Covariate),
    Run,
}

/// All axes.
pub const AXES: [BandAxis; 7] = [
    BandAxis::Of(Covariate::Speed),
    BandAxis::Of(Covariate::Chainage),
    BandAxis::Of(Covariate::TimeSinceStart),
    BandAxis::Of(Covariate::TractionForce),
    BandAxis::Of(Covariate::BrakeForce),
    BandAxis::Of(Covariate::Temperature),
    BandAxis::Run,
];

impl BandAxis {
    /// Its name in the answer, with the unit.
    pub fn name(self) -> &'static str {
        match self {
            BandAxis::Of(covariate) => covariate.name(),
            BandAxis::Run => "run",
        }
    }

    /// At a sample of the fit run with this number; a holdout run has none.
    pub fn value(self, run: &RunData, number: Option<usize>, index: usize) -> Option<f64> {
        match self {
            BandAxis::Of(Covariate::Speed) => Some(run.smooth_mps[index]),
            BandAxis::Of(Covariate::TimeSinceStart) => Some(run.recording.time_s()[index]),
            BandAxis::Of(covariate) => {
                Some(run.covariate(covariate)[index]).filter(|value| !value.is_nan())
            }
            BandAxis::Run => number.map(|number| number as f64),
        }
    }

    /// True where an extra force there is a share of the control force.
    pub fn is_force(self) -> bool {
        matches!(self, BandAxis::Of(Covariate::TractionForce | Covariate::BrakeForce))
    }

    /// Returns the parameters that measure an extra force there.
    pub fn parameters(self) -> &'static [Parameter] {
        match self {
            BandAxis::Of(Covariate::Chainage) => &GRADIENT,
            BandAxis::Of(Covariate::TractionForce) | BandAxis::Of(Covariate::BrakeForce) => &SHARE,
            _ => &RESISTANCE,
        }
    }

    /// Acceleration in m/s² per unit of the parameter.
    pub fn shape(self, scan: &Scan, sample: &ResolvedSample) -> f64 {
        let per_unit = scan.per_unit_resistance_mps2(sample);
        match self {
            // The map's error turns its sign with the direction of travel.
            BandAxis::Of(Covariate::Chainage) => -sample.direction * per_unit,
            BandAxis::Of(Covariate::TractionForce) => {
                sample.traction_force_n.unwrap_or(0.0) / sample.inertial_mass_kg
            }
            BandAxis::Of(Covariate::BrakeForce) => {
                -sample.brake_force_n.unwrap_or(0.0) / sample.inertial_mass_kg
            }
            _ => -per_unit,
        }
    }
}
