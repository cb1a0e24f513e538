//! What a model makes of one run, and by its parameters; what has not changed is not computed again.
//!
//! Effects are handled in three ways. Resistances that only add to the others, and gradients, are integrated by
//! themselves for a unit of what they are proportional to. All others act on the forces together; where that
//! is one effect in which the forces are affine, two looks at the samples give it for all parameters.

use std::ops::Range;

use dynocar_core::force::balance::mps2_per_n_per_kn;

use super::super::model::{UpdatedForces, UpdatedModel, integrate_bins};
use super::super::response::Response;
use super::super::run_data::RunData;
use crate::explain::hypothesis::SharedHypothesis;

/// How an effect is handled.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Handling {
    /// Together with the others.
    Together,
    /// As a resistance of its own.
    Added,
    /// As gradients in proportion to its parameters.
    Gradient,
}

/// An effect with the ranges of its parameters, and the function of each in which the forces are affine.
type Affine<'m> = (&'m SharedHypothesis, Range<usize>, fn(f64) -> f64);

/// A model with how each of its effects is handled.
pub(super) struct Plan<'m> {
    model: &'m UpdatedModel,
    ranges: Vec<Range<usize>>,
    handlings: Vec<Handling>,
}

/// What is known of one run, for one model.
#[derive(Default)]
pub(super) struct RunMemory {
    together: Together,
    /// By effect: parameters but the first, and the bins for a first one of 1.
    added: Vec<Option<(Vec<f64>, Vec<f64>)>>,
    /// By parameter of gradients: the bins for one of 1; empty where it does not touch the run.
    gradients: Vec<Option<Vec<f64>>>,
    forces: UpdatedForces,
    /// At each sample.
    samples: Vec<f64>,
}

/// What the effects make that act together.
#[derive(Default)]
enum Together {
    #[default]
    Unknown,
    /// Nothing: what is declared stays.
    Nothing,
    /// That at none, and by how much it changes with each parameter's affine coordinate.
    Affine { at: Response, none: Response, slopes: Vec<Option<Response>> },
    /// That at some parameters of the whole model.
    At(Vec<f64>, Response),
}

impl<'m> Plan<'m> {
    /// Of a model.
    pub fn of(model: &'m UpdatedModel) -> Self {
        let adds_up = model.adds_up();
        let handling =
            |effect: &SharedHypothesis| match (effect.is_gradient(), effect.only_resists()) {
                (true, _) if adds_up => Handling::Gradient,
                (_, true) if adds_up => Handling::Added,
                _ => Handling::Together,
            };
        Plan {
            model,
            ranges: model.ranges(),
            handlings: model.effects.iter().map(handling).collect(),
        }
    }

    /// The effects handled so, by number, with the ranges of their parameters.
    fn handled(
        &self,
        handling: Handling,
    ) -> impl Iterator<Item = (usize, &SharedHypothesis, Range<usize>)> {
        let effects = self.model.effects.iter().zip(&self.ranges).enumerate();
        let own = effects.filter(move |(number, _)| self.handlings[*number] == handling);
        own.map(|(number, (effect, range))| (number, effect, range.clone()))
    }

    fn acts_together(&self) -> impl Fn(usize) -> bool {
        |number| self.handlings[number] == Handling::Together
    }

    /// The one effect that acts together, with the function in which it is affine.
    fn affine(&self) -> Option<Affine<'_>> {
        let mut together = self.handled(Handling::Together);
        let (_, effect, range) = together.next()?;
        let affine_in = effect.affine_in()?;
        together.next().is_none().then_some((effect, range, affine_in))
    }
}

/// What a run and the model that it is fitted with are to an evaluation.
#[derive(Clone, Copy)]
pub(super) struct At<'a> {
    pub plan: &'a Plan<'a>,
    pub run: &'a RunData,
    /// What is declared makes of the run.
    pub declared: &'a Response,
    pub theta: &'a [f64],
}

impl At<'_> {
    fn davis(&self) -> [f64; 3] {
        [self.theta[0], self.theta[1], self.theta[2]]
    }

    /// Acceleration in m/s² that 1 N/kN takes away.
    fn unit_mps2(&self) -> f64 {
        let first = self.run.declared.first();
        first.map_or(0.0, |first| mps2_per_n_per_kn(first.rotating_mass_factor))
    }
}

