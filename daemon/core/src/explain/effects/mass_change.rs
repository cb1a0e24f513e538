//! Another mass than declared: between certain places in one direction, or in certain stretches
//! of time of a run. Mass changes while the train stands.

use dynocar_shared::vocabulary::EffectKind;

use super::{Candidate, Effect, Hypothesis, Parameter, Proposal, ReportContext, Reported};
use crate::explain::answer::{MassSection, MassWindow, ParameterValue, Place, RunWindow};
use crate::explain::evidence::{RunData, SampleForces};
use crate::explain::localise::span_m;
use crate::explain::scan::{Scan, Tuple};

const PARAMETER: Parameter = Parameter::new("mass_factor", (0.5, 2.0), 0.005);
/// Standing for less than this in s lets nobody on or off.
const STOP_MIN_S: f64 = 8.0;
/// Stops within this distance in m are one station.
const STATION_M: f64 = 350.0;
/// Sections or windows at most.
const PARTS_MAX: usize = 5;
/// What another section must explain beyond its choice.
const GAIN_MIN: f64 = 8.0;

/// A smaller change of mass is not worth a word.
const MATERIAL: f64 = 0.012;

/// The kind.
pub struct MassChange;

/// Where one factor holds.
#[derive(Clone, Debug, PartialEq)]
enum Part {
    /// Without a direction: the same in both.
    Section {
        from_m: f64,
        to_m: f64,
        direction: Option<f64>,
    },
    Window {
        run: String,
        from_s: f64,
        to_s: f64,
        offset_s: f64,
    },
}

#[derive(Debug)]
struct Masses {
    parts: Vec<Part>,
    parameters: Vec<Parameter>,
    choice_cost: f64,
}

impl Part {
    fn holds(&self, run: &RunData, index: usize) -> bool {
        match self {
            Part::Section { from_m, to_m, direction } => {
                let sample = &run.samples()[index];
                direction.is_none_or(|direction| sample.direction == direction)
                    && sample.position_m.is_some_and(|at| (*from_m..*to_m).contains(&at))
            }
            Part::Window { run: file, from_s, to_s, .. } => {
                *file == run.file && (*from_s..=*to_s).contains(&run.recording.time_s()[index])
            }
        }
    }
}

/// What a mass factor slightly above 1 does: traction and brake force move more mass, while all
/// that goes with the weight stays.
fn shape(run: &RunData, index: usize) -> f64 {
    let sample = &run.samples()[index];
    -sample.control_force_n().unwrap_or(0.0) / sample.inertial_mass_kg
}

