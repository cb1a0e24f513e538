//! From likelihood ratios to a suspect.

use dynocar_shared::vocabulary::EffectKind;

use super::information::{BaseSolution, Information};
use super::onsets::Onsets;
use super::rows::Parameters;
use super::settings::MonitorSettings;
use super::suspects::{BASE, FIRST_ONSET, ONSETS, PARAMETERS, SUSPECTS, suspect_of};
use crate::pipeline::InnovationMonitor;
use crate::terms::Least;

/// Blocks that a dragging brake must have dragged.
const ONSET_AGE_MIN: u32 = 5;
/// What a raised pressure of released brakes speaks for a dragging one.
const PRESSURE_EVIDENCE: f64 = 10.0;
/// A named suspect stays until its evidence is below this share of what named it.
const STAYS_SHARE: f64 = 0.5;
/// Another suspect takes over when its evidence is greater by this.
const TAKES_OVER_BY: f64 = 5.0;
/// Share of evidence that outlasts a stop, for effects that may change there.
const KEPT_AT_STOP: f64 = 0.7;
/// Rows for which unit variance counts beside the rows seen.
const PRIOR_ROWS: f64 = 20.0;
/// Blocks in a row for which evidence must last.
const LASTING_BLOCKS: u32 = 2;
/// Innovations before their statistics are judged.
const INNOVATIONS_MIN: f64 = 60.0;
/// Mean square of the innovations up to which small things that are no effect are believed.
const MEAN_SQUARE_MAX: f64 = 3.0;

/// A named suspect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Named {
    /// The effect.
    pub effect: EffectKind,
    /// Its parameter; `None` for an unknown effect.
    pub parameter: Option<usize>,
    /// Evidence less what the search costs.
    pub evidence: f64,
}

/// What the verdict is formed from.
#[derive(Clone, Copy, Debug)]
pub struct Evidence<'a> {
    /// All rows.
    pub information: &'a Information,
    /// The base model solved.
    pub base: &'a BaseSolution,
    /// Since when a brake may drag.
    pub onsets: &'a Onsets,
    /// True while released brakes hold pressure.
    pub is_pressure_raised: bool,
    /// Innovation statistics of the model as it is believed.
    pub innovations: &'a InnovationMonitor,
}

/// Judges the suspects, block by block.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    evidence_min: f64,
    share_min: f64,
    kept_per_row: f64,
    /// Force of one unit of each parameter where it acts, and the resistance there, summed.
    unit_force: Parameters,
    resistance: Parameters,
    /// Evidence that outlasted stops.
    held: [f64; SUSPECTS],
    net: [f64; PARAMETERS],
    named: Option<Named>,
    candidate: (Option<usize>, u32),
    scale: f64,
}

impl Verdict {
    /// No suspicion.
    pub fn new(settings: &MonitorSettings, kept_per_row: f64) -> Self {
        Verdict {
            evidence_min: settings.evidence_min,
            share_min: settings.share_min,
            kept_per_row,
            unit_force: Parameters::zeros(),
            resistance: Parameters::zeros(),
            held: [0.0; SUSPECTS],
            net: [0.0; PARAMETERS],
            named: None,
            candidate: (None, 0),
            scale: 1.0,
        }
    }

    /// The suspect, if any.
    pub fn named(&self) -> Option<&Named> {
        self.named.as_ref()
    }

    /// The onset that is named as that of a dragging brake.
    pub fn named_onset(&self) -> Option<usize> {
        self.named.and_then(|named| named.parameter)?.checked_sub(FIRST_ONSET)
    }

    /// Variance of the rows, at least 1.
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// True when a parameter's rows should be integrated out, and not taken as without it.
    pub fn is_suspicious(&self, parameter: usize) -> bool {
        self.net[parameter] > STAYS_SHARE * self.evidence_min
    }

    /// Notes how strongly one unit of each parameter acted in a block, beside the resistance in
    /// the same unit.
    pub fn note_forces(&mut self, units: &Parameters, resistance: f64) {
        self.unit_force *= self.kept_per_row;
        self.resistance *= self.kept_per_row;
        for parameter in BASE..PARAMETERS {
            let unit = units[parameter].abs();
            if unit > 1e-3 * resistance {
                self.unit_force[parameter] += unit;
                self.resistance[parameter] += resistance;
            }
        }
    }

    /// A stop: what may change there loses some of its evidence.
    pub fn hold_over_stop(&mut self, parameter: usize) {
        let own = self.net[parameter].max(0.0);
        self.held[parameter - BASE] = KEPT_AT_STOP * own;
    }

