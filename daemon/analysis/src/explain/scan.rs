//! Gain of a force of a given shape, without a new fit.
//!
//! At a fitted model the innovations are orthogonal to the regressors. The cost decrease by one more linear parameter
//! then follows from three inner products of its whitened regressor: with the innovations, with itself and with the
//! other regressors. These products add up over runs, so that thousands of places, windows and sets of runs can be
//! compared.

use std::sync::{Arc, OnceLock};

use dynocar_model::force::ResolvedSample;
use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;
use nalgebra::{DMatrix, DVector};

use super::evidence::{
    Adjoint, Bin, Fit, FitProblem, RUNS_A_TASK, RunData, SampleForces, coarse_step,
};
use super::hypothesis::{Hypothesis, On, Past};
use crate::parallel;

/// Motion in s under a force without which nothing is learned of the force.
const FORCE_MIN_S: f64 = 30.0;

/// Inner products of a whitened regressor.
#[derive(Clone, Debug)]
pub struct Tuple {
    /// With the innovations.
    pub score: f64,
    /// With itself.
    pub square: f64,
    /// With the regressors of the fitted model.
    pub cross: DVector<f64>,
}

impl Tuple {
    /// Returns nothing.
    pub fn zero(count: usize) -> Self {
        Tuple { score: 0.0, square: 0.0, cross: DVector::zeros(count) }
    }

    /// Adds the tuple of another run with the same parameter.
    pub fn add(&mut self, other: &Tuple) {
        self.score += other.score;
        self.square += other.square;
        self.cross += &other.cross;
    }

    /// Removes the products that [`add`](Tuple::add) added.
    pub fn take_out(&mut self, other: &Tuple) {
        self.score -= other.score;
        self.square -= other.square;
        self.cross -= &other.cross;
    }
}

/// A fitted model with the data around it.
pub struct Scan<'a> {
    /// The fit runs.
    pub problem: &'a FitProblem,
    /// Runs whose speeds must not be looked at.
    pub holdout: &'a [RunData],
    /// The declared train.
    pub train: &'a TrainModel,
    /// The declared line.
    pub track: Option<&'a Arc<Track>>,
    /// The fitted model.
    pub fit: &'a Fit,
    covariance: DMatrix<f64>,
    /// By run, once it is asked for.
    adjoints: Vec<OnceLock<Adjoint>>,
}

impl<'a> Scan<'a> {
    /// Returns a scan around a fit; `None` when the fit's information is singular.
    pub fn new(
        problem: &'a FitProblem,
        holdout: &'a [RunData],
        train: &'a TrainModel,
        track: Option<&'a Arc<Track>>,
        fit: &'a Fit,
    ) -> Option<Self> {
        let covariance = fit.factor()?.inverse();
        let adjoints = problem.runs.iter().map(|_| OnceLock::new()).collect();
        Some(Scan { problem, holdout, train, track, fit, covariance, adjoints })
    }

    /// Returns the acceleration in m/s² that 1 N/kN of force gives.
    #[inline]
    pub fn per_unit_resistance_mps2(&self, sample: &ResolvedSample) -> f64 {
        sample.weight_kn / sample.inertial_mass_kg
    }

    /// Returns the time in s of used motion where a condition on the sample holds.
    pub fn seconds_where(&self, condition: impl Fn(&RunData, &ResolvedSample) -> bool) -> f64 {
        let mut total_s = 0.0;
        for run in &self.problem.runs {
            let time_s = run.recording.time_s();
            for bin in &run.bins {
                if condition(run, &run.samples()[bin.middle()]) {
                    total_s += time_s[bin.end - 1] - time_s[bin.first];
                }
            }
        }
        total_s
    }

    /// Returns whether the runs hold enough motion under a force, in N, that acts above zero.
    ///
    /// # Errors
    ///
    /// Where they hold less, with the force's `name`.
    pub fn requires_force(
        &self,
        force_n: fn(&ResolvedSample) -> Option<f64>,
        name: &str,
    ) -> Result<(), String> {
        let acting_s = self.seconds_where(|_, sample| force_n(sample).is_some_and(|n| n > 0.0));
        match acting_s < FORCE_MIN_S {
            true => Err(format!("the runs hold hardly any {name}")),
            false => Ok(()),
        }
    }

    /// Returns whether another inertia and a scale of the traction force look alike: without braking only gradients
    /// separate them, and an accelerometer feels these in one reading with the acceleration, at an unknown scale.
    pub fn are_inertia_and_traction_alike(&self) -> bool {
        self.problem.runs.iter().all(|run| run.is_gradient_felt)
            && self.requires_force(|sample| sample.brake_force_n, "braking").is_err()
    }

    /// Returns whether loads are taken from the traction force, which then shows neither a wrong scale of itself nor
    /// another mass.
    ///
    /// # Errors
    ///
    /// Where they are, in words.
    pub fn requires_known_loads(&self) -> Result<(), String> {
        match self.problem.runs.iter().any(|run| run.are_loads_estimated) {
            true => Err("no sample weighs the load, which is taken from the traction force".into()),
            false => Ok(()),
        }
    }

