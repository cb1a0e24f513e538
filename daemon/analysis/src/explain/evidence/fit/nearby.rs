//! What models of the same parameters cost near a fit.

use nalgebra::Cholesky;

use super::linearised::Scratch;
use super::robust::RunFilters;
use super::{Fit, FitProblem, GrownModel};

/// Models in which only places differ from those of a fit.
pub struct Nearby<'a> {
    problem: &'a FitProblem,
    fit: &'a Fit,
    filters: Vec<RunFilters>,
    scratch: Scratch,
}

impl<'a> Nearby<'a> {
    /// Around a fit.
    pub fn new(problem: &'a FitProblem, fit: &'a Fit) -> Self {
        let filters = problem.filters(fit.noise);
        Nearby { problem, fit, filters, scratch: Scratch::default() }
    }

    /// Cost that a model reaches when all parameters are fitted again, to second order; `run` is
    /// the only run in which it differs from the fit's, by file, `None` when it may in all.
    /// `None` when the parameters are not determined.
    pub fn cost(&mut self, model: &GrownModel, run: Option<&str>) -> Option<f64> {
        let theta = &self.fit.theta;
        let (mut information, mut score, mut cost) = self.problem.prior(model, theta);
        for (index, own) in self.problem.runs.iter().enumerate() {
            let filters = &self.filters[index];
            let moved = run.is_none_or(|run| run == own.file).then(|| {
                FitProblem::run_linearised(model, theta, own, filters, &mut self.scratch).normal
            });
            let normal = moved.as_ref().unwrap_or(&self.fit.runs[index]);
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
