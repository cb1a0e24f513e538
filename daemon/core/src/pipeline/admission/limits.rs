//! The limits of admission: the reason that each gives, its bounds, and how often a sound sample passes it.
//!
//! Sound samples have a speed with an error of 0.1 m/s and a position with one of 5 m, both normal and worse than
//! usual sensors; an estimator refuses up to 2 % of them.

use dynocar_shared::{Reason, RejectionReason};

use self::Consequence::{Doubted, Refused};

/// Consequence of a limit that is passed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Consequence {
    /// The sample is refused.
    Refused(RejectionReason),
    /// The estimate is not to be used.
    Doubted(Reason),
}

/// Bounds of a figure of the samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limit {
    /// Consequence beyond the bounds.
    pub consequence: Consequence,
    /// The figure with its unit.
    pub of: &'static str,
    /// Least value within the bounds.
    pub low: f64,
    /// Greatest value within the bounds.
    pub high: f64,
    /// Probability, at most, that a sound sample lies beyond them; 0 where no train does.
    pub false_alarm: f64,
}

impl Limit {
    /// Returns true for a figure beyond the bounds, which count in a unit of the figure, and for one that is not a number.
    #[inline]
    pub fn is_passed(&self, figure: f64, unit: f64) -> bool {
        !(self.low * unit..=self.high * unit).contains(&figure)
    }
}

