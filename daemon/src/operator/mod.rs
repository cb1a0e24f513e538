//! Texts for an operator, for every place where they are shown: the log, `dynocar health`, the screen of `dynocar
//! watch` and a recording's events; among them the effect that a model may lack.
//!
//! The remedy is in [`dynocar_core::remedy`] and [`dynocar_shared::vocabulary::KINDS`].

use std::fmt;

use dynocar_shared::snapshot::REJECTION_REASONS;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{HALF_95, ParameterSnapshot, PipelineKind, RejectionReason};

/// Returns the name of a pipeline without a configured name: its number in the configuration and its kind.
pub fn pipeline_name(index: u32, kind: Option<PipelineKind>) -> String {
    format!("{index}_{}", kind.map_or("unknown", PipelineKind::name))
}

/// Returns a duration as people say it.
pub fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 10.0 => format!("{s:.1} s"),
        s if s < 120.0 => format!("{s:.0} s"),
        s if s < 7200.0 => format!("{:.0} min", s / 60.0),
        s if s < 172_800.0 => format!("{:.0} h", s / 3600.0),
        s => format!("{:.0} days", s / 86_400.0),
    }
}

/// Time in s without a sample after which a controller is said to send none.
pub const SILENT_S: f64 = 5.0;

/// Returns the age of the newest sample, if any has come, and the process of the controller that sends samples.
pub fn newest_sample_words(age_s: Option<f64>, controller_process: Option<u32>) -> String {
    let newest = match age_s {
        None => "none has come yet".to_owned(),
        Some(age_s) if age_s < SILENT_S => format!("the newest is {} old", duration(age_s)),
        Some(age_s) => format!("none for {}", duration(age_s)),
    };
    match controller_process {
        Some(process) => format!("{newest}; controller: process {process}"),
        None => format!("{newest}; no controller is there"),
    }
}

/// Why samples were refused and how many, the most frequent first.
pub fn refusals(counts: &[u32; REJECTION_REASONS]) -> Vec<(RejectionReason, u32)> {
    let of = |&reason: &RejectionReason| (reason, counts[reason as usize]);
    let mut all: Vec<_> = RejectionReason::ALL.iter().map(of).filter(|it| it.1 > 0).collect();
    all.sort_by_key(|it| std::cmp::Reverse(it.1));
    all
}

/// Returns the same in words: `speed_jump 104, outlier 2`.
pub fn refused_words(refused: &[(RejectionReason, u32)]) -> String {
    let words: Vec<_> = refused.iter().map(|(reason, count)| format!("{reason} {count}")).collect();
    words.join(", ")
}

/// Suspicion of a pipeline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Suspicion {
    /// The effect; `None` for one that this release does not know.
    pub effect: Option<EffectKind>,
    /// Other effects that the data hardly distinguish from it: a bit for each.
    pub alternatives: u32,
    /// How long it has stood, in s of the controller's clock.
    pub age_s: u32,
    /// Twice the log-likelihood ratio.
    pub evidence: f64,
    /// The force in N, retarding positive, that the model does not explain.
    pub force_n: f64,
    /// Its standard deviation in N.
    pub force_std_n: f64,
}

impl Suspicion {
    /// Returns the suspicion in a snapshot; `None` if there is none.
    pub fn from_snapshot(it: &ParameterSnapshot) -> Option<Self> {
        let effect = EffectKind::from_number(it.suspected_effect);
        (effect != Some(EffectKind::None)).then_some(Suspicion {
            effect,
            alternatives: it.suspected_alternatives,
            age_s: it.suspicion_age_s,
            evidence: it.suspicion_evidence,
            force_n: it.unexplained_force_n,
            force_std_n: it.unexplained_force_std_n,
        })
    }

    /// Returns the effect's name.
    pub fn name(&self) -> &'static str {
        self.effect.map_or("an effect that is unknown here: a newer daemon", EffectKind::name)
    }

    /// Returns the unexplained force with its 95 % interval.
    pub fn force(&self) -> String {
        force_words(self.force_n, self.force_std_n)
    }
}

/// Returns a force in N with its 95 % interval, in kN.
pub fn force_words(force_n: f64, force_std_n: f64) -> String {
    format!("{:+.2} ± {:.2} kN", 1e-3 * force_n, 1e-3 * HALF_95 * force_std_n)
}

impl fmt::Display for Suspicion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, since) = (self.name(), duration(f64::from(self.age_s)));
        write!(f, "{name} for {since}, evidence {:.0}", self.evidence)?;
        let others = EffectKind::ALL.iter().filter(|kind| self.alternatives & kind.bit() != 0);
        let others: Vec<&str> = others.map(|kind| kind.name()).collect();
        if others.is_empty() {
            return Ok(());
        }
        write!(f, ", could also be: {}", others.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_said_as_people_say_them() {
        let all = [0.04, 45.0, 600.0, 9000.0, 864_000.0].map(duration);
        assert_eq!(all, ["0.0 s", "45 s", "10 min", "2 h", "10 days"]);
    }

    #[test]
    fn a_controller_that_is_gone_or_silent_is_named() {
        let words = newest_sample_words;
        assert_eq!(words(Some(0.1), Some(7)), "the newest is 0.1 s old; controller: process 7");
        assert_eq!(words(Some(34.0), Some(7)), "none for 34 s; controller: process 7");
        assert_eq!(words(Some(34.0), None), "none for 34 s; no controller is there");
        assert_eq!(words(None, None), "none has come yet; no controller is there");
    }

    #[test]
    fn the_most_frequent_refusal_comes_first() {
        let mut counts = [0; REJECTION_REASONS];
        counts[RejectionReason::Outlier as usize] = 2;
        counts[RejectionReason::SpeedJump as usize] = 104;
        assert_eq!(refused_words(&refusals(&counts)), "speed_jump 104, outlier 2");
        assert_eq!(refused_words(&[]), "");
    }
}

#[cfg(test)]
mod suspicion_tests {
    use super::*;

    #[test]
    fn a_suspicion_is_named_with_its_force_and_its_competing_hypotheses() {
        let mut snapshot = ParameterSnapshot::empty();
        assert_eq!(Suspicion::from_snapshot(&snapshot), None);
        snapshot.suspected_effect = EffectKind::DraggingBrake as u32;
        snapshot.suspected_alternatives = EffectKind::Wind.bit();
        (snapshot.suspicion_age_s, snapshot.suspicion_evidence) = (132, 45.6);
        (snapshot.unexplained_force_n, snapshot.unexplained_force_std_n) = (12_340.0, 500.0);
        let suspicion = Suspicion::from_snapshot(&snapshot).unwrap();
        let words = "dragging_brake for 2 min, evidence 46, could also be: wind";
        assert_eq!(suspicion.to_string(), words);
        assert_eq!(suspicion.force(), "+12.34 ± 0.98 kN");
        snapshot.suspected_effect = 99;
        assert!(Suspicion::from_snapshot(&snapshot).unwrap().to_string().contains("newer daemon"));
    }
}
