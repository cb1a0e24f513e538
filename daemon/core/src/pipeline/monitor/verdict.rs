//! Evidence for each candidate.

use dynocar_model::terms::{Least, delay};

use super::information::{Alternative, BaseSolution, MonitorInformation};
use super::naming::{CandidateEvidence, Naming};
use super::rows::ParameterVector;
use super::{
    BASE, CANDIDATES, FIRST_BAND, FIRST_ONSET, MonitorSettings, Onsets, PARAMETERS, SEARCHED,
    SUSPECTS, UNUSUAL, WHEEL, suspect_of,
};
use crate::pipeline::InnovationMonitor;
use crate::pipeline::momentum::{FORCE_DELAY, UNKNOWNS};

/// Number of blocks that a suspect with a known beginning must have acted.
const AGE_MIN: u32 = 5;
/// Evidence for a dragging brake that the raised pressure of a released brake gives.
const PRESSURE_EVIDENCE: f64 = 10.0;
/// Share of the least size worth naming up to which an effect counts as none: surveys, maps and calibrations are never
/// exact, and a small lasting error gathers evidence without end.
const TOLERATED_SHARE: f64 = 0.25;
/// Standard deviations up to which the value of a figure that is never known exactly is usual.
const USUAL_STDS: f64 = 2.0;
/// Share of evidence that outlasts a stop, for effects that may change there.
const KEPT_AT_STOP: f64 = 0.7;
/// Share of that evidence that outlasts a block: an effect that is still there shows again within a minute.
const KEPT_PER_BLOCK: f64 = 0.9;
/// Number of rows that unit variance counts for against the rows seen.
const PRIOR_ROWS: f64 = 20.0;

/// Evidence from which the verdict is formed.
#[derive(Clone, Copy, Debug)]
pub struct ResidualEvidence<'a> {
    /// All rows.
    pub information: &'a MonitorInformation,
    /// The base model solved.
    pub base: &'a BaseSolution,
    /// Time since which a brake may drag.
    pub onsets: &'a Onsets,
    /// True while released brakes hold pressure.
    pub is_pressure_raised: bool,
    /// True where no earlier pass shows the effect of the location.
    pub is_new_place: bool,
    /// Evidence for an unusual error of the speed's scale.
    pub wheel: f64,
    /// Time in s between samples, which limits the accuracy of a delay.
    pub period_s: f64,
    /// Statistics of the innovations of the model as it is believed, cut off where outliers begin.
    pub cut_innovations: &'a InnovationMonitor,
}

/// Judges the candidates, block by block.
#[derive(Clone, Debug, PartialEq)]
pub struct MonitorVerdict {
    share_min: f64,
    kept_per_row: f64,
    /// Force of one unit of each parameter where it acts, and the resistance there, summed.
    unit_force: ParameterVector,
    resistance: ParameterVector,
    /// Evidence that outlasted stops.
    held: [f64; SUSPECTS],
    /// Evidence of the segments between earlier stops, for effects that have another value after each stop.
    gathered: [f64; SUSPECTS],
    /// Evidence of the rows in hand for each being there.
    own: [f64; CANDIDATES],
    /// The same against the base model, by which candidates are compared: a scale of the forces
    /// that the base model takes up in part is there all the same.
    given_base: [f64; CANDIDATES],
    /// Who is suspected.
    pub naming: Naming,
    /// Variance of the rows, at least 1.
    pub scale: f64,
    /// Blocks since the train started from a stop.
    leg_blocks: u32,
}

impl MonitorVerdict {
    /// No suspicion.
    pub fn new(settings: &MonitorSettings, kept_per_row: f64) -> Self {
        MonitorVerdict {
            share_min: settings.share_min,
            kept_per_row,
            unit_force: ParameterVector::zeros(),
            resistance: ParameterVector::zeros(),
            held: [0.0; SUSPECTS],
            gathered: [0.0; SUSPECTS],
            own: [0.0; CANDIDATES],
            given_base: [0.0; CANDIDATES],
            naming: Naming::new(settings.evidence_min),
            scale: 1.0,
            leg_blocks: 0,
        }
    }

