//! The declared model with effects added, as acceleration at each sample. The effects act on the forces of a run in blocks
//! of so few samples that they stay in the processor's cache.

use std::ops::Range;

use dynocar_model::simulate::{ForceModel, QuadraticForces};
use dynocar_model::terms::wheel;
use dynocar_model::train::Davis;
use dynocar_shared::vocabulary::EffectKind;

use super::bins::Bin;
use super::integral::{Integral, Response, integrate_bins};
use super::run_data::RunData;
use super::run_scatter::{RunFactors, of_day};
use super::sample_forces::SampleForces;
use crate::explain::hypothesis::{On, OnOthers, Past, SharedHypothesis};

/// The declared model with Davis coefficients and effects as parameters.
#[derive(Clone, Default)]
pub struct UpdatedModel {
    /// Effects, in the order in which they act on the sample forces.
    pub effects: Vec<SharedHypothesis>,
}

impl UpdatedModel {
    /// The same with one effect more.
    pub fn with(&self, effect: SharedHypothesis) -> Self {
        let mut grown = self.clone();
        grown.effects.push(effect);
        grown
    }

    /// The number of its effect of a kind; `None` where it has none.
    pub fn position(&self, kind: EffectKind) -> Option<usize> {
        self.effects.iter().position(|effect| effect.kind() == kind)
    }

    /// Returns whether it has an effect of a kind.
    pub fn has(&self, kind: EffectKind) -> bool {
        self.position(kind).is_some()
    }

    /// Returns the model without one effect, and its parameters.
    pub fn without(&self, theta: &[f64], index: usize) -> (Self, Vec<f64>) {
        let (mut model, range) = (self.clone(), self.ranges()[index].clone());
        model.effects.remove(index);
        let kept = theta.iter().enumerate().filter(|(i, _)| !range.contains(i));
        (model, kept.map(|(_, value)| *value).collect())
    }

    /// Number of parameters: a, b, c and those of the effects.
    pub fn parameter_count(&self) -> usize {
        3 + self.effects.iter().map(|effect| effect.parameters().len()).sum::<usize>()
    }

    /// Where the parameters of each effect lie among all.
    pub fn ranges(&self) -> Vec<std::ops::Range<usize>> {
        let mut from = 3;
        self.effects
            .iter()
            .map(|effect| {
                let range = from..from + effect.parameters().len();
                from = range.end;
                range
            })
            .collect()
    }

    /// Returns the greatest influence of its effects on those among them that only add a resistance or a gradient.
    pub fn on_others(&self) -> OnOthers {
        self.effects.iter().map(|it| it.nature().on_others).max().unwrap_or(OnOthers::Nothing)
    }

    /// Returns the factor on the effects that only add a resistance or a gradient.
    pub fn scale_of_added(&self, theta: &[f64]) -> f64 {
        let effects = self.effects.iter().zip(self.ranges());
        effects.map(|(effect, range)| effect.scale_of_others(&theta[range])).product()
    }

    /// Measured over true speed, by some of the effects.
    fn speed_scale(&self, theta: &[f64], acts: &impl Fn(usize) -> bool) -> f64 {
        let effects = self.effects.iter().zip(self.ranges()).enumerate();
        let own = effects.filter(|(number, _)| acts(*number));
        own.map(|(_, (effect, range))| effect.speed_scale(&theta[range])).product()
    }