    /// Returns the tuple of a force shape over all runs: `acceleration(run, sample)` in m/s² per unit.
    pub fn tuple(&self, acceleration: impl Fn(&RunData, usize) -> f64 + Sync) -> Tuple {
        self.over_each_run(1, |index, _| self.run_tuple(index, &acceleration))
    }

    /// Returns where a fit may start from: the tuple of a force shape over some of many runs, as if over all.
    pub fn coarse_tuple(&self, acceleration: impl Fn(&RunData, usize) -> f64 + Sync) -> Tuple {
        self.over_some_runs(|index, _| self.run_tuple(index, &acceleration))
    }

    /// Returns the sum of a tuple of each of some of many runs, evenly chosen, as if over all.
    fn over_some_runs(&self, of_run: impl Fn(usize, &RunData) -> Tuple + Sync) -> Tuple {
        let runs = self.problem.runs.len();
        let step = coarse_step(runs);
        let mut sum = self.over_each_run(step, of_run);
        let times = runs as f64 / runs.div_ceil(step).max(1) as f64;
        sum.score *= times;
        sum.square *= times;
        sum.cross *= times;
        sum
    }

    fn over_each_run(
        &self,
        step: usize,
        of_run: impl Fn(usize, &RunData) -> Tuple + Sync,
    ) -> Tuple {
        let runs = &self.problem.runs;
        let each = parallel::in_tasks(runs.len().div_ceil(step), RUNS_A_TASK, |k| {
            of_run(k * step, &runs[k * step])
        });
        let mut sum = Tuple::zero(self.fit.theta.len());
        each.iter().for_each(|own| sum.add(own));
        sum
    }

    /// Returns the tuple of a force shape over one run.
    pub fn run_tuple(&self, index: usize, acceleration: impl Fn(&RunData, usize) -> f64) -> Tuple {
        let run = &self.problem.runs[index];
        let shape: Vec<f64> = run.bins.iter().map(|bin| acceleration(run, bin.middle())).collect();
        self.shape_tuple(index, &shape)
    }

    /// Returns the tuple of accelerations in m/s² at the bins of one run.
    pub fn shape_tuple(&self, index: usize, shape: &[f64]) -> Tuple {
        self.local_tuple(index, 0, shape)
    }

    /// Returns the same of accelerations at the bins from one on; none act at the others.
    pub fn local_tuple(&self, index: usize, from: usize, shape: &[f64]) -> Tuple {
        let mut tuple = Tuple::zero(self.fit.theta.len());
        let acts = |mps2: &f64| *mps2 != 0.0;
        let Some(first) = shape.iter().position(acts) else { return tuple };
        let last = shape.iter().rposition(acts).unwrap_or(first);
        let (start, shape) = (from + first, &shape[first..=last]);
        let run = &self.problem.runs[index];
        let adjoint = self.adjoints[index].get_or_init(|| Adjoint::of(run, self.fit, index));
        let products = adjoint.products(start, shape, tuple.cross.as_mut_slice());
        tuple.score = products.innovations;
        tuple.square = products.square - self.fit.filters[index].explained(products.factors);
        tuple
    }

    /// Returns the decrease of the cost when an effect acts, from the change in m/s² that it makes at a sample, by its
    /// declared and its actual forces. Some of many runs stand for all: the result only chooses where a fit starts.
    pub fn decrease_by(
        &self,
        effect: &dyn Hypothesis,
        parameters: &[f64],
        change_mps2: impl Fn(&RunData, usize, [&SampleForces; 2]) -> f64 + Sync,
    ) -> f64 {
        let sum = self.over_some_runs(|index, run| {
            let (mut past, mut middles) = (Past::default(), run.bins.iter().map(Bin::middle));
            let (mut shape, mut middle) = (Vec::with_capacity(run.bins.len()), middles.next());
            for (i, declared) in run.declared.all().enumerate() {
                let mut acting = [declared];
                effect.apply(parameters, On { run, first: i, past: &mut past }, &mut acting);
                if middle == Some(i) {
                    shape.push(change_mps2(run, i, [&declared, &acting[0]]));
                    middle = middles.next();
                }
            }
            self.shape_tuple(index, &shape)
        });
        self.decrease_at_one(&sum)
    }

    /// Returns the remaining square of a regressor when the model's regressors are projected out.
    fn free_square(&self, tuple: &Tuple) -> f64 {
        tuple.square - tuple.cross.dot(&(&self.covariance * &tuple.cross))
    }

    /// Returns the decrease of the cost by a free factor on the shape, and that factor.
    pub fn gain(&self, tuple: &Tuple) -> (f64, f64) {
        let free = self.free_square(tuple);
        if free <= 1e-6 * tuple.square || free <= 1e-9 {
            return (0.0, 0.0);
        }
        (tuple.score * tuple.score / free, tuple.score / free)
    }

    /// Returns the decrease of the cost when the shape acts with the factor 1.
    pub fn decrease_at_one(&self, tuple: &Tuple) -> f64 {
        2.0 * tuple.score - self.free_square(tuple)
    }
}
