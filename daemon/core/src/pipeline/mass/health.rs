//! How well the input of an estimator serves it.

use dynocar_shared::{Reason, RejectionReason};

use crate::force::ResolvedSample;
use crate::pipeline::InnovationMonitor;

/// Samples over which refusals are counted.
const MEMORY: f64 = 500.0;
/// Share of refused samples above which the input is called bad.
const BAD_SHARE: f64 = 0.3;
/// Mean square of normalised innovations above which they are too large.
const SQUARE_MAX: f64 = 2.0;
/// Lag-1 covariance of the normalised innovations above which the model lacks something; where
/// they are far smaller than expected, as with a perfect sensor, it does not matter that they
/// are alike.
const COVARIANCE_MAX: f64 = 0.4;
/// Long-run variance of the innovations beyond which the intervals are too narrow, however small
/// each of them is: noise that was learned from bad speeds hides the size, not the likeness.
const LONG_RUN_MAX: f64 = 4.0;
/// Innovations that such a judgement rests on.
const JUDGED_FROM: f64 = 100.0;

/// Which samples were refused lately, and for want of what.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InputHealth {
    refused_share: f64,
    want: Option<Reason>,
    used: u64,
}

impl InputHealth {
    /// A sample was used.
    pub fn accept(&mut self) {
        self.used += 1;
        self.refused_share -= self.refused_share / MEMORY;
    }

    /// A sample was refused.
    pub fn refuse(&mut self, reason: RejectionReason, sample: &ResolvedSample) {
        self.refused_share += (1.0 - self.refused_share) / MEMORY;
        self.want = match reason {
            RejectionReason::Missing if sample.gradient_permille.is_none() => {
                Some(Reason::GradientUnknown)
            }
            RejectionReason::Missing => Some(Reason::MissingQuantity),
            _ => None,
        };
    }

    /// Samples used so far.
    pub fn used(&self) -> u64 {
        self.used
    }

    /// What is wrong with the input, if anything.
    pub fn complaint(&self) -> Option<Reason> {
        let is_starved = self.used == 0 && self.want.is_some();
        (is_starved || self.refused_share > BAD_SHARE)
            .then(|| self.want.unwrap_or(Reason::BadInput))
    }
}

/// What the innovations say against the model, if anything.
pub fn innovation_complaint(monitor: &InnovationMonitor) -> Option<Reason> {
    if monitor.effective_count() < JUDGED_FROM {
        None
    } else if monitor.mean_square() > SQUARE_MAX {
        Some(Reason::InnovationsTooLarge)
    } else if monitor.correlation() * monitor.mean_square() > COVARIANCE_MAX
        || long_run_variance(monitor) > LONG_RUN_MAX
    {
        Some(Reason::InnovationsNotWhite)
    } else {
        None
    }
}

/// Variance of sums of the innovations over that of as many white ones of the expected size, if
/// their correlation fades from lag to lag as it does over the first.
fn long_run_variance(monitor: &InnovationMonitor) -> f64 {
    let correlation = monitor.correlation();
    monitor.mean_square() * (1.0 + correlation) / (1.0 - correlation).max(f64::EPSILON)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn monitor(innovation: impl Fn(u32) -> f64) -> InnovationMonitor {
        let mut monitor = InnovationMonitor::new(500);
        (0..1_000).for_each(|k| monitor.push(innovation(k)));
        monitor
    }

    #[test]
    fn innovations_are_judged_by_size_and_by_likeness() {
        let sign = |k: u32| if k.is_multiple_of(2) { 1.0 } else { -1.0 };
        let slow = |k: u32| if (k / 20).is_multiple_of(2) { 1.0 } else { -1.0 };
        assert_eq!(innovation_complaint(&InnovationMonitor::new(500)), None, "none yet");
        assert_eq!(innovation_complaint(&monitor(sign)), None);
        let large = innovation_complaint(&monitor(|k| 2.0 * sign(k)));
        assert_eq!(large, Some(Reason::InnovationsTooLarge));
        assert_eq!(innovation_complaint(&monitor(slow)), Some(Reason::InnovationsNotWhite));
        assert_eq!(innovation_complaint(&monitor(|k| 0.3 * slow(k))), None, "small");
    }
}