macro_rules! limits {
    ($($(#[$doc:meta])* $name:ident = $consequence:expr, $of:literal, $low:literal to $high:literal, $false_alarm:literal;)*) => {
        $($(#[$doc])* pub const $name: Limit = Limit {
            consequence: $consequence,
            of: $of,
            low: $low,
            high: $high,
            false_alarm: $false_alarm,
        };)*

        /// Every limit.
        pub const LIMITS: &[Limit] = &[$($name),*];
    };
}

limits! {
    /// Speed as measured.
    SPEED = Refused(RejectionReason::SpeedOutOfRange), "speed in m/s", 0.0 to 170.0, 0.0;
    /// Gross mass; a load, and no wrong unit.
    MASS = Refused(RejectionReason::MassOutOfRange), "mass over the declared one", 0.2 to 5.0, 0.0;
    /// Traction and brake force; wheel and rail carry no more.
    FORCE = Refused(RejectionReason::ForceOutOfRange), "force over the train's weight", 0.0 to 0.6, 0.0;
    /// Change of speed: quantum and noise, beyond the greatest acceleration of 4 m/s².
    SPEED_STEP = Refused(RejectionReason::SpeedJump), "change of speed beyond 4 m/s² in m/s", -1.0 to 1.0, 2.8e-11;
    /// Difference between position and integrated speed; a balise corrects a position by as much.
    POSITION_STEP = Refused(RejectionReason::PositionJump), "change of position beyond the integrated speed in m", -60.0 to 60.0, 4.7e-16;
    /// Step ahead in time that is believed within a run.
    TIME_STEP = Refused(RejectionReason::TimeJump), "step in time in s", 0.0 to 86_400.0, 0.0;
    /// Time for which a moving train repeats speed, place and forces; longer steps are not integrated over.
    REPEATED = Refused(RejectionReason::Repeated), "time of repetition in s", 0.0 to 2.5, 0.0;
    /// Copies of a sample that come in a row; more come from a sender that is stuck.
    COPIES = Refused(RejectionReason::TimeNotIncreasing), "copies of a sample in a row", 0.0 to 100.0, 0.0;
    /// Innovation of an estimator; the fifth in a row beyond it is believed.
    INNOVATION = Refused(RejectionReason::Outlier), "innovation in standard deviations", -8.0 to 8.0, 2.6e-14;
    /// Change of force from one sample to the next, over the change that 20 % of them stay below: a force that exceeds
    /// it and comes back at once is lone.
    LONE_FORCE = Refused(RejectionReason::Outlier), "change of force over its 20 % quantile", -24.0 to 24.0, 1.9e-8;
    /// Share of samples that validation refuses: where this many are plainly wrong, others are wrong without being
    /// plainly so.
    INVALID_SHARE = Doubted(Reason::BadInput), "share refused by validation lately", 0.0 to 0.15, 1e-67;
    /// Share of valid samples that an estimator refuses: those that lack a force, slide, stand alone or do not fit.
    UNFIT_SHARE = Doubted(Reason::BadInput), "share refused by the estimator lately", 0.0 to 0.3, 1e-212;
    /// Share of samples whose force stands alone: where one in 20 fails, one in 8000 begins a row that passes for a
    /// new level.
    LONE_SHARE = Doubted(Reason::BadInput), "share of lone forces lately", 0.0 to 0.05, 1e-36;
}

/// Greatest acceleration and deceleration of a train in m/s².
pub const ACCELERATION_MAX_MPS2: f64 = 4.0;

/// Samples over which the shares of refused ones are remembered.
pub const REFUSALS_MEMORY: f64 = 500.0;
/// Samples over which the share of lone forces is remembered.
pub const LONE_MEMORY: f64 = 100.0;

#[cfg(test)]
mod tests {
    use super::*;

    /// Errors of sound samples: of speed in m/s and of position in m.
    const SOUND: (f64, f64) = (0.1, 5.0);
    /// Share of sound samples that an estimator refuses.
    const SOUND_REFUSALS: f64 = 0.02;

    /// Returns the probability, at most, that a normal error lies beyond some standard deviations on either side.
    fn beyond(deviations: f64) -> f64 {
        2.0 * (-0.5 * deviations * deviations).exp()
    }

    /// Returns the probability, at most, that a fading share of events of some probability exceeds a limit (Chernoff
    /// 1952).
    fn share_beyond(limit: &Limit, memory: f64, probability: f64) -> f64 {
        let weights: Vec<f64> =
            (0..20 * memory as i32).map(|age| (1.0 - 1.0 / memory).powi(age) / memory).collect();
        let exponent = |tilt: f64| {
            let terms = weights.iter().map(|weight| (tilt * weight).exp_m1() * probability);
            terms.map(f64::ln_1p).sum::<f64>() - tilt * limit.high
        };
        (1..3000).map(|k| exponent(0.01 * memory * f64::from(k))).fold(0.0, f64::min).exp()
    }

    #[test]
    fn each_limit_is_passed_as_seldom_as_it_says() {
        // The quantile of 20 % of a normal error's size is this share of its standard deviation.
        let quantile = 0.253_347;
        let lone = beyond(LONE_FORCE.high * quantile);
        for (limit, probability) in [
            (&SPEED_STEP, beyond(SPEED_STEP.high / (2_f64.sqrt() * SOUND.0))),
            (&POSITION_STEP, beyond(POSITION_STEP.high / (2_f64.sqrt() * SOUND.1))),
            (&INNOVATION, beyond(INNOVATION.high)),
            (&LONE_FORCE, lone),
            (&INVALID_SHARE, share_beyond(&INVALID_SHARE, REFUSALS_MEMORY, SOUND_REFUSALS)),
            (&UNFIT_SHARE, share_beyond(&UNFIT_SHARE, REFUSALS_MEMORY, SOUND_REFUSALS)),
            (&LONE_SHARE, share_beyond(&LONE_SHARE, LONE_MEMORY, lone)),
        ] {
            let of = limit.of;
            assert!(probability <= limit.false_alarm, "{of}: {probability:e}");
            assert!(limit.false_alarm < 3.0 * probability, "{of}: {probability:e}");
        }
    }

    #[test]
    fn the_decision_names_each_limit_with_its_probability() {
        let decision =
            include_str!("../../../../../docs/decisions/0010-one-judge-and-one-motion.md");
        for limit in LIMITS {
            let name = match limit.consequence {
                Consequence::Refused(reason) => reason.name(),
                Consequence::Doubted(reason) => reason.name(),
            };
            let Limit { of, low, high, false_alarm, .. } = limit;
            let often = if *false_alarm > 0.0 { format!("{false_alarm:e}") } else { "0".into() };
            let row = format!("| `{name}` | {of} | {low} to {high} | {often} |");
            assert!(decision.contains(&row), "{row}");
        }
    }
}
