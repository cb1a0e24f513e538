//! Naming a suspected effect and its alternatives, and ending the suspicion.

use dynocar_shared::vocabulary::EffectKind;

use super::{CANDIDATES, FIRST_ONSET, Onsets, PARAMETERS, effect_of};
use crate::pipeline::InnovationMonitor;
use crate::pipeline::momentum::FORCE_DELAY;

/// A named suspect stays until its evidence is below this share of the evidence that named it.
const STAYS_SHARE: f64 = 0.5;
/// Another suspect takes over when its evidence is greater by this; below it, both are reported as alternatives.
const TAKES_OVER_BY: f64 = 5.0;
/// Number of successive blocks for which evidence must last.
const LASTING_BLOCKS: u32 = 2;
/// Twice the log-likelihood ratio of no effect against the effect as found, over the rows since the effect was last
/// present, from which its cause has ended.
const ENDED: f64 = 16.0;
/// Number of suspected brakes that were released while the train drove, from which another is doubted.
const LET_GO_MAX: f64 = 1.5;
/// Share of that number that is remembered from block to block: four hours.
const LET_GO_KEPT: f64 = 1.0 - 1.0 / 2880.0;
/// Kinds that look like a dragging brake at a location that was never passed before.
const PLACES: u32 = EffectKind::LocalResistance.bit()
    | EffectKind::GradientError.bit()
    | EffectKind::GradientShift.bit();
/// Blocks that a constant force must have lasted until other laws of the force are excluded.
const CONSTANT_BLOCKS: u32 = 60;
/// Innovations before their statistics are judged.
const INNOVATIONS_MIN: f64 = 40.0;
/// Mean square of the innovations up to which small things that are no effect are believed.
const MEAN_SQUARE_MAX: f64 = 3.0;

/// A named suspect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Named {
    /// The effect.
    pub effect: EffectKind,
    /// Its candidate; `None` for an unknown effect.
    candidate: Option<usize>,
    /// Evidence less the price of the search.
    pub evidence: f64,
    /// Bits of the effects that are hardly distinguishable from it.
    pub alternatives: u32,
}

impl Named {
    /// Returns its parameter of the regression, if it is a force.
    pub fn parameter(&self) -> Option<usize> {
        self.candidate.filter(|&candidate| candidate < PARAMETERS && candidate != FORCE_DELAY)
    }
}

/// Evidence for the candidates after a block.
#[derive(Clone, Copy, Debug)]
pub struct CandidateEvidence<'a> {
    /// Evidence for each being there now.
    pub net: &'a [f64; CANDIDATES],
    /// Evidence for each by all that was seen, by which they are compared.
    pub rank: &'a [f64; CANDIDATES],
    /// Evidence for a law of the speed given the effect that is named.
    pub left_by_name: f64,
    /// Statistics of the innovations without outliers.
    pub cut_innovations: &'a InnovationMonitor,
    /// Since when brakes may drag.
    pub onsets: &'a Onsets,
    /// True where no earlier pass shows the effect of the location.
    pub is_new_place: bool,
    /// True while released brakes hold pressure.
    pub is_pressure_raised: bool,
}

/// Who is suspected.
#[derive(Clone, Debug, PartialEq)]
pub struct Naming {
    evidence_min: f64,
    named: Option<Named>,
    /// Who leads, and for how many blocks.
    leading: (Option<usize>, u32),
    /// Evidence that the cause of the named effect has ended.
    ending: f64,
    /// Brakes lately that were suspected and let go while the train drove.
    let_go: f64,
}

impl Naming {
    /// Nobody yet.
    pub fn new(evidence_min: f64) -> Self {
        Naming { evidence_min, named: None, leading: (None, 0), ending: 0.0, let_go: 0.0 }
    }

    /// Returns the suspect, if any.
    pub fn named(&self) -> Option<&Named> {
        self.named.as_ref()
    }

    /// Returns the parameter of the suspect, if any.
    pub fn parameter(&self) -> Option<usize> {
        self.named.and_then(|named| named.parameter())
    }

    /// Returns the onset that is named as that of a dragging brake.
    pub fn onset(&self) -> Option<usize> {
        self.parameter()?.checked_sub(FIRST_ONSET)
    }

    /// Returns whether a parameter is named, and no other that is known could be meant: its rows should
    /// be integrated out, and not taken as without it.
    pub fn is_clearly(&self, parameter: usize) -> bool {
        let is_clear = |it: Named| it.alternatives & !EffectKind::Unknown.bit() == 0;
        self.named.is_some_and(|it| it.parameter() == Some(parameter) && is_clear(it))
    }