/// Standing times of a run: (from, to) in s and the place in m.
fn stops(run: &RunData) -> Vec<(f64, f64, Option<f64>)> {
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
fn stations(scan: &Scan) -> Vec<f64> {
    let Some([low, high]) = span_m(scan) else { return Vec::new() };
    let mut places: Vec<f64> =
        scan.problem.runs.iter().flat_map(stops).filter_map(|stop| stop.2).collect();
    places.sort_unstable_by(f64::total_cmp);
    let mut stations = vec![low - STATION_M];
    let mut group: Vec<f64> = Vec::new();
    for place in places.into_iter().chain([f64::INFINITY]) {
        if group.last().is_some_and(|last| place - last > STATION_M) {
            let station = group[group.len() / 2];
            // Beyond the last station nobody drives on.
            if station - low > STATION_M && high - station > STATION_M {
                stations.push(station);
            }
            group.clear();
        }
        group.push(place);
    }
    stations.push(high + STATION_M);
    stations
}

impl Effect for MassChange {
    fn kind(&self) -> EffectKind {
        EffectKind::MassChange
    }

    fn propose(&self, scan: &Scan) -> Proposal {
        let mut candidates = Vec::new();
        let sections = all_sections(scan);
        if !sections.is_empty() {
            candidates.extend(grow(scan, &sections));
        }
        candidates.extend(grow(scan, &all_windows(scan)));
        candidates.extend(everywhere(scan));
        Proposal::Candidates(candidates)
    }
}

/// Every stretch between two stations in one direction, with its tuple.
fn all_sections(scan: &Scan) -> Vec<(Part, Tuple)> {
    let stations = stations(scan);
    let mut sections = Vec::new();
    for direction in [Some(1.0), Some(-1.0)] {
        let elementary: Vec<Tuple> = stations
            .windows(2)
            .map(|pair| {
                let part = Part::Section { from_m: pair[0], to_m: pair[1], direction };
                scan.tuple(|run, i| if part.holds(run, i) { shape(run, i) } else { 0.0 })
            })
            .collect();
        for from in 0..elementary.len() {
            let mut sum = Tuple::zero(scan.fit.theta.len());
            for to in from..elementary.len() {
                sum.add(&elementary[to]);
                if elementary[to].square > 0.0 && elementary[from].square > 0.0 {
                    let (from_m, to_m) = (stations[from], stations[to + 1]);
                    sections.push((Part::Section { from_m, to_m, direction }, sum.clone()));
                }
            }
        }
    }
    sections
}

/// One factor in all runs: nothing to choose but whether there are parts at all.
fn everywhere(scan: &Scan) -> Option<Candidate> {
    let [low, high] = span_m(scan)?;
    let runs = &scan.problem.runs;
    let first = runs.first()?.direction;
    let direction = runs.iter().all(|run| run.direction == first).then_some(first);
    let part = Part::Section { from_m: low - STATION_M, to_m: high + STATION_M, direction };
    let (_, estimate) = scan.gain(&scan.tuple(shape));
    let start = vec![(1.0 + estimate).clamp(0.7, 1.5)];
    let choice_cost = 2.0 * std::f64::consts::LN_2;
    let masses = Masses { parts: vec![part], parameters: vec![PARAMETER], choice_cost };
    Some(Candidate::new(masses, start))
}

/// Every stretch between two stops of a run, with its tuple.
fn all_windows(scan: &Scan) -> Vec<(Part, Tuple)> {
    let mut windows = Vec::new();
    for (index, run) in scan.problem.runs.iter().enumerate() {
        let mut edges = vec![0.0];
        edges.extend(stops(run).iter().map(|stop| 0.5 * (stop.0 + stop.1)));
        edges.push(run.duration_s());
        edges.dedup_by(|one, other| *one - *other < STOP_MIN_S);
        let part = |from: usize, to: usize| Part::Window {
            run: run.file.clone(),
            from_s: edges[from],
            to_s: edges[to],
            offset_s: run.offset_s,
        };
        let elementary: Vec<Tuple> = (0..edges.len() - 1)
            .map(|k| {
                let part = part(k, k + 1);
                let masked = |run: &RunData, i: usize| {
                    if part.holds(run, i) { shape(run, i) } else { 0.0 }
                };
                scan.run_tuple(index, masked)
            })
            .collect();
        for from in 0..elementary.len() {
            let mut sum = Tuple::zero(scan.fit.theta.len());
            for to in from..elementary.len() {
                sum.add(&elementary[to]);
                if elementary[to].square > 0.0 && elementary[from].square > 0.0 {
                    windows.push((part(from, to + 1), sum.clone()));
                }
            }
        }
    }
    windows
}

/// Adds parts one by one, each fitted with a factor of its own, while they explain something.
fn grow(scan: &Scan, parts: &[(Part, Tuple)]) -> Option<Candidate> {
    let part_cost = 2.0 * (parts.len().max(2) as f64).ln();
    let best = |scan: &Scan, tuples: &mut dyn Iterator<Item = (Part, Tuple)>| {
        tuples
            .map(|(part, tuple)| {
                let (gain, estimate) = scan.gain(&tuple);
                (gain, estimate, part)
            })
            .filter(|(_, estimate, _)| estimate.abs() > MATERIAL)
            .max_by(|one, other| one.0.total_cmp(&other.0))
    };
    let (_, estimate, part) = best(scan, &mut parts.iter().cloned())?;
    let mut masses =
        Masses { parts: vec![part], parameters: vec![PARAMETER], choice_cost: part_cost };
    let mut start = vec![(1.0 + estimate).clamp(0.7, 1.5)];
    while masses.parts.len() < PARTS_MAX {
        let hypothesis = std::sync::Arc::new(masses.clone());
        let model = scan.fit.model.with(hypothesis);
        let theta = scan.fit.theta.iter().chain(&start).copied().collect();
        let fit = scan.problem.fit(&model, theta, scan.fit.noise);
        start = fit.theta[scan.fit.theta.len()..].to_vec();
        let Some(next) = Scan::new(scan.problem, scan.holdout, scan.train, scan.track, &fit) else {
            break;
        };
        let free = parts.iter().filter(|(part, _)| masses.parts.iter().all(|p| apart(p, part)));
        let mut fresh = free.map(|(part, _)| {
            let masked = |run: &RunData, i: usize| {
                if part.holds(run, i) { shape(run, i) } else { 0.0 }
            };
            (part.clone(), next.tuple(masked))
        });
        match best(&next, &mut fresh) {
            Some((gain, estimate, part))
                if gain > part_cost + GAIN_MIN && estimate.abs() > MATERIAL =>
            {
                masses.parts.push(part);
                masses.parameters.push(PARAMETER);
                masses.choice_cost += part_cost;
                start.push((1.0 + estimate).clamp(0.7, 1.5));
            }
            _ => break,
        }
    }
    Some(Candidate::new(masses, start))
}

/// True when two parts share no sample.
fn apart(one: &Part, other: &Part) -> bool {
    match (one, other) {
        (
            Part::Section { from_m, to_m, direction },
            Part::Section { from_m: from, to_m: to, direction: towards },
        ) => {
            let opposite = direction.zip(*towards).is_some_and(|(one, other)| one != other);
            opposite || to_m <= from || to <= from_m
        }
        (
            Part::Window { run, from_s, to_s, .. },
            Part::Window { run: file, from_s: from, to_s: to, .. },
        ) => run != file || to_s <= from || to <= from_s,
        _ => false,
    }
}

impl Clone for Masses {
    fn clone(&self) -> Self {
        Masses {
            parts: self.parts.clone(),
            parameters: self.parameters.clone(),
            choice_cost: self.choice_cost,
        }
    }
}

impl Hypothesis for Masses {
    fn kind(&self) -> EffectKind {
        EffectKind::MassChange
    }

    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    fn choice_cost(&self) -> f64 {
        self.choice_cost
    }

    fn none(&self) -> f64 {
        1.0
    }

    fn is_material(&self, parameters: &[f64], _c: f64) -> bool {
        parameters.iter().any(|factor| (factor - 1.0).abs() > MATERIAL)
    }

    fn touches(&self, parameter: usize, run: &RunData) -> bool {
        match &self.parts[parameter] {
            Part::Section { .. } => true,
            Part::Window { run: file, .. } => *file == run.file,
        }
    }

    fn apply(&self, parameters: &[f64], run: &RunData, forces: &mut [SampleForces]) {
        for (part, factor) in self.parts.iter().zip(parameters) {
            for (i, force) in forces.iter_mut().enumerate() {
                if part.holds(run, i) {
                    force.mass_factor *= factor;
                }
            }
        }
    }

    fn place(&self) -> Place {
        let windows: Vec<RunWindow> = self
            .parts
            .iter()
            .filter_map(|part| match part {
                Part::Window { run, from_s, to_s, offset_s } => Some(RunWindow {
                    run: run.clone(),
                    t_start_s: offset_s + from_s,
                    t_end_s: offset_s + to_s,
                }),
                Part::Section { .. } => None,
            })
            .collect();
        let intervals: Vec<[f64; 2]> = self
            .parts
            .iter()
            .filter_map(|part| match part {
                Part::Section { from_m, to_m, .. } => Some([*from_m, *to_m]),
                Part::Window { .. } => None,
            })
            .collect();
        Place {
            windows: (!windows.is_empty()).then_some(windows),
            intervals_m: (!intervals.is_empty()).then_some(intervals),
            ..Place::default()
        }
    }

    fn report(&self, context: &ReportContext) -> Reported {
        let (mut sections, mut windows, mut deviations) = (Vec::new(), Vec::new(), Vec::new());
        for (k, part) in self.parts.iter().enumerate() {
            let mass_factor = context.parameters[k];
            match part {
                Part::Section { from_m, to_m, direction } => {
                    for towards in direction.map_or(vec![1.0, -1.0], |direction| vec![direction]) {
                        sections.push(MassSection {
                            from_m: *from_m,
                            to_m: *to_m,
                            direction: towards as i8,
                            mass_factor,
                        });
                        deviations.push(context.deviations[k]);
                    }
                }
                Part::Window { run, from_s, to_s, offset_s } => {
                    windows.push(MassWindow {
                        run: run.clone(),
                        t_start_s: offset_s + from_s,
                        t_end_s: offset_s + to_s,
                        mass_factor,
                    });
                    deviations.push(context.deviations[k]);
                }
            }
        }
        let mut reported = Reported::default();
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
