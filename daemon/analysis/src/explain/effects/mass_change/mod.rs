//! A mass that differs from the declared one: between certain places in one direction, or in certain windows of time of
//! a run. The mass changes only while the train stands.

mod masses;

use std::sync::Arc;

use dynocar_model::terms::masses::{LEAST_SHARE, WEIGHED_STD};

use super::{Candidate, Certainty, Policy, Proposal};
use crate::explain::evidence::{EQUAL, RunData};
use crate::explain::hypothesis::SharedHypothesis;
use crate::explain::places::span_m;
use crate::explain::scan::{Scan, Tuple};
use crate::parallel;
use masses::{Along, FactorPart, Masses, STATION_M, STOP_MIN_S, stations, stops};

/// Greatest number of sections or windows; runs that have another mass as a whole may be half of all.
const PARTS_MAX: usize = 5;
/// Whole runs that explain at least this share of the explanation by the best one are added with it.
const WITH_BEST_SHARE: f64 = 0.5;
/// Own factor of a run, in standard deviations of weighed loads, beyond which it is another mass.
const BEYOND_LOADS: f64 = 2.0;

/// Loads differ from run to run, so that a change of mass is never certain.
pub const POLICY: Policy =
    Policy { certainty: Certainty::Never, is_sought_with_nuisance: false, ..Policy::USUAL };

/// Proposes structures for the data at hand.
pub fn propose(scan: &Scan) -> Proposal {
    scan.requires_known_loads()?;
    let mut candidates = Vec::new();
    let sections = all_sections(scan);
    if !sections.is_empty() {
        candidates.extend(grow(scan, &sections));
    }
    candidates.extend(grow(scan, &all_windows(scan)));
    candidates.extend(everywhere(scan));
    Ok(candidates)
}

/// Response to a mass factor slightly above 1: traction and brake force move more mass, while all forces that scale
/// with the weight stay.
fn shape(run: &RunData, index: usize) -> f64 {
    let sample = &run.samples()[index];
    -sample.control_force_n().unwrap_or(0.0) / sample.inertial_mass_kg
}

/// Every section between two stations in one direction, with its tuple; none where positions are not
/// measured, for then the runs share no places.
fn all_sections(scan: &Scan) -> Vec<(FactorPart, Tuple)> {
    if scan.problem.positions.distance_ratio.is_none() {
        return Vec::new();
    }
    let stations = stations(scan);
    let mut sections = Vec::new();
    for direction in [Some(1.0), Some(-1.0)] {
        let part = |from: usize, to: usize| FactorPart {
            ends: [stations[from], stations[to]],
            along: Along::Line(direction),
        };
        let elementary: Vec<Tuple> = (0..stations.len().saturating_sub(1))
            .map(|k| part_tuple(scan, &part(k, k + 1)))
            .collect();
        sections.extend(joined(&elementary, part));
    }
    sections
}

/// The tuple of another mass in a part.
fn part_tuple(scan: &Scan, part: &FactorPart) -> Tuple {
    let mut sum = Tuple::zero(scan.fit.theta.len());
    for (index, run) in scan.problem.runs.iter().enumerate() {
        if part.is_in(run) {
            let masked =
                |run: &RunData, i: usize| if part.holds(run, i) { shape(run, i) } else { 0.0 };
            sum.add(&scan.run_tuple(index, masked));
        }
    }
    sum
}

/// Returns the own factors on the control force, less 1, of the runs in which a part holds from their beginning to their
/// end; `None` of a part that begins or ends within a run.
fn factors_of_whole_runs(scan: &Scan, part: &FactorPart) -> Option<Vec<f64>> {
    let mut factors = Vec::new();
    for (index, run) in scan.problem.runs.iter().enumerate().filter(|(_, run)| part.is_in(run)) {
        let mut held = run.bins.iter().map(|bin| part.holds(run, bin.middle()));
        let is_first_held = held.next()?;
        if held.any(|is_held| is_held != is_first_held) {
            return None;
        }
        if is_first_held {
            factors.push(scan.fit.own_factors(index)[0]);
        }
    }
    Some(factors)
}