    /// Returns whether something is named that is no place and cannot be one.
    pub fn is_no_place(&self) -> bool {
        use EffectKind::{DraggingBrake, GradientError, LocalResistance, Unknown};
        self.named.is_some_and(|named| match named.effect {
            LocalResistance | GradientError | Unknown => false,
            DraggingBrake => named.alternatives & LocalResistance.bit() == 0,
            _ => true,
        })
    }

    /// A parameter stands for something else now.
    pub fn clear(&mut self, parameter: usize) {
        if self.parameter() == Some(parameter) {
            self.named = None;
            self.ending = 0.0;
        }
        if self.leading.0 == Some(parameter) {
            self.leading = (None, 0);
        }
    }

    /// Adds the evidence of a row for no effect against the effect as found (CUSUM); true when its cause has ended.
    pub fn has_ended(&mut self, gone: f64) -> bool {
        self.ending = (self.ending + gone).max(0.0);
        let has_ended = self.ending > ENDED;
        if has_ended && self.onset().is_some() {
            self.let_go += 1.0;
        }
        has_ended
    }

    /// Takes in the evidence for the candidates after a block.
    pub fn take(&mut self, standing: &CandidateEvidence) {
        let CandidateEvidence { net, rank, .. } = *standing;
        self.let_go *= LET_GO_KEPT;
        let least = STAYS_SHARE * self.evidence_min;
        let leading = (0..CANDIDATES)
            .filter(|&candidate| net[candidate] > self.evidence_min)
            .max_by(|&one, &other| rank[one].total_cmp(&rank[other]));
        let is_same =
            |one: Option<usize>, other: Option<usize>| one.map(effect_of) == other.map(effect_of);
        let lasted = if is_same(leading, self.leading.0) { self.leading.1 + 1 } else { 1 };
        self.leading = (leading, lasted);
        let before = self.named.and_then(|named| named.candidate);
        let stays = before.filter(|&candidate| net[candidate] > least);
        let takes_over = leading.filter(|&candidate| {
            let is_ahead = stays.is_none_or(|old| rank[candidate] > rank[old] + TAKES_OVER_BY);
            is_same(leading, before) || (lasted >= LASTING_BLOCKS && is_ahead)
        });
        let chosen = takes_over.or(stays);
        if !is_same(chosen, before) {
            self.ending = 0.0;
        }
        self.named = match chosen {
            Some(candidate) => Some(self.named_from(candidate, least, standing)),
            None => self.unknown(standing),
        };
    }

    /// Returns a candidate as it is reported.
    fn named_from(&self, candidate: usize, least: f64, standing: &CandidateEvidence) -> Named {
        let effect = effect_of(candidate);
        let mut bits = alternatives(candidate, least, standing);
        let is_a_brake = effect == EffectKind::DraggingBrake && !standing.is_pressure_raised;
        // An unknown place explains everything that a brake explains.
        let is_as_a_brake = is_a_brake || bits & EffectKind::DraggingBrake.bit() != 0;
        if is_as_a_brake && standing.is_new_place {
            bits |= PLACES;
        }
        // A force by another law is constant for a while, too; and where large innovations remain, there is more than
        // this effect.
        let onset = candidate.checked_sub(FIRST_ONSET).filter(|_| is_a_brake);
        let age = onset.and_then(|index| standing.onsets.age(index));
        let is_short = age.is_some_and(|age| age < CONSTANT_BLOCKS);
        let is_more = standing.left_by_name > self.evidence_min;
        if is_short || is_more || self.unexplained(standing).is_some() {
            bits |= EffectKind::Unknown.bit();
        }
        // Brakes that let go again and again while the train drives are something else.
        let is_in_doubt = is_a_brake && self.let_go >= LET_GO_MAX;
        let evidence = standing.net[candidate];
        let candidate = Some(candidate);
        match is_in_doubt {
            true => Named {
                effect: EffectKind::Unknown,
                candidate,
                evidence,
                alternatives: (bits & !EffectKind::Unknown.bit()) | effect.bit() | PLACES,
            },
            false => Named { effect, candidate, evidence, alternatives: bits & !effect.bit() },
        }
    }

    /// Returns the unknown effect where innovations are larger than small errors explain and no suspect is named;
    /// effects for which earlier segments gave evidence may be behind it, or a place that was never passed.
    fn unknown(&self, standing: &CandidateEvidence) -> Option<Named> {
        let evidence = self.unexplained(standing)?;
        let likely = bits_of(|candidate| standing.rank[candidate] > self.evidence_min);
        Some(Named {
            effect: EffectKind::Unknown,
            candidate: None,
            evidence,
            alternatives: likely | if standing.is_new_place { PLACES } else { 0 },
        })
    }

