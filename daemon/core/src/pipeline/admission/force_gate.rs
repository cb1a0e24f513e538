//! Keeps lone forces, and samples that only repeat, out of the estimators.
//!
//! A force that is wrong by a plausible amount passes every check of a single sample. Time reveals the error: a train's
//! force, once it has left its level, stays away for a while, since actuators are slow; a failed reading comes back at
//! once. A sample whose force has left the level of the last sample taken is therefore held back until the next samples
//! agree with it, and dropped when they return to the old level. A true change loses no samples: the held ones are
//! released in order, unless the samples are so far apart that the wait was longer than the time that is bridged;
//! motion then begins anew. Where too many readings are lone, some of them agree by chance, and no sample is taken
//! until the forces are steady again.

use dynocar_model::force::ResolvedSample;
use dynocar_shared::RejectionReason;

use super::limits::{LONE_FORCE, LONE_MEMORY, LONE_SHARE, REPEATED};
use crate::pipeline::motion::MOVING_MPS;

/// Number of samples away from the old level that make a new one.
const AGREEING: usize = 3;
/// A change in N/kN that counts as no change: gradients change by as much within a sample.
const TOLERANCE_N_PER_KN: f64 = 1.0;
/// A change that counts as no change, as a share of the force: force sensors are accurate to a few %.
const TOLERANCE_SHARE: f64 = 0.08;
/// A change of speed in m/s that the noise of a speed sensor may cause.
const TOLERANCE_MPS: f64 = 0.5;
/// The greatest acceleration or deceleration of a train in m/s².
const ACCELERATION_MAX_MPS2: f64 = 2.0;
/// The quantile of the changes between samples that measures the noise of the forces. It is low, so
/// that neither ramps nor failures of half of all samples reach it.
const NOISE_QUANTILE: f64 = 0.2;
/// Least quantile in N/kN.
const CHANGE_MIN: f64 = TOLERANCE_N_PER_KN / LONE_FORCE.high;
/// Logarithmic step of the quantile at each sample.
const NOISE_STEP: f64 = 0.1;
/// Changes that a new gate waits for before it judges which changes are noise and which are failures.
const FIRST_CHANGES: usize = 20;
/// Place of the quantile among the bends of the first changes.
const FIRST_QUANTILE: usize = 4;

/// Verdict on a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GateVerdict {
    /// Take it as it is.
    Take,
    /// Nothing yet: later samples decide, or it adds nothing new.
    Wait,
    /// Take this many from [`ForceGate::released`], of which this one is the last.
    Release(usize),
    /// Leave it out, and begin anew with the next.
    Refuse(RejectionReason),
}

/// Force and content of a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Reading {
    segment: u32,
    speed_mps: f64,
    driving_n_per_kn: f64,
    content: [Option<f64>; 4],
}

impl Reading {
    /// `None` for a sample that no estimator steps to.
    fn from_sample(sample: &ResolvedSample) -> Option<Self> {
        let is_moving = sample.speed_mps > MOVING_MPS && !sample.is_sliding;
        let driving_n_per_kn = sample.driving_force_n()? / sample.weight_kn;
        (is_moving && driving_n_per_kn.is_finite()).then_some(Reading {
            segment: sample.segment,
            speed_mps: sample.speed_mps,
            driving_n_per_kn,
            content: [
                Some(sample.speed_mps),
                sample.position_m,
                sample.traction_force_n,
                sample.brake_force_n,
            ],
        })
    }

    /// Returns whether a moving train has sent the same once more, place and all.
    fn repeats(&self, last: &Reading) -> bool {
        self.content[1].is_some() && self.content == last.content
    }
}

/// Decides which samples an estimator steps to, and when.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ForceGate {
    /// The last sample taken.
    level: Option<Reading>,
    /// The newest sample that added something.
    newest: Option<Reading>,
    /// True once a sample has agreed with the level.
    is_confirmed: bool,
    held: [Option<ResolvedSample>; AGREEING],
    held_count: usize,
    /// True when the held samples lie above the level.
    is_above: bool,
    /// Time in s since the last sample that was taken or is held.
    skipped_s: f64,
    /// Quantile of the changes between samples in N/kN.
    change_n_per_kn: f64,
    /// The newest change, and the least bends of the first ones in N/kN, sorted, and how many there were.
    newest_change: f64,
    least_bends_n_per_kn: [f64; FIRST_QUANTILE],
    first_changes: usize,
    withdrawn_share: f64,
}