impl RunMemory {
    /// The modelled speeds at the bins.
    pub fn predict(&mut self, at: At, bins: &mut Vec<f64>) {
        self.act_together(at);
        self.response(at.declared).bins(at.davis(), bins);
        for (number, _, range) in at.plan.handled(Handling::Added) {
            let first = at.theta[range.start];
            let unit = self.added_bins(at, number);
            bins.iter_mut().zip(unit).for_each(|(bin, unit)| *bin += first * unit);
        }
        for (number, _, range) in at.plan.handled(Handling::Gradient) {
            for (parameter, value) in at.theta[range].iter().enumerate() {
                let unit = self.gradient_bins(at, number, parameter);
                bins.iter_mut().zip(unit).for_each(|(bin, unit)| *bin += value * unit);
            }
        }
    }

    /// By parameter what a unit of it changes, not whitened: a, b, c and gradients by their slopes, the
    /// others by differences over some steps; empty for a parameter that does not touch the run.
    pub fn columns(&mut self, at: At, steps: &[f64]) -> Vec<Vec<f64>> {
        let mut columns = vec![Vec::new(); at.theta.len()];
        self.act_together(at);
        columns[..3].clone_from_slice(&self.response(at.declared).davis);
        for (number, _, range) in at.plan.handled(Handling::Gradient) {
            for (parameter, i) in range.enumerate() {
                columns[i].extend_from_slice(self.gradient_bins(at, number, parameter));
            }
        }
        for (number, effect, range) in at.plan.handled(Handling::Added) {
            let first = at.theta[range.start];
            let unit = self.added_bins(at, number).to_vec();
            let mut others = at.theta[range.start + 1..range.end].to_vec();
            for (k, i) in (range.start + 1..range.end).enumerate() {
                let step = steps[i - 3];
                others[k] += step;
                let column = &mut columns[i];
                self.resist(at, effect, &others, column);
                others[k] = at.theta[i];
                for (moved, unit) in column.iter_mut().zip(&unit) {
                    *moved = first * (*moved - unit) / step;
                }
            }
            columns[range.start] = unit;
        }
        self.columns_together(at, steps, &mut columns);
        columns
    }

    fn response<'r>(&'r self, declared: &'r Response) -> &'r Response {
        match &self.together {
            Together::At(_, response) | Together::Affine { at: response, .. } => response,
            Together::Nothing | Together::Unknown => declared,
        }
    }

    /// Reckons what the effects make that act together, where that has changed.
    fn act_together(&mut self, at: At) {
        let At { plan, run, theta, .. } = at;
        let touches = |(_, effect, range): (usize, &SharedHypothesis, Range<usize>)| {
            (0..range.len()).any(|parameter| effect.touches(parameter, run))
        };
        if matches!(self.together, Together::Unknown) {
            if !plan.handled(Handling::Together).any(touches) {
                self.together = Together::Nothing;
            } else if let Some((effect, range, _)) = plan.affine() {
                self.together = affine(at, effect, range, &mut self.forces);
            }
        }
        match &mut self.together {
            Together::Nothing => {}
            Together::Affine { at: response, none, slopes } => {
                let Some((effect, range, affine_in)) = plan.affine() else { return };
                response.clone_from(none);
                for (value, slope) in theta[range].iter().zip(slopes) {
                    if let Some(slope) = slope {
                        response.add(affine_in(*value) - affine_in(effect.none()), slope);
                    }
                }
            }
            Together::At(known, _) if known[3..] == theta[3..] => {}
            Together::At(known, response) => {
                known.copy_from_slice(theta);
                let acts = plan.acts_together();
                plan.model.response((run, theta), acts, &mut self.forces, response);
            }
            Together::Unknown => {
                let mut response = Response::default();
                let acts = plan.acts_together();
                plan.model.response((run, theta), acts, &mut self.forces, &mut response);
                self.together = Together::At(theta.to_vec(), response);
            }
        }
    }

