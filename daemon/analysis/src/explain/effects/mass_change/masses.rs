//! The structure of a mass change: parts of the line or of a run, each with a mass factor of its own. A mass changes only
//! while the train stands.

use std::sync::Arc;

use dynocar_model::terms::extra::Covariate;
use dynocar_model::terms::{ModelEntry, Parameter, masses};
use dynocar_model::track::MassSection;
use dynocar_shared::vocabulary::EffectKind;
use nalgebra::DMatrix;

use crate::explain::answer::{FoundMassSection, Location, MassWindow, ParameterValue, RunWindow};
use crate::explain::effects::{
    Hypothesis, Nature, On, ReportContext, ReportedValues, SharedHypothesis,
};
use crate::explain::evidence::{RunData, SampleForces};
use crate::explain::places::{Axis, IntervalEnd, Reach, span_m};
use crate::explain::scan::Scan;

/// Parts in which another mass holds.
#[derive(Clone, Debug, Default)]
pub struct Masses {
    parts: Vec<FactorPart>,
    /// For every part, the values where its ends could be; empty where no end was chosen.
    edges: Vec<Vec<f64>>,
    parameters: Vec<Parameter>,
    /// Prior information on the factors; `None` where the parts were chosen one by one.
    information: Option<DMatrix<f64>>,
    choice_cost: f64,
}

impl Masses {
    /// Returns one part with the values where its ends could be, and twice the logarithm of the number of its
    /// alternatives.
    pub fn new(part: FactorPart, edges: Vec<f64>, choice_cost: f64) -> Self {
        let mut masses = Masses::default();
        masses.push(part, edges, choice_cost);
        masses
    }

    /// All of some parts, none of them chosen: loads differ from each other as loads do.
    pub fn of_all(parts: Vec<FactorPart>) -> Self {
        let count = parts.len();
        let each = masses::SUSPECT.prior_std.powi(-2);
        Masses {
            edges: vec![Vec::new(); count],
            parameters: vec![masses::PARAMETER; count],
            information: Some(DMatrix::from_diagonal_element(count, count, each)),
            choice_cost: 0.0,
            parts,
        }
    }

    /// Adds a part with a factor of its own.
    pub fn push(&mut self, part: FactorPart, edges: Vec<f64>, choice_cost: f64) {
        self.parts.push(part);
        self.edges.push(edges);
        self.parameters.push(masses::PARAMETER);
        self.choice_cost += choice_cost;
    }

    /// Where another mass holds, in the order of the factors.
    pub fn parts(&self) -> &[FactorPart] {
        &self.parts
    }
}

