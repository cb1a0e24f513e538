//! Criteria that decide whether an effect is more than chance, and whether two explanations are equally good.

/// Acceptance score that an effect must exceed. Simulated data without any effect stay far below it ([`NULL_SCORE`]);
/// recorded data, whose noise differs from its model, come nearer.
pub const SCORE_MIN: f64 = 3.0;
/// Least distance from no effect of a number on which the runs agree, in standard deviations by the scatter between
/// them.
pub const CERTAIN_STDS: f64 = 4.0;
/// The same for an effect that depends on one number per run, for which no place, run or form was chosen.
pub const CERTAIN_STDS_BY_RUN: f64 = 3.0;
/// Evidence by which two explanations may differ and still explain the data equally well; an additional effect must
/// explain this much more than its price.
pub const EQUAL: f64 = 6.0;
/// Evidence by which a force outside the library must explain more than a known kind.
pub const OUTSIDE_COST: f64 = 10.0;
/// Acceptance score of the strongest candidate of a search where nothing acts, fitted to the quantiles that
/// `dynocar-bench explain --kind none --kind none_poor_recording --seeds 200 --first-seed 2001` prints: 0.10, 0.20,
/// 0.44 and 0.88 for shares of 0.05, 0.02, 0.01 and 0.0025.
pub const NULL_SCORE: NullScore = NullScore { share: 0.05, at: 0.10, power: 1.0 };

/// The tail of a distribution of acceptance scores.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NullScore {
    /// Share of the searches that reach `at`.
    pub share: f64,
    /// An acceptance score.
    pub at: f64,
    /// Power of the score with which the share falls.
    pub power: f64,
}

/// Returns the acceptance score of an effect: its evidence times the square of its error reduction, of runs that
/// were fitted and of runs left out. Either alone is easily had: thousands of samples make anything significant,
/// and a flexible form takes away some of any error. The smaller the share, the more evidence it needs; an effect
/// that helps no run left out scores nothing.
pub fn acceptance_score(evidence: f64, reduction: f64) -> f64 {
    evidence.max(0.0) * reduction.max(0.0).powi(2)
}

/// Probability that a search over the whole library finds this strength where nothing acts.
pub fn p_value(acceptance_score: f64) -> f64 {
    let NullScore { share, at, power } = NULL_SCORE;
    (share * (acceptance_score.max(0.0) / at).powf(-power)).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_accepted_is_rare_on_nulls() {
        assert!(p_value(SCORE_MIN) <= 0.01);
        assert_eq!(p_value(-1e3), 1.0);
        assert!(p_value(1e6) > 0.0);
        assert!((0.0025..0.01).contains(&p_value(1.0)));
    }

    #[test]
    fn what_helps_no_run_left_out_has_no_strength() {
        assert_eq!(acceptance_score(1e6, -0.01), 0.0);
        assert_eq!(acceptance_score(-5.0, 0.9), 0.0);
        assert!(acceptance_score(400.0, 0.1) > acceptance_score(100.0, 0.1));
        // Half the share asks for four times the evidence.
        assert_eq!(acceptance_score(400.0, 0.1), acceptance_score(100.0, 0.2));
    }
}