/// Returns the decrease of the cost by another mass over whole runs, and its factor less 1, by the runs' own factors:
/// these take such a mass up, and leave the scan hardly a trace of it. `None` where they are as weighed loads are.
fn of_whole_runs(scan: &Scan, part: &FactorPart) -> Option<(f64, f64)> {
    let factors = factors_of_whole_runs(scan, part)?;
    let count = factors.len() as f64;
    let mean = factors.iter().sum::<f64>() / count;
    let deviations = mean / scan.fit.noise.scatter.force;
    let is_beyond_loads = mean.abs() > BEYOND_LOADS * WEIGHED_STD;
    is_beyond_loads.then(|| (count * deviations * deviations, -mean / (1.0 + mean)))
}

/// Every row of neighbouring parts whose ends carry a force, with the sum of their tuples.
fn joined(
    elementary: &[Tuple],
    part: impl Fn(usize, usize) -> FactorPart,
) -> impl Iterator<Item = (FactorPart, Tuple)> {
    (0..elementary.len()).flat_map(move |from| {
        let mut sum = Tuple::zero(elementary[from].cross.len());
        let mut rows = Vec::new();
        for to in from..elementary.len() {
            sum.add(&elementary[to]);
            if elementary[to].square > 0.0 && elementary[from].square > 0.0 {
                rows.push((part(from, to + 1), sum.clone()));
            }
        }
        rows
    })
}

/// Every section between neighbouring stations with a factor of its own: loads that change at every stop.
fn every(parts: &[(FactorPart, Tuple)]) -> Candidate {
    let is_within = |part: &FactorPart, other: &FactorPart| {
        let ([from, to], [low, high]) = (part.ends, other.ends);
        !part.is_apart(other) && from <= low && high <= to && part != other
    };
    let is_least = |part: &&FactorPart| !parts.iter().any(|(other, _)| is_within(part, other));
    let least: Vec<FactorPart> =
        parts.iter().map(|(part, _)| part).filter(is_least).cloned().collect();
    let start = vec![1.0; least.len()];
    Candidate::new(Masses::of_all(least), start)
}

/// One factor in all runs: nothing to choose but whether there are parts at all.
pub fn everywhere(scan: &Scan) -> Option<Candidate> {
    let [low, high] = span_m(scan)?;
    let runs = &scan.problem.runs;
    let first = runs.first()?.direction;
    let direction = runs.iter().all(|run| run.direction == first).then_some(first);
    let ends = [low - STATION_M, high + STATION_M];
    let part = FactorPart { ends, along: Along::Line(direction) };
    let (_, estimate) = scan.gain(&scan.tuple(shape));
    let start = vec![(1.0 + estimate).clamp(0.7, 1.5)];
    let choice_cost = 2.0 * std::f64::consts::LN_2;
    Some(Candidate::new(Masses::new(part, Vec::new(), choice_cost), start))
}

/// Every section between two stops of a run, with its tuple.
fn all_windows(scan: &Scan) -> Vec<(FactorPart, Tuple)> {
    let mut windows = Vec::new();
    for run in &scan.problem.runs {
        let mut edges = vec![0.0];
        edges.extend(stops(run).iter().map(|stop| 0.5 * (stop.0 + stop.1)));
        edges.push(run.duration_s());
        edges.dedup_by(|one, other| *one - *other < STOP_MIN_S);
        let part = |from: usize, to: usize| FactorPart {
            ends: [edges[from], edges[to]],
            along: Along::Run(run.file.clone(), run.offset_s),
        };
        let elementary: Vec<Tuple> =
            (0..edges.len() - 1).map(|k| part_tuple(scan, &part(k, k + 1))).collect();
        windows.extend(joined(&elementary, part));
    }
    windows
}

/// Returns whether a part is a run from its beginning to its end.
fn is_whole_run(scan: &Scan, part: &FactorPart) -> bool {
    matches!(part.along, Along::Run(..)) && factors_of_whole_runs(scan, part).is_some()
}

/// A part that may be added: the decrease of the cost, its factor less 1, and where it is.
type Gain = (f64, f64, FactorPart);

/// Returns the parts of another mass that are worth reporting, the best first.
fn ranked(scan: &Scan, tuples: impl Iterator<Item = (FactorPart, Tuple)>) -> Vec<Gain> {
    let gain_of = |(part, tuple): (FactorPart, Tuple)| {
        let by_scan = scan.gain(&tuple);
        let of_runs = of_whole_runs(scan, &part).filter(|it| it.0 > by_scan.0);
        let (gain, estimate) = of_runs.unwrap_or(by_scan);
        (gain, estimate, part)
    };
    let mut gains: Vec<Gain> = tuples.map(gain_of).collect();
    gains.retain(|(_, estimate, _)| estimate.abs() > LEAST_SHARE);
    gains.sort_by(|one, other| other.0.total_cmp(&one.0));
    gains
}