impl Hypothesis for Masses {
    fn nature(&self) -> Nature<'_> {
        Nature {
            none: 1.0,
            prior: self.information.as_ref(),
            choice_cost: self.choice_cost,
            affine_in: Some(f64::recip),
            ..Nature::new(EffectKind::MassChange, &self.parameters)
        }
    }

    fn is_material(&self, parameters: &[f64], _c: f64) -> bool {
        parameters.iter().any(|factor| (factor - 1.0).abs() > masses::LEAST_SHARE)
    }

    fn touches(&self, parameter: usize, run: &RunData) -> bool {
        self.parts[parameter].is_in(run)
    }

    fn apply(&self, parameters: &[f64], On { run, first, .. }: On, forces: &mut [SampleForces]) {
        let parts = self.parts.iter().zip(parameters);
        for (part, factor) in parts.filter(|(part, _)| part.is_in(run)) {
            for (i, force) in (first..).zip(&mut *forces) {
                if part.holds(run, i) {
                    force.mass_factor *= factor;
                }
            }
        }
    }

    fn entries(&self, parameters: &[f64]) -> Option<Vec<ModelEntry>> {
        let mut rows = Vec::new();
        for (part, &factor) in self.parts.iter().zip(parameters) {
            let FactorPart { ends: [from_m, to_m], along: Along::Line(_) } = *part else {
                return None;
            };
            let towards = part.directions().into_iter();
            rows.extend(towards.map(|towards| vec![from_m, to_m, towards, factor]));
        }
        Some(vec![ModelEntry::Rows(masses::LIST, rows)])
    }

    fn ends(&self) -> Vec<IntervalEnd> {
        let mut ends = Vec::new();
        for (part, (own, edges)) in self.parts.iter().zip(&self.edges).enumerate() {
            let (axis, run) = match &own.along {
                Along::Line(_) => (Axis::Chainage, None),
                Along::Run(file, _) => (Axis::Time, Some(file.clone())),
            };
            for (is_upper, at) in [false, true].into_iter().zip(own.ends) {
                if !edges.is_empty() {
                    let (reach, run) = (Reach::OneOf(edges.clone()), run.clone());
                    ends.push(IntervalEnd { axis, part, is_upper, at, reach, fine: 0.0, run });
                }
            }
        }
        ends
    }

    fn with_end(&self, end: &IntervalEnd, at: f64) -> Option<SharedHypothesis> {
        let mut moved = self.clone();
        moved.parts[end.part] = self.parts[end.part].with_end(end.is_upper, at)?;
        let others = self.parts.iter().enumerate().filter(|(k, _)| *k != end.part);
        let is_free = others.into_iter().all(|(_, other)| other.is_apart(&moved.parts[end.part]));
        is_free.then(|| Arc::new(moved) as SharedHypothesis)
    }

    fn place(&self) -> Location {
        let windows: Vec<RunWindow> = self.parts.iter().filter_map(FactorPart::window).collect();
        let on_line = self.parts.iter().filter(|part| matches!(part.along, Along::Line(_)));
        let intervals: Vec<[f64; 2]> = on_line.map(|part| part.ends).collect();
        Location {
            windows: (!windows.is_empty()).then_some(windows),
            intervals_m: (!intervals.is_empty()).then_some(intervals),
            ..Location::default()
        }
    }

    fn report(&self, context: &ReportContext) -> ReportedValues {
        let (mut sections, mut windows, mut deviations) = (Vec::new(), Vec::new(), Vec::new());
        for (k, part) in self.parts.iter().enumerate() {
            let (mass_factor, [from_m, to_m]) = (context.parameters[k], part.ends);
            for towards in part.directions() {
                let direction = towards as i8;
                sections.push(FoundMassSection { from_m, to_m, direction, mass_factor });
                deviations.push(context.deviations[k]);
            }
            if let Some(window) = part.window() {
                windows.push(MassWindow { window, mass_factor });
                deviations.push(context.deviations[k]);
            }
        }
        let mut reported = ReportedValues::default();
        let name = if windows.is_empty() {
            reported.values.insert("sections".into(), ParameterValue::Sections(sections));
            "sections"
        } else {
            reported.values.insert("windows".into(), ParameterValue::Windows(windows));
            "windows"
        };
        reported.deviations.insert(name.into(), ParameterValue::List(deviations));
        reported
    }
}

/// Shortest stop in s at which people get on or off.
pub const STOP_MIN_S: f64 = 8.0;
/// Stops within this distance in m are one station.
pub const STATION_M: f64 = 350.0;

/// Part where one mass factor holds, from one end to the other.
#[derive(Clone, Debug, PartialEq)]
pub struct FactorPart {
    /// Both ends: chainages in m or times in s since the run's first sample.
    pub ends: [f64; 2],
    /// The axis of the ends.
    pub along: Along,
}

/// Axis along which a part lies.
#[derive(Clone, Debug, PartialEq)]
pub enum Along {
    /// The line; without a direction the same in both.
    Line(Option<f64>),
    /// The time of a run, by its file; with the time in s of its first sample in the recording's own count.
    Run(String, f64),
}

impl FactorPart {
    /// True when it may hold in a run.
    pub fn is_in(&self, run: &RunData) -> bool {
        match &self.along {
            Along::Line(_) => true,
            Along::Run(file, _) => *file == run.file,
        }
    }

