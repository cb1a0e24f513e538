//! The pipeline `residual_monitor`: the force that the model does not explain, and its likely causes.
//!
//! Momentum blocks make a linear regression in a, b, c and the errors of the forces, as in
//! [`crate::pipeline::momentum`]. Each suspect adds one column: the momentum that one unit of it would take away. All
//! columns go through one whitener and into one information matrix, from which the likelihood ratio of every suspect
//! against the base model follows at any time, with a, b and c refitted together with the suspect. The distance by
//! position against the distance by speed adds the wheels' diameter.
//!
//! # Layout, in the order a sample takes
//!
//! - `covariates`, `wheel_scale`: evidence that a sample gives on each suspect
//! - `rows`: blocks to independent rows of unit variance
//! - `information`: the uncertainty of every parameter, and the likelihood ratios
//! - `verdict`: the evidence for each suspect
//! - `naming`: the suspect, its alternatives, and the end of the suspicion
//! - `estimator`: the pipeline around these parts
//!
//! # The effects that are looked for
//!
//! Figures that are never known exactly are among the base model's own parameters: the forces' scales and delay, the
//! load, the wind of the day, the curve constant, the extra resistance of cold bearings. An unusual value of one of
//! these is an effect. All other suspects have a column each in addition to the base model; positions show the wheels'
//! diameter, without any force.

mod covariates;
mod estimator;
mod information;
mod naming;
mod rows;
mod verdict;
mod wheel_scale;

pub use estimator::ResidualMonitor;

use dynocar_model::force::ResolvedSample;
use dynocar_model::terms::speed_band::BANDS;
use dynocar_model::terms::{
    SUSPECTS as TERMS, Suspect, USUAL, bearings, brake, curve, masses, traction,
};
use dynocar_shared::vocabulary::EffectKind;

use super::momentum::{DataSettings, FORCE_DELAY, TRACTION_SCALE, UNKNOWNS};
use crate::settings;

settings! {
    /// Settings of `residual_monitor`.
    #[derive(Copy)]
    MonitorSettings {
        /// Evidence, less the price of the search, from which a suspect is named.
        evidence_min: f64 = 20.0 => (1 to 1000000);
        /// Share of the resistance below which an unexplained force is no matter.
        share_min: f64 = 0.08 => (0 to 1);
        /// Standard deviation of each declared Davis coefficient, as a share of it.
        davis_std_share: f64 = 0.1 => (0.001 to 1);
        /// Small slow forces that are no effect: standard deviation in N/kN.
        disturbance_n_per_kn: f64 = 0.05 => (0.001 to 10 "N/kN");
        /// The same as a share of the resistance; both count.
        disturbance_share: f64 = 0.03 => (0 to 1);
        /// How long such a force lasts, in s.
        disturbance_time_s: f64 = 60.0 => (1 to 10000 "s");
        /// Standard deviation in % of the scales of traction and brake force; it stands in the place of
        /// `data.force_scale_std`.
        force_std_percent: f64 = 0.6 => (0.0001 to 50 "%");
        /// Standard deviation in % of the mass that samples or the train's file give, from run to run and
        /// at every stop where another is given.
        mass_std_percent: f64 = 100.0 * masses::WEIGHED_STD => (0.01 to 50 "%");
        /// Standard deviation in m/s of the wind from run to run; gusts have half of it.
        wind_std_mps: f64 = 1.5 => (0.01 to 20 "m/s");
        /// Standard deviation in permille of the map's gradient, smooth over some hundred metres.
        map_std_permille: f64 = 0.03 => (0 to 10 "permille");
        /// Standard deviation of the declared curve constant, as a share of it.
        curve_constant_std: f64 = curve::USUAL_STD => (0.001 to 1);
        /// Standard deviation of the resistance that bearings add at the start of a run before they are warm, as a
        /// share of the basic resistance.
        warming_std: f64 = bearings::USUAL_STD => (0.0001 to 1);
        /// Standard deviation of the wheels' diameter, as a share of it.
        wheel_std: f64 = 0.0015 => (0.0001 to 0.1);
        /// Standard deviation by which the scales of traction and brake force differ from run to run.
        force_run_std: f64 = 0.003 => (0.000001 to 0.5);
        /// Time of motion in h over which evidence is forgotten.
        memory_h: f64 = 4.0 => (0.1 to 10000 "h");
        /// How samples become regression data; the source is always momentum.
        data: DataSettings = DataSettings::default() => (each);
    }
}