    /// Returns the evidence for a force that the model does not explain, if it is enough.
    fn unexplained(&self, standing: &CandidateEvidence) -> Option<f64> {
        let innovations = standing.cut_innovations;
        let count = innovations.effective_count();
        // Twice the log-likelihood ratio of normal innovations of that variance against 1, with the greatest credible
        // mean square as the unit.
        let excess = innovations.mean_square() / MEAN_SQUARE_MAX;
        let evidence = count * (excess - 1.0 - excess.ln());
        let is_there = count > INNOVATIONS_MIN && excess > 1.0 && evidence > self.evidence_min;
        is_there.then_some(evidence)
    }
}

/// Returns the bits of the effects of those candidates that are so.
fn bits_of(is_so: impl Fn(usize) -> bool) -> u32 {
    let so = (0..CANDIDATES).filter(|&candidate| is_so(candidate));
    so.fold(0, |bits, candidate| bits | effect_of(candidate).bit())
}

/// Returns the effects that are hardly distinguishable from the chosen one: by their evidence, or by their kind.
fn alternatives(chosen: usize, least: f64, standing: &CandidateEvidence) -> u32 {
    let CandidateEvidence { net, rank, .. } = *standing;
    let effect = effect_of(chosen);
    // An error that is there in part in the base model may be certain, and yet not of this kind.
    let is_likely = |other: usize| net[other] > least || rank[other] > 0.0;
    let is_close = |other: usize| is_likely(other) && rank[other] > rank[chosen] - TAKES_OVER_BY;
    let bits = bits_of(is_close) & !effect.bit();
    // A profile that is moved is one that is wrong; `explain` distinguishes the two.
    let alike =
        if effect == EffectKind::GradientError { EffectKind::GradientShift.bit() } else { 0 };
    bits | alike
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::momentum::FORCE_DELAY as DELAY;
    use crate::pipeline::monitor::WHEEL;

    fn after(naming: &mut Naming, blocks: u32, evidence: &[(usize, f64)]) {
        after_with(naming, &Onsets::new(), blocks, evidence);
    }

    fn after_with(naming: &mut Naming, onsets: &Onsets, blocks: u32, evidence: &[(usize, f64)]) {
        let mut net = [0.0; CANDIDATES];
        for &(candidate, value) in evidence {
            net[candidate] = value;
        }
        let cut_innovations = InnovationMonitor::new(100);
        for _ in 0..blocks {
            naming.take(&CandidateEvidence {
                net: &net,
                rank: &net,
                left_by_name: 0.0,
                cut_innovations: &cut_innovations,
                onsets,
                is_new_place: false,
                is_pressure_raised: false,
            });
        }
    }

    #[test]
    fn evidence_must_last_and_a_close_rival_is_reported() {
        let mut naming = Naming::new(25.0);
        after(&mut naming, 1, &[(DELAY, 30.0)]);
        assert_eq!(naming.named(), None, "a block is no evidence that lasts");
        after(&mut naming, 1, &[(DELAY, 30.0), (WHEEL, 27.0)]);
        let named = naming.named().unwrap();
        assert_eq!(named.effect, EffectKind::ActuatorDelay);
        assert_eq!(named.alternatives, EffectKind::WheelDiameter.bit());
        after(&mut naming, 2, &[(DELAY, 30.0), (WHEEL, 60.0)]);
        let named = naming.named().unwrap();
        assert_eq!((named.effect, named.alternatives), (EffectKind::WheelDiameter, 0));
        after(&mut naming, 1, &[(WHEEL, 12.0)]);
        assert_eq!(naming.named(), None);
    }

    #[test]
    fn a_constant_force_is_reported_next_to_what_is_not_known_until_it_has_lasted() {
        let mut naming = Naming::new(25.0);
        let mut onsets = Onsets::new();
        onsets.open(None);
        let mut bits_after = |blocks: u32| {
            (0..blocks).for_each(|_| onsets.advance());
            after_with(&mut naming, &onsets, 2, &[(FIRST_ONSET, 40.0)]);
            naming.named().unwrap().alternatives
        };
        assert_eq!(bits_after(CONSTANT_BLOCKS - 1), EffectKind::Unknown.bit());
        assert_eq!(bits_after(1), 0);
    }

    #[test]
    fn rows_that_deny_the_effect_end_the_suspicion_however_long_it_stood() {
        let mut naming = Naming::new(25.0);
        for _ in 0..1000 {
            assert!(!naming.has_ended(-1.0));
        }
        let rows = (0..100).position(|_| naming.has_ended(1.5)).unwrap();
        assert!((8..=12).contains(&rows), "{rows}");
    }
}
