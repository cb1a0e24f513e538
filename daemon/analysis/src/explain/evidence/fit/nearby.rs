//! What models of the same parameters cost near a fit.

use nalgebra::Cholesky;
use rayon::prelude::*;

use super::super::run_data::RunData;
use super::{Fit, FitProblem, UpdatedModel};

/// Models in which only places differ from those of a fit.
pub struct Nearby<'a> {
    problem: &'a FitProblem,
    fit: &'a Fit,
}

impl<'a> Nearby<'a> {
    /// Around a fit.
    pub fn new(problem: &'a FitProblem, fit: &'a Fit) -> Self {
        Nearby { problem, fit }
    }

    /// Cost that a model reaches when all parameters are fitted again, to second order; `run` is
    /// the only run in which it differs from the fit's, by file, `None` when it may in all.
    /// `None` when the parameters are not determined.
    pub fn cost(&self, model: &UpdatedModel, run: Option<&str>) -> Option<f64> {
        let theta = &self.fit.theta;
        let (mut information, mut score, mut cost) = self.problem.prior(model, theta);
        let moved = |(index, own): (usize, &RunData)| {
            let may_differ = run.is_none_or(|run| run == own.file);
            may_differ
                .then(|| self.problem.run_normal(index, model, theta, &self.fit.run_filters[index]))
        };
        let moved: Vec<_> = self.problem.runs.par_iter().enumerate().map(moved).collect();
        for (moved, fitted) in moved.iter().zip(&self.fit.runs) {
            let normal = moved.as_ref().unwrap_or(fitted);
            information += &normal.information;
            score += &normal.score;
            cost += normal.cost;
        }
        for (i, held) in self.fit.held_information.iter().enumerate() {
            information[(i, i)] += held;
        }
        let step = Cholesky::new(information)?.solve(&score);
        Some(cost - score.dot(&step)).filter(|reached| reached.is_finite())
    }
}