    /// Some of the effects, in the order in which they act.
    fn pass(&self, acts: &impl Fn(usize) -> bool) -> Pass<'_> {
        let effects = self.effects.iter().zip(self.ranges()).enumerate();
        Pass::of(effects.filter(|(number, _)| acts(*number)).map(|(_, own)| own))
    }

    /// Returns the change of the bins by a step of each of some parameters of effects, over the step: `moves` are
    /// numbers of parameters with their steps.
    pub fn differences(
        &self,
        (run, theta): (&RunData, &[f64]),
        acts: impl Fn(usize) -> bool,
        moves: &[(usize, f64)],
        forces: &mut [UpdatedForces; 2],
        columns: &mut [Vec<f64>],
    ) {
        let davis = Davis { a: theta[0], b: theta[1], c: theta[2] };
        let pass = self.pass(&acts);
        let [before, moved] = forces.each_mut().map(|forces| &mut forces.acting);
        let mut elsewhere = theta.to_vec();
        let room = || Vec::with_capacity(run.samples().len());
        let mut base_mps2 = room();
        let mut moved_mps2: Vec<Vec<f64>> = moves.iter().map(|_| room()).collect();
        for block in blocks(run) {
            let first = block.start;
            let push = |forces: &[SampleForces], scale: f64, mps2: &mut Vec<f64>| {
                mps2.extend(forces.iter().zip(&run.smooth_mps[first..]).map(|(forces, speed)| {
                    let speed_mps = wheel::true_speed_mps(*speed, scale);
                    let [p0, p1, p2] = forces.polynomial(davis, speed_mps);
                    scale * (p0 + speed_mps * (p1 + speed_mps * p2))
                }));
            };
            before.declared(run, block);
            for (turn, (_, range)) in pass.order.iter().enumerate() {
                let own = moves.iter().zip(&mut moved_mps2).enumerate();
                for (number, (&(i, step), mps2)) in own.filter(|it| range.contains(&it.1.0.0)) {
                    elsewhere[i] = theta[i] + step;
                    moved.samples.clone_from(&before.samples);
                    let past = number * pass.order.len();
                    pass.act(
                        PassInput { run, theta: &elsewhere, first },
                        turn..pass.order.len(),
                        moved,
                        past,
                    );
                    push(&moved.samples, self.speed_scale(&elsewhere, &acts), mps2);
                    elsewhere[i] = theta[i];
                }
                pass.act(PassInput { run, theta, first }, turn..turn + 1, before, 0);
            }
            push(&before.samples, self.speed_scale(theta, &acts), &mut base_mps2);
        }
        for (&(i, step), mps2) in moves.iter().zip(&moved_mps2) {
            integrate_bins(run, |k| [(mps2[k] - base_mps2[k]) / step], [&mut columns[i]]);
        }
    }

    /// The forces on a run for given parameters; `theta` starts with a, b, c.
    pub fn forces(&self, run: &RunData, theta: &[f64], forces: &mut UpdatedForces) {
        self.forces_on_day(run, theta, &RunFactors::zeros(), forces);
    }

    /// Returns the same forces with the run's own factors: factors less 1 on the control force and on the basic
    /// resistance, and a headwind in m/s.
    pub fn forces_on_day(
        &self,
        run: &RunData,
        theta: &[f64],
        own: &RunFactors,
        forces: &mut UpdatedForces,
    ) {
        let all = |_: usize| true;
        let davis = of_day(Davis { a: theta[0], b: theta[1], c: theta[2] }, own);
        let scale = self.speed_scale(theta, &all);
        let (pass, acting) = (self.pass(&all), &mut forces.acting);
        forces.quadratic.restart(scale);
        for block in blocks(run) {
            pass.on_declared((run, theta), block.clone(), acting);
            let each = acting.samples.iter().zip(&run.smooth_mps[block]);
            forces.quadratic.extend(each.map(|(state, &speed_mps)| {
                let own_n = -own[0] * (state.traction_n - state.brake_n);
                let state = SampleForces { extra_n: state.extra_n + own_n, ..*state };
                state.polynomial(davis, wheel::true_speed_mps(speed_mps, scale))
            }));
        }
    }

    /// Modelled measured speed at each bin, each segment starting from zero: the integral of the
    /// acceleration at the measured speed, averaged like the measurements.
    pub fn predict_bins(
        &self,
        run: &RunData,
        theta: &[f64],
        forces: &mut UpdatedForces,
        bins: &mut Vec<f64>,
    ) {
        let davis = Davis { a: theta[0], b: theta[1], c: theta[2] };
        let accelerations = |state: &SampleForces, speed_mps: f64| {
            let [p0, p1, p2] = state.polynomial(davis, speed_mps);
            [p0 + speed_mps * (p1 + speed_mps * p2)]
        };
        self.integrate((run, theta), |_| true, accelerations, forces, [bins]);
    }

    /// Returns the response of the bins to some of the effects for every a, b and c.
    pub fn response(
        &self,
        at: (&RunData, &[f64]),
        acts: impl Fn(usize) -> bool,
        forces: &mut UpdatedForces,
        response: &mut Response,
    ) {
        let none = Davis { a: 0.0, b: 0.0, c: 0.0 };
        let accelerations = |state: &SampleForces, speed_mps: f64| {
            let [p0, p1, p2] = state.polynomial(none, speed_mps);
            let [a, b, c] = state.davis_slopes(speed_mps);
            [p0 + speed_mps * (p1 + speed_mps * p2), a, b, c]
        };
        let Response { rest, davis: [by_a, by_b, by_c] } = response;
        self.integrate(at, acts, accelerations, forces, [rest, by_a, by_b, by_c]);
    }

    /// Acceleration in m/s² of the measured speed by each ‰ of gradient along the travel, at each sample.
    pub fn gradient_slopes(
        &self,
        at: (&RunData, &[f64]),
        acts: impl Fn(usize) -> bool,
        forces: &mut UpdatedForces,
        slopes: &mut Vec<f64>,
    ) {
        let (run, theta) = at;
        let scale = self.speed_scale(theta, &acts);
        let (pass, acting) = (self.pass(&acts), &mut forces.acting);
        slopes.clear();
        for block in blocks(run) {
            pass.on_declared(at, block, acting);
            slopes.extend(acting.samples.iter().map(|forces| scale * forces.gradient_slope()));
        }
    }

    /// Integrates accelerations under the forces and at the true speed at each sample, as measured.
    fn integrate<const N: usize>(
        &self,
        (run, theta): (&RunData, &[f64]),
        acts: impl Fn(usize) -> bool,
        accelerations: impl Fn(&SampleForces, f64) -> [f64; N],
        forces: &mut UpdatedForces,
        mut bins: [&mut Vec<f64>; N],
    ) {
        let scale = self.speed_scale(theta, &acts);
        let (pass, acting) = (self.pass(&acts), &mut forces.acting);
        let (mut integral, mut rest, mut done) = (Integral::START, &run.bins[..], 0);
        for bins in &mut bins {
            bins.clear();
            bins.reserve_exact(run.bins.len());
        }
        while let Some(bin) = rest.first() {
            let first = if pass.looks_back { done } else { bin.first };
            let own = pass.bins(first, rest);
            done = own.last().map_or(run.samples().len(), |last| last.end);
            pass.on_declared((run, theta), first..done, acting);
            for bin in own {
                let means = integral.mean(run, bin, |i| {
                    let speed_mps = wheel::true_speed_mps(run.smooth_mps[i], scale);
                    let own = accelerations(&acting.samples[i - first], speed_mps);
                    own.map(|own| scale * own)
                });
                bins.iter_mut().zip(means).for_each(|(bins, mean)| bins.push(mean));
            }
            rest = &rest[own.len()..];
        }
    }
}