/// Returns the first of the ranked parts; where it is a whole run, with the others that explain about as much: the
/// masses of runs do not depend on each other.
fn leading(scan: &Scan, ranked: Vec<Gain>, count_max: usize) -> Vec<Gain> {
    let mut leading: Vec<Gain> = Vec::new();
    for gain in ranked {
        let is_along = leading.first().is_none_or(|best| {
            gain.0 >= WITH_BEST_SHARE * best.0
                && leading.iter().all(|own| own.2.is_apart(&gain.2))
                && is_whole_run(scan, &best.2)
                && is_whole_run(scan, &gain.2)
        });
        if is_along && leading.len() < count_max {
            leading.push(gain);
        }
    }
    leading
}

/// Adds parts, each fitted with a factor of its own, while they explain something; where no end of it comes in sight on
/// the line, all of them besides.
fn grow(scan: &Scan, parts: &[(FactorPart, Tuple)]) -> Vec<Candidate> {
    let part_cost = 2.0 * (parts.len().max(2) as f64).ln();
    let edges = |part: &FactorPart| part.edges(parts.iter().map(|(other, _)| other));
    let most_runs = scan.problem.runs.len() / 2 + 1;
    let mut masses = Masses::default();
    let mut start: Vec<f64> = Vec::new();
    let mut found = leading(scan, ranked(scan, parts.iter().cloned()), most_runs);
    while !found.is_empty() {
        for (_, estimate, part) in found {
            let edges = edges(&part);
            masses.push(part, edges, part_cost);
            start.push((1.0 + estimate).clamp(0.7, 1.5));
        }
        let are_runs = masses.parts().iter().all(|part| is_whole_run(scan, part));
        let count_max = if are_runs { PARTS_MAX.max(most_runs) } else { PARTS_MAX };
        let room = count_max.saturating_sub(masses.parts().len());
        if room == 0 {
            break;
        }
        let more: [(SharedHypothesis, Vec<f64>); 1] = [(Arc::new(masses.clone()), start)];
        let fit = scan.problem.grown(scan.fit, more);
        start = fit.theta[scan.fit.theta.len()..].to_vec();
        let Some(next) = Scan::new(scan.problem, scan.holdout, scan.train, scan.track, &fit) else {
            break;
        };
        let fresh = parallel::of_each(parts, |(part, _)| {
            let is_free = masses.parts().iter().all(|own| own.is_apart(part));
            is_free.then(|| (part.clone(), part_tuple(&next, part)))
        });
        let mut gains = ranked(&next, fresh.into_iter().flatten());
        gains.retain(|(gain, ..)| *gain > part_cost + EQUAL);
        found = leading(&next, gains, room);
    }
    let whole_runs = masses.parts().iter().filter(|part| is_whole_run(scan, part)).count();
    // Another mass in most runs is one in all of them, or another effect.
    if masses.parts().is_empty() || 2 * whole_runs > scan.problem.runs.len() {
        return Vec::new();
    }
    let is_everywhere = masses.parts().len() == PARTS_MAX
        && matches!(masses.parts(), [FactorPart { along: Along::Line(_), .. }, ..]);
    let mut candidates = vec![Candidate::new(masses, start)];
    candidates.extend(is_everywhere.then(|| every(parts)));
    candidates
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_section_between_neighbouring_stations_is_there_once() {
        let ends = [0.0, 900.0, 2100.0, 3000.0];
        let section = |from: usize, to: usize, towards: f64| FactorPart {
            ends: [ends[from], ends[to]],
            along: Along::Line(Some(towards)),
        };
        let mut parts = Vec::new();
        for towards in [1.0, -1.0] {
            for from in 0..3 {
                for to in from + 1..=3 {
                    parts.push((section(from, to, towards), Tuple::zero(3)));
                }
            }
        }
        let candidate = every(&parts);
        assert_eq!(candidate.start, vec![1.0; 6]);
        assert_eq!(candidate.hypothesis.parameters().len(), 6);
        let known = candidate.hypothesis.nature().prior.unwrap();
        assert!((known[(0, 0)] - 100.0).abs() < 1e-9 && known[(0, 1)] == 0.0);
    }
}