    /// A parameter's place is taken by another.
    pub fn clear(&mut self, parameter: usize) {
        self.unit_force[parameter] = 0.0;
        self.resistance[parameter] = 0.0;
        self.net[parameter] = 0.0;
        if self.named.is_some_and(|named| named.parameter == Some(parameter)) {
            self.named = None;
        }
    }

    /// Judges the rows so far.
    ///
    /// # Real-time
    ///
    /// One small triangular solution for each suspect, no allocation.
    pub fn judge(&mut self, evidence: &Evidence) {
        let mut ratios = [0.0; PARAMETERS];
        let mut costs = [0.0; PARAMETERS];
        for parameter in BASE..PARAMETERS {
            let suspect = suspect_of(parameter);
            let onset = parameter.checked_sub(FIRST_ONSET);
            let is_too_young = onset.is_some_and(|place| {
                evidence.onsets.age(place).is_none_or(|age| age < ONSET_AGE_MIN)
            });
            if is_too_young {
                continue;
            }
            let found =
                evidence.information.alternative(evidence.base, parameter, suspect.prior_std);
            let is_possible = found.value > 0.0 || !suspect.is_positive;
            if is_possible && self.is_material(parameter, found.value) {
                (ratios[parameter], costs[parameter]) = (found.ratio, found.cost);
            }
        }
        let best = ratios.iter().copied().fold(0.0, f64::max);
        self.scale = evidence.information.mean_square(evidence.base, best, PRIOR_ROWS).max(1.0);
        // Evidence is the greatest of as many ratios as suspects and onsets are searched.
        let searched = 2.0 * ((SUSPECTS + ONSETS) as f64).ln();
        for parameter in BASE..PARAMETERS {
            let hint = match parameter >= FIRST_ONSET && ratios[parameter] > 0.0 {
                true if evidence.is_pressure_raised => PRESSURE_EVIDENCE,
                _ => 0.0,
            };
            let own = ratios[parameter] / self.scale + hint - costs[parameter] - searched;
            let held = self.held.get(parameter - BASE).copied().unwrap_or(0.0);
            self.net[parameter] = own.max(held);
        }
        self.name(evidence);
    }

    fn is_material(&self, parameter: usize, value: f64) -> bool {
        match suspect_of(parameter).least {
            Least::Size(least) => value.abs() >= least,
            Least::Share(times) => {
                let least = times * self.share_min * self.resistance[parameter];
                value.abs() * self.unit_force[parameter] >= least.max(f64::MIN_POSITIVE)
            }
        }
    }

    fn name(&mut self, evidence: &Evidence) {
        let leading = (BASE..PARAMETERS)
            .max_by(|&one, &other| self.net[one].total_cmp(&self.net[other]))
            .filter(|&parameter| self.net[parameter] > self.evidence_min);
        let is_same = |one: Option<usize>, other: Option<usize>| {
            one.map(|it| suspect_of(it).effect) == other.map(|it| suspect_of(it).effect)
        };
        let lasted = if is_same(leading, self.candidate.0) { self.candidate.1 + 1 } else { 1 };
        self.candidate = (leading, lasted);
        let before = self.named.and_then(|named| named.parameter);
        let stays =
            before.filter(|&parameter| self.net[parameter] > STAYS_SHARE * self.evidence_min);
        let takes_over = leading.filter(|&parameter| {
            let is_ahead =
                stays.is_none_or(|old| self.net[parameter] > self.net[old] + TAKES_OVER_BY);
            is_same(leading, before) || (lasted >= LASTING_BLOCKS && is_ahead)
        });
        self.named = takes_over.or(stays).map(|parameter| Named {
            effect: suspect_of(parameter).effect,
            parameter: Some(parameter),
            evidence: self.net[parameter],
        });
        if self.named.is_none() {
            self.named = self.unknown(evidence.innovations);
        }
    }

    /// Innovations larger than small things explain, and no suspect.
    fn unknown(&self, innovations: &InnovationMonitor) -> Option<Named> {
        let count = innovations.effective_count();
        let mean_square = innovations.mean_square();
        // Twice the log-likelihood ratio of normal innovations of that variance against 1,
        // in terms of what is believed at most.
        let excess = mean_square / MEAN_SQUARE_MAX;
        let evidence = count * (excess - 1.0 - excess.ln());
        (count > INNOVATIONS_MIN && excess > 1.0 && evidence > self.evidence_min).then_some(Named {
            effect: EffectKind::Unknown,
            parameter: None,
            evidence,
        })
    }
}
