//! The best common fit of many runs, of which not all are in memory.

use nalgebra::{Cholesky, DVector};

use super::{Fit, FitProblem, RunNormal};

/// Greatest number of steps of all runs together after the first, and the share of a standard deviation below which a
/// step is the last.
const PASSES_MAX: usize = 6;
const MOVED_MIN: f64 = 0.3;

impl FitProblem {
    /// Returns a fit whose parameters come from all runs, by their normal equations in groups.
    ///
    /// One step leads to the least cost of a linear model. How dead time and lag share a lateness is not linear:
    /// `normals_at` gives the equations at other parameters, until none of the first `count` effects that looks back
    /// moves by more than a share of its standard deviation.
    ///
    /// # Errors
    ///
    /// When the equations are not available.
    pub fn joined<E>(
        &self,
        fit: &Fit,
        groups: Vec<RunNormal>,
        count: usize,
        normals_at: impl Fn(&Fit) -> Result<Vec<RunNormal>, E>,
    ) -> Result<Fit, E> {
        let (mut share, mut best) = (1.0, Fit { runs: groups, ..fit.clone() });
        let mut joined = self.stepped(&best, share);
        for _ in 0..PASSES_MAX {
            if !is_moved(&best, &joined, count) {
                break;
            }
            let next = Fit { runs: normals_at(&joined)?, ..joined.clone() };
            if self.joined_cost(&next) < self.joined_cost(&best) {
                (share, best) = (1.0, next);
            } else {
                share *= 0.5;
            }
            joined = self.stepped(&best, share);
        }
        Ok(joined)
    }

    /// Takes a share of the step to the least cost by the normal equations of a fit's groups of runs, and moves these
    /// equations there to first order.
    fn stepped(&self, fit: &Fit, share: f64) -> Fit {
        let Some((theta, _)) = self.bounded_step(fit, &fit.score(), 0.0) else {
            return fit.clone();
        };
        let moved = theta.iter().zip(&fit.theta).map(|(to, from)| share * (to - from));
        let step = DVector::from_iterator(theta.len(), moved);
        let theta: Vec<f64> = fit.theta.iter().zip(&step).map(|(from, step)| from + step).collect();
        let runs = fit.runs.iter().map(|run| run.moved_by(&step)).collect();
        let (prior_information, prior_score, _) = self.prior(&fit.model, &theta);
        Fit { runs, prior_information, prior_score, theta, ..fit.clone() }
    }

    /// The cost of all groups of runs at the parameters of a fit, with the prior.
    fn joined_cost(&self, fit: &Fit) -> f64 {
        let prior = self.prior(&fit.model, &fit.theta).2;
        fit.runs.iter().fold(prior, |cost, run| cost + run.cost)
    }

    /// Returns a fit with a, b and c where all runs, in groups, fit best, and the effects moved by `moved`.
    pub fn with_davis_joined(&self, fit: &Fit, groups: &[RunNormal], moved: &[f64]) -> Fit {
        let all = Fit { runs: groups.to_vec(), ..fit.clone() };
        let (information, score) = (all.information(), all.score());
        let moved = DVector::from_column_slice(moved);
        let pull = score.rows(0, 3) - information.view((0, 3), (3, moved.len())) * &moved;
        let own = information.view((0, 0), (3, 3)).into_owned();
        let Some(factor) = Cholesky::new(own) else { return fit.clone() };
        let step = factor.solve(&pull);
        let mut theta = fit.theta.clone();
        for (i, value) in theta.iter_mut().enumerate() {
            if i < 3 {
                let (lower, upper) = self.declared_bounds(i);
                *value = (*value + step[i]).clamp(lower, upper);
            } else {
                *value += moved[i - 3];
            }
        }
        self.at(&fit.model, theta, fit.noise)
    }
}

/// Returns whether one of the first `count` effects that looks back moves from one fit to another by more than a part
/// of its standard deviation.
fn is_moved(from: &Fit, to: &Fit, count: usize) -> bool {
    let Some(covariance) = from.factor().map(|factor| factor.inverse()) else { return false };
    let effects = from.model.effects.iter().zip(from.model.ranges()).take(count);
    let mut numbers =
        effects.filter(|(effect, _)| effect.nature().looks_back).flat_map(|(_, range)| range);
    numbers.any(|i| (to.theta[i] - from.theta[i]).abs() > MOVED_MIN * covariance[(i, i)].sqrt())
}