    fn columns_together(&mut self, at: At, steps: &[f64], columns: &mut [Vec<f64>]) {
        let At { plan, run, theta, .. } = at;
        let davis = at.davis();
        if let Together::Affine { slopes, .. } = &self.together {
            let Some((_, range, affine_in)) = plan.affine() else { return };
            for (i, slope) in range.zip(slopes) {
                let Some(slope) = slope else { continue };
                let step = steps[i - 3];
                let per_unit = (affine_in(theta[i] + step) - affine_in(theta[i])) / step;
                slope.bins(davis, &mut columns[i]);
                columns[i].iter_mut().for_each(|value| *value *= per_unit);
            }
            return;
        }
        let mut bins = Vec::new();
        self.response(at.declared).bins(davis, &mut bins);
        let touched = |effect: &SharedHypothesis, range: Range<usize>| {
            let (effect, start) = (effect.clone(), range.start);
            range.filter(move |i| effect.touches(i - start, run))
        };
        let gradients =
            plan.handled(Handling::Together).filter(|(_, effect, _)| effect.is_gradient());
        for (_, effect, range) in gradients {
            let start = range.start;
            for i in touched(effect, range) {
                effect.gradient_permille(i - start, run, &mut self.samples);
                let acts = plan.acts_together();
                plan.model.gradient_slopes((run, theta), acts, &self.samples, &mut columns[i]);
            }
        }
        let mut elsewhere = theta.to_vec();
        let others =
            plan.handled(Handling::Together).filter(|(_, effect, _)| !effect.is_gradient());
        for i in others.flat_map(|(_, effect, range)| touched(effect, range)) {
            let step = steps[i - 3];
            elsewhere[i] += step;
            let acts = plan.acts_together();
            let at = (run, &elsewhere[..]);
            plan.model.predict_bins_of(at, acts, &mut self.forces, &mut columns[i]);
            elsewhere[i] = theta[i];
            for (moved, base) in columns[i].iter_mut().zip(&bins) {
                *moved = (*moved - base) / step;
            }
        }
    }

    /// The bins for a first parameter of 1 of an effect that only resists.
    fn added_bins(&mut self, at: At, number: usize) -> &[f64] {
        let range = at.plan.ranges[number].clone();
        let others = &at.theta[range.start + 1..range.end];
        self.added.resize_with(at.plan.handlings.len(), || None);
        if self.added[number].as_ref().is_none_or(|(known, _)| known != others) {
            let mut bins = self.added[number].take().map_or_else(Vec::new, |(_, bins)| bins);
            self.resist(at, &at.plan.model.effects[number], others, &mut bins);
            self.added[number] = Some((others.to_vec(), bins));
        }
        self.added[number].as_ref().map_or(&[], |(_, bins)| bins)
    }

    fn resist(&mut self, at: At, effect: &SharedHypothesis, others: &[f64], bins: &mut Vec<f64>) {
        effect.unit_n_per_kn(others, at.run, &mut self.samples);
        let (unit_mps2, n_per_kn) = (at.unit_mps2(), &self.samples);
        integrate_bins(at.run, |i| [-unit_mps2 * n_per_kn[i]], [bins]);
    }

    /// The bins for one of a gradient's parameters at 1; none where it does not touch the run.
    fn gradient_bins(&mut self, at: At, number: usize, parameter: usize) -> &[f64] {
        let i = at.plan.ranges[number].start + parameter;
        self.gradients.resize(at.theta.len(), None);
        if self.gradients[i].is_none() {
            let effect = &at.plan.model.effects[number];
            let mut bins = Vec::new();
            if effect.touches(parameter, at.run) {
                effect.gradient_permille(parameter, at.run, &mut self.samples);
                let (unit_mps2, permille) = (at.unit_mps2(), &self.samples);
                integrate_bins(at.run, |i| [-unit_mps2 * permille[i]], [&mut bins]);
            }
            self.gradients[i] = Some(bins);
        }
        self.gradients[i].as_deref().unwrap_or(&[])
    }
}

/// The response of a run to one effect in which the forces are affine.
fn affine(
    at: At,
    effect: &SharedHypothesis,
    range: Range<usize>,
    forces: &mut UpdatedForces,
) -> Together {
    let At { plan, run, theta, .. } = at;
    let mut elsewhere = theta.to_vec();
    elsewhere[range.clone()].fill(effect.none());
    let mut none = Response::default();
    plan.model.response((run, &elsewhere), plan.acts_together(), forces, &mut none);
    let slope = |(parameter, i): (usize, usize)| {
        let spec = &effect.parameters()[parameter];
        // As far away as possible, where rounding matters least.
        let is_upper = spec.upper - effect.none() > effect.none() - spec.lower;
        let far = if is_upper { spec.upper } else { spec.lower };
        effect.touches(parameter, run).then(|| {
            elsewhere[i] = far;
            let mut slope = Response::default();
            plan.model.response((run, &elsewhere), plan.acts_together(), forces, &mut slope);
            elsewhere[i] = effect.none();
            let affine_in = effect.affine_in().unwrap_or(|it| it);
            slope.become_slope_from(&none, affine_in(far) - affine_in(effect.none()));
            slope
        })
    };
    let slopes = range.enumerate().map(slope).collect();
    Together::Affine { at: none.clone(), none, slopes }
}
