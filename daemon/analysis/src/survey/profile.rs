//! The height profile from the balance of forces over all passes.
//!
//! Heights at nodes 10 m apart are unknown, with a random walk of the gradient between them (Wahba 1978: a smoothing
//! spline is such a prior); resistance, mass and the time offset of the forces are estimated jointly with them. The
//! heights make a banded system, the few common unknowns its border; the mass of each pass is fitted in turns, so that
//! the work grows linearly with the number of passes.

use dynocar_shared::resistance::GRAVITY_MPS2;

use super::banded::NotPositive;
use super::normal::{HEIGHT_STEP_M, HeightLayout, LineCourse, Normal};
use super::observation::{BlockDifference, Common, Prior};
use crate::parallel;
use crate::statistics::middle;

/// Standard deviation in m of a row of GNSS altitude: far more than its usual error, since errors last for minutes.
const ALTITUDE_STD_M: f64 = 15.0;
/// Standard deviation of a gradient before the data.
const GRADIENT_STD: f64 = 0.05;
/// Standard deviation of a pass's mass around the declared one, as a share.
const PASS_MASS_STD: f64 = 0.03;
/// Number of rounds that linearise, weigh and fit the passes' masses.
const ROUNDS: usize = 8;
/// Degrees of freedom of the residuals' distribution.
const TAIL: f64 = 4.0;
/// Largest number of passes that counts as few.
const FEW_PASSES: usize = 100;
/// Number of observations that one thread takes at a time.
const CHUNK: usize = 65_536;

/// An altitude that GNSS gave.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Altitude {
    /// The alignment.
    pub course: LineCourse,
    /// Place in m along it.
    pub along_m: f64,
    /// Altitude in m.
    pub altitude_m: f64,
}

/// Everything that a profile is fitted to.
#[derive(Clone, Debug)]
pub struct ProfileEvidence {
    /// Where heights lie.
    pub layout: HeightLayout,
    /// The alignment of each pass.
    pub courses: Vec<LineCourse>,
    /// Observations of the forces, in the order of the passes.
    pub observations: Vec<BlockDifference>,
    /// Altitudes of the GNSS.
    pub altitudes: Vec<Altitude>,
    /// Declared values of the vehicle.
    pub prior: Prior,
}

/// Gradient from a chainage on, up to the next entry.
#[derive(Clone, Copy, Debug)]
pub struct GradientEntry {
    /// Chainage in m.
    pub from_m: f64,
    /// Gradient in ‰, climbing positive.
    pub gradient_permille: f64,
    /// Its standard deviation in ‰.
    pub std_permille: f64,
}

/// A fitted profile.
#[derive(Clone, Debug)]
pub struct HeightProfile {
    layout: HeightLayout,
    /// Heights in m, all blocks.
    heights_m: Vec<f64>,
    /// Values common to all passes.
    pub common: Common,
    /// Standard deviations of the common unknowns, with the heights' noise let in.
    pub common_std: Common,
    /// Mass of each pass over its declared one, less 1, given the common factor.
    pub pass_mass: Vec<f64>,
    /// Scale in N of the residuals.
    pub residual_n: f64,
    /// Correlation of each residual with the one before it.
    pub autocorrelation: f64,
    /// Variance of gradients, block by block, per node.
    gradient_var: Vec<Vec<f64>>,
}

/// Which observations count.
pub type Fold<'f> = &'f (dyn Fn(&BlockDifference) -> bool + Sync);

/// Returns whether a pass is one of the few, evenly chosen and of both directions alike, that show a property of the
/// line or of the recordings which needs no average over all passes.
pub fn is_one_of_few(pass: usize, passes: usize) -> bool {
    // Both directions of a line come in turns.
    (pass / 2).is_multiple_of(one_in(passes))
}

/// Returns the step with which passes are thinned to a few.
fn one_in(passes: usize) -> usize {
    passes.div_ceil(FEW_PASSES).max(1)
}

impl ProfileEvidence {
    /// Returns the evidence of a few passes.
    pub fn of_few_passes(&self) -> ProfileEvidence {
        let (passes, each) = (self.courses.len(), one_in(self.courses.len()));
        let is_chosen = |pass: usize| is_one_of_few(pass, passes);
        let mut numbers = vec![None; self.courses.len()];
        let chosen = (0..self.courses.len()).filter(|&pass| is_chosen(pass));
        chosen.enumerate().for_each(|(number, pass)| numbers[pass] = Some(number as u32));
        let renumbered = |it: &BlockDifference| {
            Some(BlockDifference { pass: numbers[it.pass as usize]?, ..*it })
        };
        let courses = self.courses.iter().enumerate().filter(|(pass, _)| is_chosen(*pass));
        ProfileEvidence {
            layout: self.layout.clone(),
            courses: courses.map(|(_, course)| *course).collect(),
            observations: self.observations.iter().filter_map(renumbered).collect(),
            altitudes: self.altitudes.iter().step_by(each).copied().collect(),
            prior: self.prior,
        }
    }

