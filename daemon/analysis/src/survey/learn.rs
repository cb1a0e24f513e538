//! Estimation of a profile from passes with a chainage: its smoothness, and the force of the friction brake from the
//! balance of forces under brake pressure.

use super::banded::NotPositive;
use super::observation::BlockDifference;
use super::profile::{HeightProfile, ProfileEvidence};
use super::recording::RawRecording;
use crate::explain::answer::WithStd;
use crate::parallel;
use crate::statistics::{middle, share_of};

/// Variances per m of the gradient's random walk that are tried: from a main line to a street.
const WALKS_PER_M: [f64; 9] = [1e-9, 1e-8, 1e-7, 3e-7, 1e-6, 3e-6, 1e-5, 3e-5, 1e-4];
/// Number of groups in which passes are left out.
const FOLDS: u32 = 5;
/// Least ratio of the lowest pressure in an observation to the pressure from which a brake may act, if the brake acts
/// over the whole observation.
const CLEAR: f64 = 1.5;
/// Length in m of the blocks that are left out where no pass can be.
const BLOCK_M: f64 = 100.0;

/// A profile with the results of its estimation.
#[derive(Clone, Debug)]
pub struct LearnedProfile {
    /// The profile.
    pub profile: HeightProfile,
    /// Variance per m of the gradient's random walk, chosen by leaving passes out.
    pub walk_per_m: f64,
    /// Root mean square in N of the residuals of passes left out, by pass; `NaN` for a pass without any other.
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
pub fn learn(
    evidence: &mut ProfileEvidence,
    acting_from_pa: f64,
) -> Result<LearnedProfile, NotPositive> {
    let all = std::mem::take(&mut evidence.observations);
    let (braked, free): (Vec<BlockDifference>, Vec<BlockDifference>) =
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
    Ok(LearnedProfile { profile, walk_per_m, left_out_n, brake })
}

/// Returns whether every alignment has two passes, so that one can be left out.
fn can_leave_out(evidence: &ProfileEvidence) -> bool {
    let mut passes = std::collections::BTreeMap::<usize, usize>::new();
    for course in &evidence.courses {
        *passes.entry(course.block).or_default() += 1;
    }
    passes.values().all(|&count| count >= 2)
}

/// Returns the number of the group in which an observation is left out.
fn group(evidence: &ProfileEvidence, observation: &BlockDifference, by_pass: bool) -> u32 {
    if !by_pass {
        return (observation.along_m / BLOCK_M).max(0.0) as u32 % FOLDS;
    }
    // Both directions of a line come in turns; a group holds some of each.
    let passes = evidence.courses.len() as u32;
    if passes <= FOLDS { observation.pass } else { (observation.pass / 2) % FOLDS }
}

/// Returns the walk that predicts left-out observations best; some passes show how smooth a line is.
fn smoothest(evidence: &ProfileEvidence) -> Result<f64, NotPositive> {
    let few = evidence.of_few_passes();
    let evidence = if can_leave_out(&few) { &few } else { evidence };
    let by_pass = can_leave_out(evidence);
    let scale_n = evidence.fit(1e-6, &|_| true, false)?.residual_n;
    let cost = |walk_per_m: f64, fold: u32| {
        let is_out = |it: &BlockDifference| group(evidence, it, by_pass) == fold;
        if !evidence.observations.iter().any(is_out) {
            return Ok(0.0);
        }
        let profile = evidence.fit(walk_per_m, &|it| !is_out(it), false)?;
        let residuals = evidence.residuals(&profile).filter(|it| is_out(it.0));
        Ok(residuals.map(|(_, residual_n)| (residual_n / scale_n).powi(2).min(25.0)).sum())
    };
    let folds = WALKS_PER_M.len() * FOLDS as usize;
    let costs = parallel::of_each_number(folds, |k| {
        let fold = k % FOLDS as usize;
        cost(WALKS_PER_M[k / FOLDS as usize], fold as u32)
    });
    let costs = costs.into_iter().collect::<Result<Vec<f64>, NotPositive>>()?;
    let by_walk = costs.chunks(FOLDS as usize).map(|folds| folds.iter().sum::<f64>());
    let best = by_walk.zip(WALKS_PER_M).min_by(|one, other| one.0.total_cmp(&other.0));
    Ok(best.map_or(WALKS_PER_M[0], |(_, walk_per_m)| walk_per_m))
}

/// Returns how far each pass is predicted by the others.
fn left_out(evidence: &ProfileEvidence, walk_per_m: f64) -> Result<Vec<f64>, NotPositive> {
    let passes = evidence.courses.len();
    let mut sums = vec![(0.0, 0usize); passes];
    if can_leave_out(evidence) {
        let profiles = parallel::of_each_number(FOLDS as usize, |fold| {
            let is_out = |it: &BlockDifference| group(evidence, it, true) == fold as u32;
            let has_some = evidence.observations.iter().any(is_out);
            has_some.then(|| evidence.fit(walk_per_m, &|it| !is_out(it), false)).transpose()
        });
        let profiles =
            profiles.into_iter().collect::<Result<Vec<Option<HeightProfile>>, NotPositive>>()?;
        for (fold, profile) in profiles.iter().enumerate() {
            let Some(profile) = profile else { continue };
            let is_out = |it: &BlockDifference| group(evidence, it, true) == fold as u32;
            for (observation, residual_n) in evidence.residuals(profile).filter(|it| is_out(it.0)) {
                let sum = &mut sums[observation.pass as usize];
                *sum = (sum.0 + residual_n * residual_n, sum.1 + 1);
            }
        }
    }
    Ok(sums.iter().map(|(squares, count)| (squares / *count as f64).sqrt()).collect())
}

/// Fewer observations under pressure say nothing.
const OBSERVATIONS_MIN: usize = 30;
/// Standard deviations below which a gain is not significant.
const SIGNIFICANT: f64 = 8.0;
/// Margin in Pa above the pressure of a released brake.
const MARGIN_PA: f64 = 5e3;

/// A friction brake as it was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundBrake {
    /// Force in N for each Pa.
    pub gain_n_per_pa: WithStd,
    /// Pressure in Pa from which on it acts.
    pub release_pa: f64,
}