    /// True when sample number `index` of a run in which it may hold lies in it.
    #[inline]
    pub fn holds(&self, run: &RunData, index: usize) -> bool {
        let [from, to] = self.ends;
        match &self.along {
            Along::Line(direction) => {
                let (from_m, to_m, towards) = (from, to, run.directions[index]);
                let direction = direction.unwrap_or(towards);
                let section = MassSection { from_m, to_m, direction, mass_factor: 1.0 };
                let at_m = run.covariate(Covariate::Chainage)[index];
                !at_m.is_nan() && section.holds(at_m, towards)
            }
            Along::Run(..) => (from..=to).contains(&run.recording.time_s()[index]),
        }
    }

    /// The directions in which a section holds; none of a window.
    pub fn directions(&self) -> Vec<f64> {
        match self.along {
            Along::Line(direction) => direction.map_or(vec![1.0, -1.0], |it| vec![it]),
            Along::Run(..) => Vec::new(),
        }
    }

    /// The window of a run; `None` for a section of the line.
    pub fn window(&self) -> Option<RunWindow> {
        let Along::Run(run, offset_s) = &self.along else { return None };
        let [t_start_s, t_end_s] = self.ends.map(|at_s| offset_s + at_s);
        Some(RunWindow { run: run.clone(), t_start_s, t_end_s })
    }

    /// The same with one end elsewhere; `None` when nothing would be left.
    pub fn with_end(&self, is_upper: bool, at: f64) -> Option<FactorPart> {
        let mut moved = self.clone();
        moved.ends[usize::from(is_upper)] = at;
        (moved.ends[0] < moved.ends[1]).then_some(moved)
    }

    /// Ends of those of some parts that lie along the same axis, in ascending order.
    pub fn edges<'p>(&self, parts: impl Iterator<Item = &'p FactorPart>) -> Vec<f64> {
        let same = parts.filter(|other| self.along == other.along);
        let mut edges: Vec<f64> = same.flat_map(|part| part.ends).collect();
        edges.sort_unstable_by(f64::total_cmp);
        edges.dedup();
        edges
    }

    /// True when two parts share no sample.
    pub fn is_apart(&self, other: &FactorPart) -> bool {
        let ([from, to], [other_from, other_to]) = (self.ends, other.ends);
        let do_not_meet = to <= other_from || other_to <= from;
        match (&self.along, &other.along) {
            (Along::Line(one), Along::Line(other)) => {
                do_not_meet || one.zip(*other).is_some_and(|(one, other)| one != other)
            }
            (Along::Run(one, _), Along::Run(other, _)) => one != other || do_not_meet,
            _ => false,
        }
    }
}

/// Standing times of a run: (from, to) in s and the place in m.
pub fn stops(run: &RunData) -> Vec<(f64, f64, Option<f64>)> {
    let (samples, time_s) = (run.samples(), run.recording.time_s());
    let mut stops = Vec::new();
    let mut since: Option<usize> = None;
    for i in 0..=samples.len() {
        let stands = samples.get(i).is_some_and(|sample| sample.speed_mps < 0.2);
        match (since, stands) {
            (None, true) => since = Some(i),
            (Some(from), false) => {
                let at_end = from == 0 || i == samples.len();
                if at_end || time_s[i - 1] - time_s[from] >= STOP_MIN_S {
                    stops.push((time_s[from], time_s[i - 1], samples[from].position_m));
                }
                since = None;
            }
            _ => {}
        }
    }
    stops
}

/// Chainages in m between which the mass cannot change, with the ends of the line.
pub fn stations(scan: &Scan) -> Vec<f64> {
    let Some([low, high]) = span_m(scan) else { return Vec::new() };
    let mut places: Vec<f64> =
        scan.problem.runs.iter().flat_map(stops).filter_map(|stop| stop.2).collect();
    places.sort_unstable_by(f64::total_cmp);
    let mut stations = vec![low - STATION_M];
    let mut group: Vec<f64> = Vec::new();
    for index in places.into_iter().chain([f64::INFINITY]) {
        if group.last().is_some_and(|last| index - last > STATION_M) {
            let station = group[group.len() / 2];
            // Beyond the last station nobody drives on.
            if station - low > STATION_M && high - station > STATION_M {
                stations.push(station);
            }
            group.clear();
        }
        group.push(index);
    }
    stations.push(high + STATION_M);
    stations
}