/// Columns of the base model: a, b, c, two force scales, the delay, and the other figures that are never exact.
const BASE: usize = UNKNOWNS + USUAL.len();
/// Index of the load of a run: the true over the given mass less 1.
const LOAD: usize = UNKNOWNS;
/// Index of the headwind of a run in m/s.
const DAY_WIND: usize = UNKNOWNS + 1;
/// Index of the error of the curve constant, in 1000 N/kN m.
const CURVE: usize = UNKNOWNS + 2;
/// Index of the resistance that cold bearings add at the start of a run, as a share of a.
const WARMING: usize = UNKNOWNS + 3;
/// Parameters that are suspects only where their value is unusual; the delay is judged by itself.
const UNUSUAL: [usize; 5] = [TRACTION_SCALE, LOAD, DAY_WIND, CURVE, WARMING];
/// Suspects with a column of their own in addition to the base model.
const SUSPECTS: usize = TERMS.len() + BANDS.len();
/// The suspects: terms, and forces in bands of the speed, which follow no term.
const BANK: [Suspect; SUSPECTS] = {
    let mut bank = [BANDS[0]; SUSPECTS];
    let mut index = 0;
    while index < SUSPECTS {
        bank[index] = if index < TERMS.len() { TERMS[index] } else { BANDS[index - TERMS.len()] };
        index += 1;
    }
    bank
};
/// Columns that come from samples: the base model's parameters beyond the unknowns of the regression, and the suspects.
const COVARIATES: usize = USUAL.len() + SUSPECTS;
/// Index of the first band of speed among the parameters.
const FIRST_BAND: usize = BASE + TERMS.len();
/// Onsets of a dragging brake that are kept side by side.
const ONSETS: usize = 12;
/// Index of the first onset among the parameters.
const FIRST_ONSET: usize = BASE + SUSPECTS;
/// All parameters of the regression.
const PARAMETERS: usize = FIRST_ONSET + ONSETS;
/// Candidate without a column: wheels of another diameter.
const WHEEL: usize = PARAMETERS;
/// All parameters, and the wheels.
const CANDIDATES: usize = PARAMETERS + 1;
/// Candidates among them.
const SEARCHED: usize = UNUSUAL.len() + 1 + CANDIDATES - BASE;

/// Returns the suspect behind a column from samples.
fn covariate(index: usize) -> &'static Suspect {
    if index < USUAL.len() { &USUAL[index] } else { &BANK[index - USUAL.len()] }
}

/// Returns the suspect behind a parameter; a, b, c and the brake's scale are not suspects, and stand for the
/// traction's.
fn suspect_of(parameter: usize) -> &'static Suspect {
    match parameter {
        FIRST_ONSET.. => &brake::SUSPECT,
        UNKNOWNS.. => covariate(parameter - UNKNOWNS),
        _ => &traction::SUSPECT,
    }
}

/// Returns the effect behind a candidate.
fn effect_of(candidate: usize) -> EffectKind {
    match candidate {
        FORCE_DELAY => EffectKind::ActuatorDelay,
        WHEEL => EffectKind::WheelDiameter,
        parameter => suspect_of(parameter).effect,
    }
}

/// Blocks between new onsets.
const SPACING: u32 = 3;

/// Ages of the onsets in blocks; `None` for a free place.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Onsets {
    ages: [Option<u32>; ONSETS],
    since_newest: u32,
}

impl Onsets {
    /// No onset yet; the next block opens one.
    pub fn new() -> Self {
        Onsets { ages: [None; ONSETS], since_newest: SPACING }
    }

    /// Returns the age of an onset in blocks.
    pub fn age(&self, index: usize) -> Option<u32> {
        self.ages[index]
    }

    /// The train starts from a stop: the next block opens an onset, which brakes may have dragged
    /// since.
    pub fn start_leg(&mut self) {
        self.since_newest = SPACING;
    }

    /// One block later.
    pub fn advance(&mut self) {
        self.since_newest += 1;
        for age in self.ages.iter_mut().flatten() {
            *age = age.saturating_add(1);
        }
    }