    /// Notes how strongly one unit of each parameter acted in a block, jointly with the resistance in
    /// the same unit.
    pub fn note_forces(&mut self, units: &ParameterVector, resistance: f64) {
        self.unit_force *= self.kept_per_row;
        self.resistance *= self.kept_per_row;
        for parameter in UNKNOWNS..PARAMETERS {
            let unit = units[parameter].abs();
            if unit > 1e-3 * resistance {
                self.unit_force[parameter] += unit;
                self.resistance[parameter] += resistance;
            }
        }
    }

    /// The train starts from a stop.
    pub fn start_leg(&mut self) {
        self.leg_blocks = 0;
    }

    /// A stop: an effect that may change there loses some of the evidence for its presence now; in the comparison with
    /// other effects all of the evidence still counts.
    pub fn hold_over_stop(&mut self, parameter: usize) {
        let suspect = parameter - BASE;
        let own = self.own[parameter];
        self.held[suspect] = KEPT_AT_STOP * own.max(self.held[suspect]);
        self.gathered[suspect] = (self.gathered[suspect] + own + searched()).max(0.0);
        self.own[parameter] = 0.0;
    }

    /// Forgets a parameter: its place is taken by another, or its effect has ended.
    pub fn clear(&mut self, parameter: usize) {
        self.unit_force[parameter] = 0.0;
        self.resistance[parameter] = 0.0;
        self.own[parameter] = 0.0;
        if let Some(suspect) = parameter.checked_sub(BASE).filter(|&suspect| suspect < SUSPECTS) {
            (self.held[suspect], self.gathered[suspect]) = (0.0, 0.0);
        }
        self.naming.clear(parameter);
    }

    /// Takes in a row that the named suspect acts on: the squares of the rest of it with the
    /// suspect and without. True when its cause has ended.
    pub fn has_ended(&mut self, with: f64, without: f64) -> bool {
        self.naming.has_ended((with - without) / self.scale)
    }

