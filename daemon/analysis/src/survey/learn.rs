//! From passes with a chainage to a profile: how smooth it is, what the friction brake does.

use rayon::prelude::*;

use super::balance::Observation;
use super::banded::NotPositive;
use super::friction::{FoundBrake, found_brake};
use super::profile::{Evidence, Profile};

/// Variances per m of the gradient's random walk that are tried: from a main line to a street.
const WALKS_PER_M: [f64; 9] = [1e-9, 1e-8, 1e-7, 3e-7, 1e-6, 3e-6, 1e-5, 3e-5, 1e-4];
/// Passes are left out in so many groups.
const FOLDS: u32 = 5;
/// A brake acts over a whole observation when its lowest pressure is so many times the one from
/// which on it may act.
const CLEAR: f64 = 1.5;
/// Where no pass can be left out, blocks of so many m are.
const BLOCK_M: f64 = 100.0;

/// A profile and what it was learned with.
#[derive(Clone, Debug)]
pub struct Learned {
    /// The profile.
    pub profile: Profile,
    /// Variance per m of the gradient's random walk, chosen by leaving passes out.
    pub walk_per_m: f64,
    /// Root mean square in N of the residuals of passes left out, by pass; `NaN` for a pass of
    /// which there is no other.
    pub left_out_n: Vec<f64>,
    /// The friction brake, where it shows.
    pub brake: Option<FoundBrake>,
}

/// Learns profile and friction brake. `evidence` holds all observations; those under a pressure
/// above `acting_from_pa` are left aside unless no brake shows in them.
///
/// # Errors
///
/// When there is nothing to learn from.
pub fn learn(evidence: &mut Evidence, acting_from_pa: f64) -> Result<Learned, NotPositive> {
    let all = std::mem::take(&mut evidence.observations);
    let (braked, free): (Vec<Observation>, Vec<Observation>) =
        all.into_iter().partition(|it| it.friction_pa[2] > acting_from_pa);
    evidence.observations = free;
    let mut walk_per_m = smoothest(evidence)?;
    let mut profile = evidence.fit(walk_per_m, &|_| true, true)?;
    let mut brake = None;
    if !braked.is_empty() {
        let free = std::mem::replace(&mut evidence.observations, braked);
        let points: Vec<(f64, f64)> = evidence
            .residuals(&profile)
            .filter(|(observation, _)| observation.friction_pa[0] > CLEAR * acting_from_pa)
            .map(|(observation, residual_n)| (observation.friction_pa[1], residual_n))
            .collect();
        brake = found_brake(&points);
        let braked = std::mem::replace(&mut evidence.observations, free);
        if brake.is_none() {
            // The recorded force holds the brake's.
            evidence.observations.extend(braked);
            evidence.observations.sort_by_key(|it| it.pass);
            walk_per_m = smoothest(evidence)?;
            profile = evidence.fit(walk_per_m, &|_| true, true)?;
        }
    }
    let left_out_n = left_out(evidence, walk_per_m)?;
    Ok(Learned { profile, walk_per_m, left_out_n, brake })
}

/// True when every alignment has two passes, so that one can be left out.
fn can_leave_out(evidence: &Evidence) -> bool {
    let mut passes = std::collections::BTreeMap::<usize, usize>::new();
    for course in &evidence.courses {
        *passes.entry(course.block).or_default() += 1;
    }
    passes.values().all(|&count| count >= 2)
}

/// Number of the group in which an observation is left out.
fn group(evidence: &Evidence, observation: &Observation, by_pass: bool) -> u32 {
    if !by_pass {
        return (observation.along_m / BLOCK_M).max(0.0) as u32 % FOLDS;
    }
    // Both directions of a line come in turns; a group holds some of each.
    let passes = evidence.courses.len() as u32;
    if passes <= FOLDS { observation.pass } else { (observation.pass / 2) % FOLDS }
}

/// The walk under which what was left out is predicted best: how smooth a line is, some passes of it show.
fn smoothest(evidence: &Evidence) -> Result<f64, NotPositive> {
    let few = evidence.of_few_passes();
    let evidence = if can_leave_out(&few) { &few } else { evidence };
    let by_pass = can_leave_out(evidence);
    let scale_n = evidence.fit(1e-6, &|_| true, false)?.residual_n;
    let cost = |walk_per_m: f64, fold: u32| {
        let is_out = |it: &Observation| group(evidence, it, by_pass) == fold;
        if !evidence.observations.iter().any(is_out) {
            return Ok(0.0);
        }
        let profile = evidence.fit(walk_per_m, &|it| !is_out(it), false)?;
        let residuals = evidence.residuals(&profile).filter(|it| is_out(it.0));
        Ok(residuals.map(|(_, residual_n)| (residual_n / scale_n).powi(2).min(25.0)).sum())
    };
    let folds = WALKS_PER_M.len() * FOLDS as usize;
    let costs = (0..folds).into_par_iter().map(|k| {
        let fold = k % FOLDS as usize;
        cost(WALKS_PER_M[k / FOLDS as usize], fold as u32)
    });
    let costs = costs.collect::<Result<Vec<f64>, NotPositive>>()?;
    let by_walk = costs.chunks(FOLDS as usize).map(|folds| folds.iter().sum::<f64>());
    let best = by_walk.zip(WALKS_PER_M).min_by(|one, other| one.0.total_cmp(&other.0));
    Ok(best.map_or(WALKS_PER_M[0], |(_, walk_per_m)| walk_per_m))
}

/// How far each pass is predicted by the others.
fn left_out(evidence: &Evidence, walk_per_m: f64) -> Result<Vec<f64>, NotPositive> {
    let passes = evidence.courses.len();
    let mut sums = vec![(0.0, 0usize); passes];
    if can_leave_out(evidence) {
        let profiles = (0..FOLDS).into_par_iter().map(|fold| {
            let is_out = |it: &Observation| group(evidence, it, true) == fold;
            let has_some = evidence.observations.iter().any(is_out);
            has_some.then(|| evidence.fit(walk_per_m, &|it| !is_out(it), false)).transpose()
        });
        let profiles = profiles.collect::<Result<Vec<Option<Profile>>, NotPositive>>()?;
        for (fold, profile) in profiles.iter().enumerate() {
            let Some(profile) = profile else { continue };
            let is_out = |it: &Observation| group(evidence, it, true) == fold as u32;
            for (observation, residual_n) in evidence.residuals(profile).filter(|it| is_out(it.0)) {
                let sum = &mut sums[observation.pass as usize];
                *sum = (sum.0 + residual_n * residual_n, sum.1 + 1);
            }
        }
    }
    Ok(sums.iter().map(|(squares, count)| (squares / *count as f64).sqrt()).collect())
}
