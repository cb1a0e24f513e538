//! How each effect of a model is handled in a fit.
//!
//! Resistances that only add to the others, and gradients, are integrated by themselves for one unit of their factor.
//! All other effects act on the forces together.

use std::ops::Range;

use dynocar_model::force::mps2_per_n_per_kn;

use super::super::integral::Response;
use super::super::model::UpdatedModel;
use super::super::run_data::RunData;
use crate::explain::hypothesis::{Handling, OnOthers, SharedHypothesis};

/// An effect with the ranges of its parameters, and the function of each in which the forces are affine.
pub(super) type Affine<'m> = (&'m SharedHypothesis, Range<usize>, fn(f64) -> f64);

/// A model and how each of its effects is handled.
pub(super) struct Plan<'m> {
    pub model: &'m UpdatedModel,
    pub ranges: Vec<Range<usize>>,
    pub handlings: Vec<Handling>,
}

impl<'m> Plan<'m> {
    /// Of a model.
    pub fn of(model: &'m UpdatedModel) -> Self {
        let on_others = model.on_others();
        let is_apart = |effect: &SharedHypothesis| match on_others {
            OnOthers::Nothing => true,
            OnOthers::Scales => !effect.nature().feels_speed,
            OnOthers::Changes => false,
        };
        let handling = |effect: &SharedHypothesis| match is_apart(effect) {
            true => effect.nature().handling,
            false => Handling::Together,
        };
        Plan {
            model,
            ranges: model.ranges(),
            handlings: model.effects.iter().map(handling).collect(),
        }
    }

    /// The effects handled so, by number, with the ranges of their parameters.
    pub fn handled(
        &self,
        handling: Handling,
    ) -> impl Iterator<Item = (usize, &SharedHypothesis, Range<usize>)> {
        let effects = self.model.effects.iter().zip(&self.ranges).enumerate();
        let own = effects.filter(move |(number, _)| self.handlings[*number] == handling);
        own.map(|(number, (effect, range))| (number, effect, range.clone()))
    }

    /// Returns the effects that act together on a run.
    pub fn acting(
        &self,
        run: &RunData,
    ) -> impl Iterator<Item = (usize, &SharedHypothesis, Range<usize>)> {
        self.handled(Handling::Together).filter(move |(number, ..)| self.acts_on(*number, run))
    }

    fn acts_on(&self, number: usize, run: &RunData) -> bool {
        let effect = &self.model.effects[number];
        (0..self.ranges[number].len()).any(|parameter| effect.touches(parameter, run))
    }

    /// Returns the parameters of the effects that act together on a run, by their numbers.
    pub fn together(&self, run: &RunData) -> impl Iterator<Item = usize> {
        self.acting(run).flat_map(|(_, _, range)| range)
    }

    /// Returns whether the computed values of a run for a model also serve a model with more effects.
    pub fn serves(&self, grown: &Plan, run: &RunData) -> bool {
        let count = self.handlings.len();
        grown.handlings[..count] == self.handlings
            && !grown.acting(run).any(|(number, ..)| number >= count)
    }

    pub fn acts_together(&self, run: &RunData) -> impl Fn(usize) -> bool {
        let numbers: Vec<usize> = self.acting(run).map(|(number, ..)| number).collect();
        move |number| numbers.contains(&number)
    }

    /// The one effect that acts together on a run, with the function in which it is affine.
    pub fn affine(&self, run: &RunData) -> Option<Affine<'_>> {
        let mut together = self.acting(run);
        let (_, effect, range) = together.next()?;
        let affine_in = effect.nature().affine_in?;
        together.next().is_none().then_some((effect, range, affine_in))
    }
}

/// A run, the model fitted to it, and the parameters of an evaluation.
#[derive(Clone, Copy)]
pub(super) struct At<'a> {
    pub plan: &'a Plan<'a>,
    pub run: &'a RunData,
    /// Response of the declared model.
    pub declared: &'a Response,
    pub theta: &'a [f64],
}

impl At<'_> {
    pub fn davis(&self) -> [f64; 3] {
        [self.theta[0], self.theta[1], self.theta[2]]
    }

    /// Acceleration in m/s² that 1 N/kN takes away.
    pub fn unit_mps2(&self) -> f64 {
        let first = self.run.declared.get(0);
        first.map_or(0.0, |first| mps2_per_n_per_kn(first.rotating_mass_factor))
    }
}