impl ForceGate {
    /// Judges the next sample.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn judge(&mut self, sample: &ResolvedSample) -> GateVerdict {
        let Some(now) = Reading::from_sample(sample) else {
            // The estimator reports the fault of such a sample.
            self.forget();
            return GateVerdict::Take;
        };
        let (Some(level), Some(newest)) = (self.level, self.newest) else {
            return self.begin(now);
        };
        if now.segment != level.segment || !(sample.step_s > 0.0) {
            return self.begin(now);
        }
        if now.repeats(&newest) {
            return self.pass_over(sample.step_s);
        }
        self.newest = Some(now);
        self.learn_noise(now.driving_n_per_kn - newest.driving_n_per_kn);
        self.compare(sample, &now, &level, &newest)
    }

    /// Returns the samples that [`GateVerdict::Release`] speaks of, the oldest first.
    pub fn released(&self, index: usize) -> Option<ResolvedSample> {
        self.held.get(index).copied().flatten()
    }

    /// Returns whether too many samples are withdrawn for any to be taken.
    pub fn is_in_doubt(&self) -> bool {
        self.first_changes == FIRST_CHANGES && self.withdrawn_share > LONE_SHARE.high
    }

    fn forget(&mut self) {
        self.level = None;
        self.newest = None;
        self.is_confirmed = false;
        self.held_count = 0;
        self.skipped_s = 0.0;
    }

    fn begin(&mut self, now: Reading) -> GateVerdict {
        self.forget();
        self.level = Some(now);
        self.newest = Some(now);
        self.unless_in_doubt(GateVerdict::Take)
    }

    /// Returns a sample that adds nothing new.
    fn pass_over(&mut self, step_s: f64) -> GateVerdict {
        self.skipped_s += step_s;
        if self.skipped_s <= REPEATED.high {
            return GateVerdict::Wait;
        }
        let newest = self.newest;
        self.forget();
        // The content stays known, so that further repetitions of it are refused as well.
        (self.level, self.newest) = (newest, newest);
        self.skipped_s = f64::INFINITY;
        GateVerdict::Refuse(RejectionReason::Repeated)
    }

    /// Judges a sample by the level and by the reading before it.
    fn compare(
        &mut self,
        sample: &ResolvedSample,
        now: &Reading,
        level: &Reading,
        before: &Reading,
    ) -> GateVerdict {
        let step_s = sample.step_s + self.skipped_s;
        let since_level_s = step_s + self.held_s();
        if since_level_s > REPEATED.high {
            let verdict = self.begin(*now);
            self.held[0] = Some(ResolvedSample { step_s: 0.0, ..*sample });
            return if verdict == GateVerdict::Take { GateVerdict::Release(1) } else { verdict };
        }
        let departure = self.departure(now, level, since_level_s);
        // A reading that failed comes back at once, a new level may drift towards the old one.
        let goes_on = self.held_count > 0
            && match departure {
                Some(is_above) => is_above == self.is_above,
                None => self.departure(now, before, step_s).is_none(),
            };
        if goes_on || (self.held_count == 0 && departure.is_some()) {
            let is_above = departure.unwrap_or(self.is_above);
            return self.hold(ResolvedSample { step_s, ..*sample }, now, is_above);
        }
        self.withdraw_held();
        let bridging = ResolvedSample { step_s: since_level_s, ..*sample };
        match departure {
            Some(is_above) => self.hold(bridging, now, is_above),
            None => self.take(bridging, sample.step_s, now),
        }
    }

    fn take(&mut self, sample: ResolvedSample, came_step_s: f64, now: &Reading) -> GateVerdict {
        self.level = Some(*now);
        self.is_confirmed = true;
        self.skipped_s = 0.0;
        self.withdrawn_share -= self.withdrawn_share / LONE_MEMORY;
        if sample.step_s == came_step_s {
            return self.unless_in_doubt(GateVerdict::Take);
        }
        self.held[0] = Some(sample);
        self.unless_in_doubt(GateVerdict::Release(1))
    }

    fn hold(&mut self, sample: ResolvedSample, now: &Reading, is_above: bool) -> GateVerdict {
        self.held[self.held_count] = Some(sample);
        self.held_count += 1;
        self.is_above = is_above;
        self.skipped_s = 0.0;
        if self.held_count < AGREEING {
            return GateVerdict::Wait;
        }
        self.held_count = 0;
        self.level = Some(*now);
        if !self.is_confirmed {
            // Nothing ever agreed with the first sample: the motion begins with these.
            self.held[0] = self.held[0].map(|first| ResolvedSample { step_s: 0.0, ..first });
        }
        self.is_confirmed = true;
        self.withdrawn_share *= (1.0 - 1.0 / LONE_MEMORY).powi(AGREEING as i32);
        self.unless_in_doubt(GateVerdict::Release(AGREEING))
    }

    fn withdraw_held(&mut self) {
        for _ in 0..self.held_count {
            self.withdrawn_share += (1.0 - self.withdrawn_share) / LONE_MEMORY;
        }
        self.held_count = 0;
    }

    fn unless_in_doubt(&self, verdict: GateVerdict) -> GateVerdict {
        if self.is_in_doubt() { GateVerdict::Refuse(RejectionReason::Outlier) } else { verdict }
    }

    /// Returns the time in s that the held samples have taken.
    fn held_s(&self) -> f64 {
        self.held[..self.held_count].iter().flatten().map(|sample| sample.step_s).sum()
    }

    /// Returns whether force or speed lies above the level or below it; `None` while near it.
    fn departure(&self, now: &Reading, level: &Reading, since_level_s: f64) -> Option<bool> {
        let faster_mps = now.speed_mps - level.speed_mps;
        if faster_mps.abs() > TOLERANCE_MPS + ACCELERATION_MAX_MPS2 * since_level_s {
            return Some(faster_mps > 0.0);
        }
        let more = now.driving_n_per_kn - level.driving_n_per_kn;
        let force = now.driving_n_per_kn.abs().max(level.driving_n_per_kn.abs());
        (more.abs() > self.tolerance_n_per_kn(force)).then_some(more > 0.0)
    }

    fn tolerance_n_per_kn(&self, force_n_per_kn: f64) -> f64 {
        TOLERANCE_N_PER_KN
            .max(TOLERANCE_SHARE * force_n_per_kn)
            .max(LONE_FORCE.high * self.change_n_per_kn)
    }

    /// Follows the quantile of the changes (Robbins, Monro 1951).
    fn learn_noise(&mut self, change: f64) {
        let last = std::mem::replace(&mut self.newest_change, change);
        if self.first_changes < FIRST_CHANGES {
            return self.begin_noise(change, last);
        }
        let is_above = change.abs() > self.change_n_per_kn;
        let step = if is_above { NOISE_QUANTILE } else { NOISE_QUANTILE - 1.0 };
        self.change_n_per_kn = (self.change_n_per_kn * (NOISE_STEP * step).exp()).max(CHANGE_MIN);
    }

    /// Begins at the quantile of the first bends, which neither ramps nor single failures raise: from exact forces on the
    /// quantile would climb for seconds, and noise would be called a fault until then.
    fn begin_noise(&mut self, change: f64, last: f64) {
        self.first_changes += 1;
        if self.first_changes == 1 {
            self.least_bends_n_per_kn = [f64::INFINITY; FIRST_QUANTILE];
        } else {
            // The bend of a white noise has three times the variance of a change.
            let mut bend = (change - last).abs() / 3_f64.sqrt();
            for least in &mut self.least_bends_n_per_kn {
                if bend < *least {
                    std::mem::swap(&mut bend, least);
                }
            }
        }
        if self.first_changes == FIRST_CHANGES {
            self.change_n_per_kn = self.least_bends_n_per_kn[FIRST_QUANTILE - 1].max(CHANGE_MIN);
            self.withdrawn_share = 0.0;
        }
    }
}

#[cfg(test)]
mod tests;