/// Returns the pressure in Pa above which a friction brake may act in some recordings: by those under strong traction.
pub fn acting_from_pa<'r>(raws: impl Iterator<Item = &'r RawRecording>) -> f64 {
    let mut under_traction = Vec::new();
    for raw in raws.filter(|raw| !raw.friction_pa.is_empty()) {
        let most_n = raw.control_n.iter().copied().fold(0.0, f64::max);
        for row in 0..raw.time_s.len() {
            let pulls = raw.control_n[row] > 0.2 * most_n && raw.speed_mps[row] > 1.0;
            if pulls && raw.friction_pa[row].is_finite() {
                under_traction.push(raw.friction_pa[row]);
            }
        }
    }
    share_of(&under_traction, 0.95).max(0.0) + MARGIN_PA
}

/// Returns a straight line through (pressure in Pa, missing retarding force in N), robust to single
/// wild ones; `None` where no brake shows.
pub fn found_brake(points: &[(f64, f64)]) -> Option<FoundBrake> {
    if points.len() < OBSERVATIONS_MIN {
        return None;
    }
    let mut weights = vec![1.0; points.len()];
    let (mut gain, mut offset, mut std) = (0.0, 0.0, f64::INFINITY);
    for _ in 0..20 {
        let total: f64 = weights.iter().sum();
        let mean = |of: fn(&(f64, f64)) -> f64| {
            points.iter().zip(&weights).map(|(point, weight)| weight * of(point)).sum::<f64>()
                / total
        };
        let (pressure, force) = (mean(|it| it.0), mean(|it| it.1));
        let (mut top, mut bottom) = (0.0, 0.0);
        for ((p, f), weight) in points.iter().zip(&weights) {
            top += weight * (p - pressure) * (f - force);
            bottom += weight * (p - pressure) * (p - pressure);
        }
        if !(bottom > 0.0) {
            return None;
        }
        gain = top / bottom;
        offset = force - gain * pressure;
        let mut sizes: Vec<f64> =
            points.iter().map(|(p, f)| (f - gain * p - offset).abs()).collect();
        let scale = (1.4826 * middle(&mut sizes)?).max(1e-9);
        std = scale / bottom.sqrt();
        for ((p, f), weight) in points.iter().zip(&mut weights) {
            let ratio = (f - gain * p - offset) / scale;
            *weight = 5.0 / (4.0 + ratio * ratio);
        }
    }
    let release_pa = (-offset / gain).max(0.0);
    let is_clear = gain > SIGNIFICANT * std && release_pa.is_finite();
    let gain_n_per_pa = WithStd { value: gain, std };
    is_clear.then_some(FoundBrake { gain_n_per_pa, release_pa })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_brake_is_found_with_its_release_pressure_and_none_where_none_acts() {
        let noise = |k: usize| 800.0 * ((k * 7919 % 100) as f64 / 50.0 - 1.0);
        let pressure = |k: usize| 25e3 + 1000.0 * (k % 150) as f64;
        let acting: Vec<(f64, f64)> =
            (0..400).map(|k| (pressure(k), 0.25 * (pressure(k) - 20e3) + noise(k))).collect();
        let found = found_brake(&acting).unwrap();
        assert!((found.gain_n_per_pa.value - 0.25).abs() < 4.0 * found.gain_n_per_pa.std);
        assert!((found.release_pa - 20e3).abs() < 1500.0, "{found:?}");
        let idle: Vec<(f64, f64)> = (0..400).map(|k| (pressure(k), noise(k))).collect();
        assert_eq!(found_brake(&idle), None);
    }
}
