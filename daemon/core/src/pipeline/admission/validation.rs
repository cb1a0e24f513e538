//! Validation of samples, with a reason for each refusal.
//!
//! A [`Validator`] sees every sample of one train in the order of arrival. It refuses samples that cannot be true and
//! counts those that never came; it never repairs a value. Where the train has plainly been moved or the clock set
//! (several samples in a row agree with each other but not with the past), it starts a new motion segment instead of
//! refusing for ever.

use dynocar_model::force::ValidSample;
use dynocar_shared::resistance::GRAVITY_MPS2;
use dynocar_shared::{RejectionReason, SampleField, TrainId, TrainSample};

use super::limits::{
    ACCELERATION_MAX_MPS2, COPIES, FORCE, MASS, POSITION_STEP, REPEATED, SPEED, SPEED_STEP,
    TIME_STEP,
};

/// After this many refusals in a row that agree with each other, the past is given up.
const REFUSALS_BEFORE_RESTART: u32 = 5;
/// Distance in m beyond a line's ends, and half of the train, up to which a position is an odometer's error.
const OFF_LINE_M: f64 = 200.0;

/// The newest gap in the sequence numbers, which may turn out not to be a gap.
#[derive(Clone, Copy, Debug)]
struct Gap {
    /// The last number before the gap.
    before: u64,
    /// Samples lost before the gap.
    lost_before: u64,
    /// The newest number among the refused samples that continue the numbers before the gap.
    newest: u64,
    /// Number of such samples in a row.
    refused: u32,
}

/// Checks the samples of one train, in order.
#[derive(Clone, Debug, Default)]
pub struct Validator {
    train: u64,
    nominal_mass_kg: f64,
    /// Least and greatest position in m on the line; `None` where its length is not known.
    on_line_m: Option<(f64, f64)>,
    last: Option<TrainSample>,
    /// The run of the newest sample.
    run: Option<u32>,
    /// The number up to which samples are accounted for.
    counted: u64,
    gap: Option<Gap>,
    last_refused: Option<TrainSample>,
    refusals_in_a_row: u32,
    /// Copies of the newest sample in a row.
    copies: u32,
    segment: u32,
    lost: u64,
}

impl Validator {
    /// Returns a validator for one train of a nominal mass in kg.
    pub fn new(train: TrainId, nominal_mass_kg: f64) -> Self {
        Validator { train: train.0, nominal_mass_kg, ..Validator::default() }
    }

    /// Refuses positions of a train of this length in m off a line of this length in m.
    pub fn keep_on_line(&mut self, line_m: f64, train_m: f64) {
        let beyond_m = OFF_LINE_M + 0.5 * train_m;
        self.on_line_m = Some((-beyond_m, line_m + beyond_m));
    }

    /// Returns the samples that never arrived so far.
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// Counts from the sample after this number; to be called before the first sample. Without it
    /// the count begins with the sample of number 1.
    pub fn count_from(&mut self, sequence: u64) {
        self.counted = sequence;
    }

    /// Changes places with the validator of another model of the same train: each goes on counting
    /// where the other stopped, by its own limits, and begins a new motion segment.
    pub fn exchange(&mut self, other: &mut Validator) {
        std::mem::swap(self, other);
        std::mem::swap(&mut self.nominal_mass_kg, &mut other.nominal_mass_kg);
        std::mem::swap(&mut self.on_line_m, &mut other.on_line_m);
        let segment = self.segment.max(other.segment);
        for it in [self, other] {
            (it.segment, it.last) = (segment, None);
        }
    }

    /// No sample up to this number will come any more.
    pub fn count_up_to(&mut self, sequence: u64) {
        let missing = sequence.saturating_sub(self.counted);
        self.lost = self.lost.saturating_add(missing);
        self.counted = self.counted.max(sequence);
    }