    /// Judges the rows so far.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn judge(&mut self, evidence: &ResidualEvidence) {
        self.leg_blocks = self.leg_blocks.saturating_add(1);
        let mut found = [None; CANDIDATES];
        let mut best: f64 = 0.0;
        for parameter in BASE..PARAMETERS {
            // A change that began with the train's start is no likelier than one that began a little later.
            let is_old = self.age(parameter, evidence).is_some_and(|age| age >= AGE_MIN);
            let prior_std = suspect_of(parameter).prior_std;
            let alternative = evidence.base.alternative(parameter, prior_std);
            let least = self.least(parameter);
            if is_old && is_there(parameter, &alternative, least) {
                best = best.max(alternative.beyond(0.0));
                let ratio = alternative.beyond(TOLERATED_SHARE * least);
                found[parameter] = Some([(ratio, alternative.cost); 2]);
            }
        }
        for parameter in UNUSUAL {
            found[parameter] = self.unusual(parameter, evidence);
        }
        found[FORCE_DELAY] = Some([late(evidence); 2]);
        self.scale = evidence.information.mean_square(evidence.base, best, PRIOR_ROWS).max(1.0);
        for (candidate, found) in found.iter().enumerate().take(PARAMETERS) {
            let is_onset = candidate >= FIRST_ONSET;
            let net = |(ratio, cost): (f64, f64)| {
                let is_hinted = is_onset && ratio > 0.0 && evidence.is_pressure_raised;
                let hint = if is_hinted { PRESSURE_EVIDENCE } else { 0.0 };
                ratio / self.scale + hint - cost - searched()
            };
            let [own, given_base] = found.unwrap_or_default().map(net);
            (self.own[candidate], self.given_base[candidate]) = (own, given_base);
        }
        self.own[WHEEL] = evidence.wheel - searched();
        self.given_base[WHEEL] = self.own[WHEEL];
        self.name(evidence);
    }

    /// Returns the evidence that a parameter of the base model is unusual, and its cost: against any usual value,
    /// and as the best account of the rows.
    fn unusual(&self, parameter: usize, evidence: &ResidualEvidence) -> Option<[(f64, f64); 2]> {
        let usual_std = evidence.base.usual_std(parameter);
        let (it, given_base) = evidence.base.unusual(parameter, suspect_of(parameter).prior_std);
        let least = self.least(parameter);
        let usual = (TOLERATED_SHARE * least).max(USUAL_STDS * usual_std);
        let beyond = (it.beyond(usual), it.cost);
        let is_surer = beyond.0 - beyond.1 > given_base.0 - given_base.1;
        let own = if is_surer { beyond } else { given_base };
        is_there(parameter, &it, least).then_some([own, given_base])
    }

    /// Blocks for which a suspect could act; `None` for a brake that was not yet looked for.
    fn age(&self, parameter: usize, evidence: &ResidualEvidence) -> Option<u32> {
        match parameter.checked_sub(FIRST_ONSET) {
            Some(index) => evidence.onsets.age(index),
            None if suspect_of(parameter).changes_at_stops => Some(self.leg_blocks),
            None => Some(evidence.information.count as u32),
        }
    }

    /// Returns the evidence for a law of the speed given the named suspect.
    fn left_by_name(&self, evidence: &ResidualEvidence) -> f64 {
        let Some(named) = self.naming.parameter() else { return 0.0 };
        let bands = (FIRST_BAND..FIRST_ONSET).filter(|&band| band != named);
        let left = bands.map(|band| {
            let law = (band, suspect_of(band).prior_std);
            let found = match named {
                BASE.. => {
                    let named = (named, suspect_of(named).prior_std);
                    evidence.information.beyond_another(evidence.base, named, law)
                }
                _ => evidence.base.alternative(band, law.1),
            };
            let least = self.least(band);
            let is_large = found.value.abs() >= least;
            let ratio = if is_large { found.beyond(TOLERATED_SHARE * least) } else { 0.0 };
            ratio / self.scale - found.cost - searched()
        });
        left.fold(0.0, f64::max)
    }

    fn name(&mut self, evidence: &ResidualEvidence) {
        let mut net = self.own;
        let mut rank = self.given_base;
        for suspect in 0..SUSPECTS {
            self.held[suspect] *= KEPT_PER_BLOCK;
            self.gathered[suspect] *= self.kept_per_row;
            net[BASE + suspect] = net[BASE + suspect].max(self.held[suspect]);
            rank[BASE + suspect] =
                rank[BASE + suspect].max(self.held[suspect]) + self.gathered[suspect];
        }
        self.naming.take(&CandidateEvidence {
            net: &net,
            rank: &rank,
            left_by_name: self.left_by_name(evidence),
            cut_innovations: evidence.cut_innovations,
            onsets: evidence.onsets,
            is_new_place: evidence.is_new_place,
            is_pressure_raised: evidence.is_pressure_raised,
        });
    }

    /// Returns the least size of a parameter worth naming; infinite while it has not acted.
    fn least(&self, parameter: usize) -> f64 {
        match suspect_of(parameter).least {
            Least::Size(least) => least,
            Least::Share(_) if self.unit_force[parameter] == 0.0 => f64::INFINITY,
            Least::Share(times) => {
                times * self.share_min * self.resistance[parameter] / self.unit_force[parameter]
            }
        }
    }
}

/// Evidence is the greatest of as many ratios as there are candidates.
fn searched() -> f64 {
    2.0 * (SEARCHED as f64).ln()
}

/// Returns whether a parameter has a size that is worth naming, and a sign that makes sense.
fn is_there(parameter: usize, it: &Alternative, least: f64) -> bool {
    let is_possible = it.value > 0.0 || !suspect_of(parameter).is_positive;
    is_possible && it.value.abs() >= least
}

/// Returns the evidence for forces that act late, and its cost: the delay of the base model, beyond the error of a
/// logger that writes means over a step.
fn late(evidence: &ResidualEvidence) -> (f64, f64) {
    let (late_s, variance) = evidence.base.parameter(FORCE_DELAY);
    let beyond_s = late_s - delay::TOLERATED_S.max(evidence.period_s);
    let cost = (evidence.base.usual_std(FORCE_DELAY).powi(2) / variance).ln().max(0.0);
    if beyond_s >= delay::LEAST_S { (beyond_s * beyond_s / variance, cost) } else { (0.0, 0.0) }
}