    /// Fits the profile for a variance per m of the gradient's random walk.
    ///
    /// # Errors
    ///
    /// When the system has no solution, as without any observation.
    pub fn fit(
        &self,
        walk_per_m: f64,
        counts: Fold,
        wants_std: bool,
    ) -> Result<HeightProfile, NotPositive> {
        let size = self.layout.size();
        let mut state = HeightProfile {
            layout: self.layout.clone(),
            heights_m: vec![0.0; size],
            common: self.prior.start(),
            common_std: self.prior.start(),
            pass_mass: vec![0.0; self.courses.len()],
            // Before anything is known, a gradient of 2 % is noise.
            residual_n: 0.02 * GRAVITY_MPS2 * self.prior.mass_kg,
            autocorrelation: 0.0,
            gradient_var: Vec::new(),
        };
        for round in 0..ROUNDS {
            let is_last = round + 1 == ROUNDS;
            self.improve(&mut state, walk_per_m, counts, wants_std && is_last)?;
            self.fit_masses(&mut state, counts);
        }
        state.autocorrelation = self.autocorrelation(&state, counts);
        Ok(state)
    }

    /// One step of Gauss and Newton over heights and common unknowns.
    fn improve(
        &self,
        state: &mut HeightProfile,
        walk_per_m: f64,
        counts: Fold,
        wants_std: bool,
    ) -> Result<(), NotPositive> {
        let reach_max_m = self.observations.iter().map(|it| it.reach_m).fold(0.0, f64::max);
        let none = || Normal::zeros(self.layout.size(), self.layout.width(reach_max_m));
        let mut normal = none();
        self.add_priors(state, walk_per_m, &mut normal);
        normal.add_common(self.prior.rows(&state.common));
        let of_chunk = |observations: &[BlockDifference]| {
            let (mut normal, mut row) = (none(), Vec::with_capacity(16));
            for observation in observations.iter().filter(|it| counts(it)) {
                let course = self.courses[observation.pass as usize];
                self.layout.gradient(course, observation.along_m, observation.reach_m, &mut row);
                let (residual_n, mass_kg, unit) = state.residual(observation, &row, &self.prior);
                let weight = state.weight(residual_n);
                for entry in &mut row {
                    entry.1 *= mass_kg * GRAVITY_MPS2;
                }
                let slopes = self.prior.slopes(observation, mass_kg, unit);
                normal.add_row(&row, &slopes, (residual_n, weight));
            }
            normal
        };
        // Added up in order: the same on any number of threads.
        let chunks: Vec<&[BlockDifference]> = self.observations.chunks(CHUNK).collect();
        let chunks = parallel::of_each(&chunks, |observations| of_chunk(observations));
        chunks.into_iter().for_each(|chunk| normal.add(chunk));
        let mut sizes_n = std::mem::take(&mut normal.sizes_n);
        let step = normal.solve()?;
        for (height, change) in state.heights_m.iter_mut().zip(&step.heights_m) {
            *height += change;
        }
        state.common.0 += step.common.0;
        state.common_std = step.common_std();
        if wants_std {
            state.gradient_var = self.layout.gradient_variances(&step);
        }
        if let Some(middle_n) = middle(&mut sizes_n) {
            // The first residuals hold the whole profile and say little of the noise.
            state.residual_n = (1.4826 * middle_n).max(0.3 * state.residual_n);
        }
        Ok(())
    }

    /// Smoothness of the gradient, a gradient of nothing, and GNSS altitudes.
    fn add_priors(&self, state: &HeightProfile, walk_per_m: f64, normal: &mut Normal) {
        let (heights, Normal { matrix, right, .. }) = (&state.heights_m, normal);
        let mut add = |row: &[(usize, f64)], target: f64, weight: f64| {
            let now: f64 = row.iter().map(|&(node, value)| value * heights[node]).sum();
            matrix.add_row(row, weight);
            for &(node, value) in row {
                right[node] += weight * value * (target - now);
            }
        };
        for &(first, count) in &self.layout.blocks {
            let walk = 1.0 / (walk_per_m * HEIGHT_STEP_M);
            let level = 10.0 / (GRADIENT_STD * GRADIENT_STD * count as f64);
            let per_m = 1.0 / HEIGHT_STEP_M;
            for node in first..first + count - 1 {
                add(&[(node, -per_m), (node + 1, per_m)], 0.0, level);
                if node + 2 < first + count {
                    let bend = [(node, per_m), (node + 1, -2.0 * per_m), (node + 2, per_m)];
                    add(&bend, 0.0, walk);
                }
            }
            add(&[(first, 1.0)], 0.0, 1e-6);
        }
        let mut row = Vec::with_capacity(2);
        for altitude in &self.altitudes {
            row.clear();
            let at_m = altitude.course.in_block(altitude.along_m);
            self.layout.push(altitude.course.block, at_m, 1.0, &mut row);
            let now: f64 = row.iter().map(|&(node, value)| value * heights[node]).sum();
            let ratio = (altitude.altitude_m - now) / ALTITUDE_STD_M;
            let weight = 1.0 / (1.0 + ratio * ratio) / (ALTITUDE_STD_M * ALTITUDE_STD_M);
            add(&row, altitude.altitude_m, weight);
        }
    }