/// Forces of a grown model over one run; keeps its memory from one evaluation to the next.
#[derive(Clone, Debug, Default)]
pub struct UpdatedForces {
    acting: Acting,
    quadratic: QuadraticForces,
}

impl ForceModel for UpdatedForces {
    #[inline]
    fn acceleration_mps2(&self, index: usize, speed_mps: f64) -> f64 {
        self.quadratic.acceleration_mps2(index, speed_mps)
    }

    fn speed_scale(&self) -> f64 {
        self.quadratic.speed_scale()
    }
}

/// Number of samples of a block.
const BLOCK: usize = 128;

/// All samples of a run, block by block.
fn blocks(run: &RunData) -> impl Iterator<Item = Range<usize>> {
    let count = run.samples().len();
    (0..count).step_by(BLOCK).map(move |first| first..(first + BLOCK).min(count))
}

/// Effects of a model with the ranges of their parameters, in the order in which they act.
struct Pass<'m> {
    order: Vec<(&'m SharedHypothesis, Range<usize>)>,
    /// Whether one of them depends on earlier samples: then no sample may be left out.
    looks_back: bool,
}

impl<'m> Pass<'m> {
    /// Returns the pass of effects that are given in the order of the model; sorts them by their turn.
    fn of(effects: impl Iterator<Item = (&'m SharedHypothesis, Range<usize>)>) -> Self {
        let mut order: Vec<_> = effects.collect();
        order.sort_by_key(|(effect, _)| effect.nature().turn);
        let looks_back = order.iter().any(|(effect, _)| effect.nature().looks_back);
        Pass { order, looks_back }
    }

    /// The first of some bins that are looked at together with the samples from one on: one at least.
    fn bins<'b>(&self, first: usize, bins: &'b [Bin]) -> &'b [Bin] {
        let fits = |bin: &&Bin| bin.end <= first + BLOCK;
        let count = bins.iter().take_while(fits).count();
        &bins[..count.max(1).min(bins.len())]
    }

    /// Acts on the declared forces at some samples of a run.
    fn on_declared(
        &self,
        (run, theta): (&RunData, &[f64]),
        samples: Range<usize>,
        acting: &mut Acting,
    ) {
        let first = samples.start;
        acting.declared(run, samples);
        self.act(PassInput { run, theta, first }, 0..self.order.len(), acting, 0);
    }

    /// Lets some of the effects act on the forces so far, at the samples from one on. Their memories start at number
    /// `past`.
    fn act(
        &self,
        PassInput { run, theta, first }: PassInput<'_>,
        turns: Range<usize>,
        acting: &mut Acting,
        past: usize,
    ) {
        let Acting { samples, pasts } = acting;
        pasts.resize_with(pasts.len().max(past + self.order.len()), Past::default);
        let own = self.order[turns.clone()].iter().zip(&mut pasts[past + turns.start..]);
        for ((effect, range), past) in own {
            effect.apply(&theta[range.clone()], On { run, first, past }, samples);
        }
    }
}

/// Samples on which effects act, and the parameters with which they do.
#[derive(Clone, Copy, Debug)]
struct PassInput<'a> {
    run: &'a RunData,
    theta: &'a [f64],
    /// Number of the first sample.
    first: usize,
}

/// Forces at the newest samples, with the memory that the effects keep of those before.
#[derive(Clone, Debug, Default)]
struct Acting {
    samples: Vec<SampleForces>,
    pasts: Vec<Past>,
}

impl Acting {
    /// As declared, at some samples of a run.
    fn declared(&mut self, run: &RunData, samples: Range<usize>) {
        self.samples.clear();
        self.samples.extend(run.declared.at(samples));
    }
}
