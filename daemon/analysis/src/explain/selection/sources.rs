//! Scale of the speeds by each source of evidence alone, and whether the sources agree.

use dynocar_shared::HALF_95;
use nalgebra::Cholesky;

use super::outcome::SearchOutcome;
use crate::explain::answer::WithStd;
use crate::explain::evidence::FitProblem;

/// The scale of the speeds by positions alone, and by gradients and forces alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScaleSources {
    /// By positions.
    pub positions: WithStd,
    /// By gradients and forces, jointly with the usual errors of declared figures.
    pub motion: WithStd,
}

impl ScaleSources {
    /// Returns the scales of a finished model with a wrong wheel; `None` without one, or where one of the two sources
    /// determines nothing.
    pub fn of(problem: &FitProblem, outcome: &SearchOutcome) -> Option<Self> {
        let fit = &outcome.nuisance_fit.as_ref()?.1.fit;
        let scales = |number: &usize| fit.model.effects[*number].nature().changes_speed_scale;
        let wheel = (0..outcome.fit.model.effects.len()).find(scales)?;
        let i = fit.model.ranges()[wheel].start;
        let variance = Cholesky::new(fit.free_information())?.inverse()[(i, i)];
        let (ratio, std) = problem.positions.distance_ratio?;
        let positions = WithStd { value: ratio.recip(), std: std / (ratio * ratio) };
        Some(ScaleSources {
            positions,
            motion: without(WithStd { value: fit.theta[i], std: variance.sqrt() }, positions)?,
        })
    }

    /// Returns whether they are further apart than their 95 % intervals allow.
    pub fn are_apart(&self) -> bool {
        let allowed = HALF_95 * (self.positions.std + self.motion.std);
        (self.positions.value - self.motion.value).abs() > allowed
    }
}

/// Returns an estimate without one of its sources; `None` where nothing is left.
fn without(both: WithStd, source: WithStd) -> Option<WithStd> {
    let [all, own] = [both.std, source.std].map(|std| std.powi(-2));
    let left = all - own;
    (left > 0.0).then(|| WithStd {
        value: (all * both.value - own * source.value) / left,
        std: left.sqrt().recip(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_two_sources_say_together_is_taken_apart_again() {
        let positions = WithStd { value: 1.015, std: 0.001 };
        // Motion at 1.003 ± 0.002: weights of 4 to 1.
        let both = WithStd { value: 1.0126, std: (0.8f64).sqrt() * 1e-3 };
        let motion = without(both, positions).expect("motion says something");
        assert!((motion.value - 1.003).abs() < 1e-9 && (motion.std - 0.002).abs() < 1e-9);
        let apart = ScaleSources { positions, motion };
        assert!(apart.are_apart());
        let near = WithStd { value: 1.012, ..motion };
        assert!(!ScaleSources { positions, motion: near }.are_apart());
        assert_eq!(without(positions, positions), None);
    }
}