    /// When it is time for a new onset, the place that it takes; that place may have held
    /// another, and `keep` never goes.
    pub fn open(&mut self, keep: Option<usize>) -> Option<usize> {
        if self.since_newest < SPACING {
            return None;
        }
        self.since_newest = 0;
        let free = self.ages.iter().position(Option::is_none);
        let index = free.unwrap_or_else(|| self.most_redundant(keep));
        self.ages[index] = Some(0);
        Some(index)
    }

    /// Returns the onset between the two neighbours that lie closest together by the ratio of ages.
    fn most_redundant(&self, keep: Option<usize>) -> usize {
        let ratio = |index: usize| {
            let age = self.ages[index].unwrap_or(0);
            let all = || self.ages.iter().flatten().copied();
            let younger = all().filter(|&other| other < age).max()?;
            let older = all().filter(|&other| other > age).min()?;
            Some(f64::from(younger + SPACING) / f64::from(older + SPACING))
        };
        let mut best = (f64::NEG_INFINITY, 0);
        for index in (0..ONSETS).filter(|&index| Some(index) != keep) {
            if let Some(ratio) = ratio(index)
                && ratio > best.0
            {
                best = (ratio, index);
            }
        }
        best.1
    }
}

/// After the brake force is gone, the cylinders get this time in s to empty.
const RELEASE_S: f64 = 6.0;
/// The pressure is averaged over this time in s.
const SMOOTHING_S: f64 = 10.0;
/// A lasting pressure below this in Pa is nothing.
const STEP_MIN_PA: f64 = 2500.0;

/// Watches the pressure of released brakes.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ReleasedPressure {
    released_s: f64,
    seen_s: f64,
    mean_pa: f64,
    lowest_pa: f64,
}

impl ReleasedPressure {
    /// Before the first sample.
    pub fn new() -> Self {
        ReleasedPressure { released_s: 0.0, seen_s: 0.0, mean_pa: 0.0, lowest_pa: f64::INFINITY }
    }

    /// A new run: the brakes have been released, the lowest pressure ever stays known.
    pub fn restart(&mut self) {
        *self = ReleasedPressure { lowest_pa: self.lowest_pa, ..ReleasedPressure::new() };
    }

    /// Takes in a sample.
    pub fn push(&mut self, sample: &ResolvedSample) {
        let (Some(pressure), Some(brake)) =
            (sample.brake_cylinder_pressure_pa, sample.brake_force_n)
        else {
            return;
        };
        // N per kN of weight: a thousandth of the weight is no brake.
        if brake > sample.weight_kn {
            self.released_s = 0.0;
            return;
        }
        self.released_s += sample.step_s;
        if self.released_s < RELEASE_S {
            return;
        }
        self.seen_s = (self.seen_s + sample.step_s).min(SMOOTHING_S);
        let share = if self.seen_s > 0.0 { sample.step_s / self.seen_s } else { 1.0 };
        self.mean_pa += (pressure - self.mean_pa) * share;
        if self.seen_s >= SMOOTHING_S {
            self.lowest_pa = self.lowest_pa.min(self.mean_pa);
        }
    }

    /// Returns whether the released brakes hold clearly more pressure than they once did.
    pub fn is_raised(&self) -> bool {
        self.seen_s >= SMOOTHING_S && self.mean_pa > self.lowest_pa + STEP_MIN_PA
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn old_onsets_thin_out_and_the_first_and_a_kept_one_stay() {
        let mut onsets = Onsets::new();
        let mut kept = None;
        for block in 0..300 {
            let opened = onsets.open(kept);
            if block == 90 {
                kept = opened;
            }
            onsets.advance();
        }
        let mut ages: Vec<u32> = (0..ONSETS).filter_map(|index| onsets.age(index)).collect();
        ages.sort_unstable();
        assert_eq!(ages.len(), ONSETS);
        assert_eq!(*ages.last().unwrap(), 300);
        assert_eq!(onsets.age(kept.unwrap()), Some(210));
        assert!(ages[3] <= 12, "dense lately: {ages:?}");
        assert!(ages[6] <= 90, "sparse long ago: {ages:?}");
    }
}