    /// The mass of each pass, given all else.
    fn fit_masses(&self, state: &mut HeightProfile, counts: Fold) {
        let of_pass = |observations: &[BlockDifference]| {
            let pass = observations[0].pass as usize;
            let mut row = Vec::with_capacity(16);
            let (mut top, mut bottom) = (0.0, 1.0 / (PASS_MASS_STD * PASS_MASS_STD));
            let mut counted = observations.iter().filter(|it| counts(it)).peekable();
            counted.peek()?;
            for observation in counted {
                let BlockDifference { along_m, reach_m, .. } = *observation;
                self.layout.gradient(self.courses[pass], along_m, reach_m, &mut row);
                let (residual_n, _, unit) = state.residual(observation, &row, &self.prior);
                let slope = observation.mass_kg * unit;
                let weight = state.weight(residual_n);
                top += weight * slope * (residual_n + slope * state.pass_mass[pass]);
                bottom += weight * slope * slope;
            }
            Some((pass, top / bottom))
        };
        let by_pass = self.observations.chunk_by(|one, next| one.pass == next.pass);
        let by_pass: Vec<&[BlockDifference]> = by_pass.collect();
        let masses = parallel::of_each(&by_pass, |observations| of_pass(observations));
        let masses: Vec<(usize, f64)> = masses.into_iter().flatten().collect();
        // The part that all passes share is the vehicle's, and moves there at once.
        let mean = masses.iter().map(|it| it.1).sum::<f64>() / masses.len().max(1) as f64;
        state.pass_mass.fill(-mean);
        masses.into_iter().for_each(|(pass, mass)| state.pass_mass[pass] = mass - mean);
        state.common.0[3] += mean;
    }

    /// Returns the residuals in N with their observations.
    pub fn residuals<'e>(
        &'e self,
        profile: &'e HeightProfile,
    ) -> impl Iterator<Item = (&'e BlockDifference, f64)> + 'e {
        let mut row = Vec::with_capacity(16);
        self.observations.iter().map(move |observation| {
            let course = self.courses[observation.pass as usize];
            self.layout.gradient(course, observation.along_m, observation.reach_m, &mut row);
            (observation, profile.residual(observation, &row, &self.prior).0)
        })
    }

    fn autocorrelation(&self, profile: &HeightProfile, counts: Fold) -> f64 {
        let (mut product, mut square, mut last) = (0.0, 0.0, None);
        let bound = 4.0 * profile.residual_n;
        for (observation, residual_n) in self.residuals(profile).filter(|it| counts(it.0)) {
            let residual_n = residual_n.clamp(-bound, bound);
            if let Some((pass, before_n)) = last
                && pass == observation.pass
            {
                product += residual_n * before_n;
                square += residual_n * residual_n;
            }
            last = Some((observation.pass, residual_n));
        }
        if square > 0.0 { product / square } else { 0.0 }
    }
}

impl HeightProfile {
    /// Returns the weight of a residual in N: Student's distribution.
    fn weight(&self, residual_n: f64) -> f64 {
        let ratio = residual_n / self.residual_n;
        (TAIL + 1.0) / (TAIL + ratio * ratio) / self.residual_n.powi(2)
    }

    /// Recorded less modelled force in N, the mass in kg, and the force in N for each kg.
    fn residual(
        &self,
        observation: &BlockDifference,
        gradient: &[(usize, f64)],
        prior: &Prior,
    ) -> (f64, f64, f64) {
        let climb: f64 = gradient.iter().map(|&(node, value)| value * self.heights_m[node]).sum();
        let unit = prior.unit_force(observation, &self.common) + GRAVITY_MPS2 * climb;
        let pass = self.pass_mass[observation.pass as usize];
        let mass_kg = prior.mass_kg(observation, &self.common) + observation.mass_kg * pass;
        let force_n = observation.force_n + self.common.delay_s() * observation.force_change_n;
        (force_n - mass_kg * unit, mass_kg, unit)
    }

    /// Returns the gradient along a block.
    pub fn gradient_permille(&self, block: usize) -> Vec<GradientEntry> {
        let (first, count) = self.layout.blocks[block];
        (0..count - 1)
            .map(|node| {
                let rise = self.heights_m[first + node + 1] - self.heights_m[first + node];
                let variance = self.gradient_var.get(block).map_or(f64::NAN, |list| list[node]);
                GradientEntry {
                    from_m: self.layout.start_m + node as f64 * HEIGHT_STEP_M,
                    gradient_permille: 1000.0 * rise / HEIGHT_STEP_M,
                    std_permille: 1000.0 * variance.sqrt(),
                }
            })
            .collect()
    }
}