    /// Passes a sample or says why not.
    ///
    /// # Errors
    ///
    /// The first reason that applies.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn check<'a>(
        &mut self,
        sample: &'a TrainSample,
    ) -> Result<ValidSample<'a>, RejectionReason> {
        if sample.train_id != self.train {
            return Err(RejectionReason::WrongTrain);
        }
        let counted = self.check_sequence(sample);
        if self.is_copy(sample) {
            return Err(RejectionReason::Repeated);
        }
        counted?;
        self.check_values(sample)?;
        match self.check_motion(sample) {
            Ok(step_s) => Ok(self.accept(sample, step_s)),
            Err(reason) => {
                if self.is_new_beginning(sample) {
                    return Ok(self.accept(sample, None));
                }
                Err(reason)
            }
        }
    }

    /// Counts the gap before a sample; a run that starts its count anew is a restart of a controller
    /// that knows nothing of the one before.
    ///
    /// A number that is wrong once makes all that follow look old: when several in a row go on
    /// counting from before the gap, the gap is taken back.
    fn check_sequence(&mut self, sample: &TrainSample) -> Result<(), RejectionReason> {
        let continues = self.run.is_none_or(|run| run == sample.run);
        let lost = match sample.sequence.checked_sub(self.counted) {
            Some(ahead @ 1..) => self.lost.saturating_add(ahead - 1),
            // The first sample came before the count was to begin: it begins with it.
            _ if self.run.is_none() => self.lost,
            _ if !continues => self.lost.saturating_add(sample.sequence.saturating_sub(1)),
            _ => {
                let gap = self.gap.ok_or(RejectionReason::SequenceNotIncreasing)?;
                let lost = self.lost_without(gap, sample);
                self.lost = lost.ok_or(RejectionReason::SequenceNotIncreasing)?;
                self.gap = None;
                (self.run, self.counted) = (Some(sample.run), sample.sequence);
                return Ok(());
            }
        };
        self.gap = (continues && lost > self.lost).then_some(Gap {
            before: self.counted,
            lost_before: self.lost,
            newest: self.counted,
            refused: 0,
        });
        self.lost = lost;
        (self.run, self.counted) = (Some(sample.run), sample.sequence);
        Ok(())
    }

    /// Returns the samples lost if the newest gap never was, once enough samples in a row say so.
    fn lost_without(&mut self, mut gap: Gap, sample: &TrainSample) -> Option<u64> {
        let goes_on = sample.sequence > gap.newest;
        gap.refused = if goes_on { gap.refused + 1 } else { 0 };
        gap.newest = gap.newest.max(sample.sequence);
        self.gap = Some(gap);
        // The sample with the wrong number arrived as well.
        let arrived = 1 + u64::from(gap.refused);
        (gap.refused > REFUSALS_BEFORE_RESTART)
            .then(|| gap.lost_before + (sample.sequence - gap.before).saturating_sub(arrived))
    }

    fn check_values(&self, sample: &TrainSample) -> Result<(), RejectionReason> {
        if sample.direction != 1 && sample.direction != -1 {
            return Err(RejectionReason::BadDirection);
        }
        let mut values = SampleField::ALL.into_iter().filter_map(|field| sample.get(field));
        if !values.all(f64::is_finite) {
            return Err(RejectionReason::NotFinite);
        }
        let speed_mps = sample.get(SampleField::Speed).ok_or(RejectionReason::Missing)?;
        if SPEED.is_passed(speed_mps, 1.0) {
            return Err(RejectionReason::SpeedOutOfRange);
        }
        let mass_kg = sample.get(SampleField::Mass).unwrap_or(self.nominal_mass_kg);
        if MASS.is_passed(mass_kg, self.nominal_mass_kg) {
            return Err(RejectionReason::MassOutOfRange);
        }
        let weight_n = mass_kg * GRAVITY_MPS2;
        let forces = [SampleField::TractionForce, SampleField::BrakeForce];
        let mut forces_n = forces.into_iter().filter_map(|field| sample.get(field));
        if forces_n.any(|force_n| FORCE.is_passed(force_n, weight_n)) {
            return Err(RejectionReason::ForceOutOfRange);
        }
        let mut known =
            SampleField::ALL.into_iter().filter_map(|it| Some((it.range(), sample.get(it)?)));
        if !known.all(|((low, high), value)| (low..=high).contains(&value)) {
            return Err(RejectionReason::OutOfRange);
        }
        match (self.on_line_m, sample.get(SampleField::Position)) {
            (Some((low_m, high_m)), Some(position_m))
                if !(low_m..=high_m).contains(&position_m) =>
            {
                Err(RejectionReason::PositionJump)
            }
            _ => Ok(()),
        }
    }

    /// Returns whether a sample is the one before it, sent once more: it adds nothing, and nothing in it is wrong.
    fn is_copy(&mut self, sample: &TrainSample) -> bool {
        let mut newest = [&self.last, &self.last_refused].into_iter().flatten();
        let is_copy = newest.any(|it| says_the_same(it, sample));
        self.copies = if is_copy { self.copies.saturating_add(1) } else { 0 };
        is_copy && !COPIES.is_passed(f64::from(self.copies), 1.0)
    }

    /// Returns the step in s since the last accepted sample, `None` when a new segment starts here.
    fn check_motion(&self, sample: &TrainSample) -> Result<Option<f64>, RejectionReason> {
        let Some(last) = &self.last else { return Ok(None) };
        if sample.run != last.run {
            return Ok(None);
        }
        if sample.time_ns <= last.time_ns {
            return Err(RejectionReason::TimeNotIncreasing);
        }
        let step_s = step_s(last, sample);
        if TIME_STEP.is_passed(step_s, 1.0) {
            return Err(RejectionReason::TimeJump);
        }
        if step_s > REPEATED.high || sample.direction != last.direction {
            return Ok(None);
        }
        self.check_continuity(last, sample, step_s)?;
        Ok(Some(step_s))
    }

    fn check_continuity(
        &self,
        last: &TrainSample,
        sample: &TrainSample,
        step_s: f64,
    ) -> Result<(), RejectionReason> {
        let speed_change = (sample.speed_mps - last.speed_mps).abs();
        if speed_change > SPEED_STEP.high + ACCELERATION_MAX_MPS2 * step_s {
            return Err(RejectionReason::SpeedJump);
        }
        if let (Some(from_m), Some(to_m)) =
            (last.get(SampleField::Position), sample.get(SampleField::Position))
        {
            let travelled_m = 0.5 * (last.speed_mps + sample.speed_mps) * step_s;
            let expected_m = from_m + f64::from(sample.direction) * travelled_m;
            if POSITION_STEP.is_passed(to_m - expected_m, 1.0) {
                return Err(RejectionReason::PositionJump);
            }
        }
        Ok(())
    }

    /// Returns whether enough refused samples in a row continue each other.
    fn is_new_beginning(&mut self, sample: &TrainSample) -> bool {
        let continues = self.last_refused.as_ref().is_some_and(|before| {
            let step_s = step_s(before, sample);
            step_s > 0.0
                && step_s <= REPEATED.high
                && sample.direction == before.direction
                && self.check_continuity(before, sample, step_s).is_ok()
        });
        self.refusals_in_a_row = if continues { self.refusals_in_a_row + 1 } else { 1 };
        self.last_refused = Some(*sample);
        self.refusals_in_a_row > REFUSALS_BEFORE_RESTART
    }

    fn accept<'a>(&mut self, sample: &'a TrainSample, step_s: Option<f64>) -> ValidSample<'a> {
        if step_s.is_none() {
            self.segment = self.segment.wrapping_add(1);
        }
        self.last = Some(*sample);
        self.last_refused = None;
        self.refusals_in_a_row = 0;
        ValidSample { sample, step_s: step_s.unwrap_or(0.0), segment: self.segment }
    }
}

/// Returns whether two samples have the same time and the same values.
fn says_the_same(one: &TrainSample, other: &TrainSample) -> bool {
    let head = |it: &TrainSample| (it.time_ns, it.run, it.direction, it.flags, it.valid);
    let mut fields = SampleField::ALL.into_iter();
    head(one) == head(other) && fields.all(|field| one.get(field) == other.get(field))
}

fn step_s(from: &TrainSample, to: &TrainSample) -> f64 {
    to.time_ns.saturating_sub(from.time_ns) as f64 * 1e-9
}

#[cfg(test)]
mod tests;
