//! Derivatives of one run's response by each parameter.

use std::ops::Range;
use std::sync::Arc;

use super::super::super::integral::integrate_bins;
use super::super::plan::At;
use super::{RunMemory, Scratch, Together, is_near, with_scratch};
use crate::explain::hypothesis::{Handling, OnOthers, SharedHypothesis};

impl RunMemory {
    /// Returns for each parameter the change of the response by one unit, not whitened: for a, b, c and gradients by
    /// their slopes, for the others by differences over some steps; empty for a parameter that does not touch the run.
    pub fn columns(&mut self, at: At, steps: &[f64]) -> Vec<Vec<f64>> {
        let mut columns = vec![Vec::new(); at.theta.len()];
        self.act_together(at);
        columns[..3].clone_from_slice(&self.response(at.declared).davis);
        for number in 0..at.plan.handlings.len() {
            self.columns_apart(at, number, steps, &mut columns);
        }
        self.columns_together(at, steps, &mut columns);
        self.columns_of_scale(at, steps, |_| true, &mut columns);
        columns
    }

    /// Returns the columns of the last effect alone, whose parameters are at no effect.
    pub fn columns_of_last(&mut self, at: At, steps: &[f64]) -> Vec<Vec<f64>> {
        let mut columns = vec![Vec::new(); at.theta.len()];
        let last = at.plan.handlings.len() - 1;
        self.columns_apart(at, last, steps, &mut columns);
        if at.plan.acting(at.run).any(|(number, ..)| number == last) {
            if at.plan.affine(at.run).is_some() {
                self.act_together(at);
                self.columns_together(at, steps, &mut columns);
            } else {
                Self::differences(at, steps, |number| number == last, &mut columns);
            }
        }
        self.columns_of_scale(at, steps, |number| number == last, &mut columns);
        columns.split_off(at.plan.ranges[last].start)
    }

    /// The columns of an effect that only adds something.
    fn columns_apart(&mut self, at: At, number: usize, steps: &[f64], columns: &mut [Vec<f64>]) {
        let (effect, range) = (&at.plan.model.effects[number], at.plan.ranges[number].clone());
        let scale = at.plan.model.scale_of_added(at.theta);
        match at.plan.handlings[number] {
            Handling::Together => {}
            Handling::Gradient => {
                for (parameter, i) in range.enumerate() {
                    let unit = self.gradient_bins(at, number, parameter);
                    columns[i].extend(unit.iter().map(|unit| scale * unit));
                }
            }
            Handling::Added => {
                let first = at.theta[range.start] - effect.none();
                let unit = self.added_bins(at, number);
                columns[range.start] = unit.iter().map(|unit| scale * unit).collect();
                let others = range.start + 1..range.end;
                let by_mps2 = -at.unit_mps2() * scale * first;
                with_scratch(|Scratch { slopes, .. }| {
                    slopes.resize_with(others.len(), Vec::new);
                    let steps = &steps[others.start - 3..others.end - 3];
                    effect.unit_slopes(&at.theta[others.clone()], steps, at.run, slopes);
                    for (slope, column) in slopes.iter().zip(&mut columns[others]) {
                        integrate_bins(at.run, |i| [by_mps2 * slope[i]], [column]);
                    }
                });
            }
        }
    }

    /// Adds, to the columns of a parameter that scales the added effects, the change of these effects.
    fn columns_of_scale(
        &mut self,
        at: At,
        steps: &[f64],
        is_asked: impl Fn(usize) -> bool,
        columns: &mut [Vec<f64>],
    ) {
        if at.plan.handlings.iter().all(|handling| *handling == Handling::Together) {
            return;
        }
        let effects = at.plan.model.effects.iter().zip(&at.plan.ranges).enumerate();
        let scaling = effects.filter(|(number, (effect, _))| {
            is_asked(*number) && effect.nature().on_others == OnOthers::Scales
        });
        let mut elsewhere = at.theta.to_vec();
        for i in scaling.flat_map(|(_, (_, range))| range.clone()) {
            elsewhere[i] += steps[i - 3];
            let [before, after] =
                [at.theta, &elsewhere].map(|theta| at.plan.model.scale_of_added(theta));
            elsewhere[i] = at.theta[i];
            self.add(at, (after - before) / steps[i - 3], &mut columns[i]);
        }
    }

    fn columns_together(&mut self, at: At, steps: &[f64], columns: &mut [Vec<f64>]) {
        let At { plan, run, theta, .. } = at;
        let davis = at.davis();
        if let Together::Affine { slopes, .. } = &self.together {
            let Some((_, range, affine_in)) = plan.affine(run) else { return };
            for (i, slope) in range.zip(&slopes[..]) {
                let Some(slope) = slope else { continue };
                let step = steps[i - 3];
                let per_unit = (affine_in(theta[i] + step) - affine_in(theta[i])) / step;
                slope.bins(davis, &mut columns[i]);
                columns[i].iter_mut().for_each(|value| *value *= per_unit);
            }
            return;
        }
        let together = || plan.together(run);
        let known: Vec<f64> = davis.into_iter().chain(together().map(|i| theta[i])).collect();
        let own_steps: Vec<f64> = together().map(|i| steps[i - 3]).collect();
        if self.slopes.as_ref().is_none_or(|slopes| !is_near(&slopes.0, &known, &own_steps)) {
            Self::differences(at, steps, |_| true, columns);
            let slopes = together().map(|i| columns[i].clone()).collect();
            self.slopes = Some(Arc::new((known, slopes)));
        } else if let Some(slopes) = &self.slopes {
            together().zip(&slopes.1).for_each(|(i, slope)| columns[i].clone_from(slope));
        }
    }

    /// Returns the derivatives by each parameter of effects that act together, by another pass over the samples.
    fn differences(
        at: At,
        steps: &[f64],
        is_asked: impl Fn(usize) -> bool,
        columns: &mut [Vec<f64>],
    ) {
        let At { plan, run, theta, .. } = at;
        let touched = |effect: &SharedHypothesis, range: Range<usize>| {
            let (effect, start) = (effect.clone(), range.start);
            range.filter(move |i| effect.touches(i - start, run)).map(move |i| (i, i - start))
        };
        let (gradients, others): (Vec<_>, Vec<_>) =
            plan.acting(run).filter(|own| is_asked(own.0)).partition(|own| own.1.is_gradient());
        if !gradients.is_empty() {
            with_scratch(|Scratch { forces, samples, by_permille, .. }| {
                let acts = plan.acts_together(run);
                plan.model.gradient_slopes((run, theta), acts, forces, by_permille);
                for own in gradients {
                    let effect = own.1.clone();
                    for (i, parameter) in touched(own.1, own.2) {
                        effect.gradient_permille(parameter, run, samples);
                        integrate_bins(run, |k| [by_permille[k] * samples[k]], [&mut columns[i]]);
                    }
                }
            });
        }
        let moves: Vec<(usize, f64)> = others
            .into_iter()
            .flat_map(|(_, effect, range)| touched(effect, range))
            .map(|(i, _)| (i, steps[i - 3]))
            .collect();
        if !moves.is_empty() {
            let acts = plan.acts_together(run);
            with_scratch(|it| {
                plan.model.differences((run, theta), acts, &moves, &mut it.moved, columns);
            });
        }
    }
}
