//! Effects that act on the forces of a run, in blocks of so few samples that they stay in the processor's cache.

use std::ops::Range;

use super::bins::Bin;
use super::run_data::RunData;
use super::sample_forces::SampleForces;
use crate::explain::hypothesis::{On, Past, SharedHypothesis};

/// Number of samples of a block.
const BLOCK: usize = 128;

/// All samples of a run, block by block.
pub(super) fn blocks(run: &RunData) -> impl Iterator<Item = Range<usize>> {
    let count = run.samples().len();
    (0..count).step_by(BLOCK).map(move |first| first..(first + BLOCK).min(count))
}

/// Effects of a model with the ranges of their parameters, in the order in which they act.
pub(super) struct Pass<'m> {
    pub order: Vec<(&'m SharedHypothesis, Range<usize>)>,
    /// Whether one of them depends on earlier samples: then no sample may be left out.
    pub looks_back: bool,
}

impl<'m> Pass<'m> {
    /// Returns the pass of effects that are given in the order of the model; sorts them by their turn.
    pub fn of(effects: impl Iterator<Item = (&'m SharedHypothesis, Range<usize>)>) -> Self {
        let mut order: Vec<_> = effects.collect();
        order.sort_by_key(|(effect, _)| effect.nature().turn);
        let looks_back = order.iter().any(|(effect, _)| effect.nature().looks_back);
        Pass { order, looks_back }
    }

    /// The first of some bins that are looked at together with the samples from one on: one at least.
    pub fn bins<'b>(&self, first: usize, bins: &'b [Bin]) -> &'b [Bin] {
        let fits = |bin: &&Bin| bin.end <= first + BLOCK;
        let count = bins.iter().take_while(fits).count();
        &bins[..count.max(1).min(bins.len())]
    }

    /// Acts on the declared forces at some samples of a run.
    pub fn on_declared(
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
    pub fn act(
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
pub(super) struct PassInput<'a> {
    pub run: &'a RunData,
    pub theta: &'a [f64],
    /// Number of the first sample.
    pub first: usize,
}

/// Forces at the newest samples, with the memory that the effects keep of those before.
#[derive(Clone, Debug, Default)]
pub(super) struct Acting {
    pub samples: Vec<SampleForces>,
    pasts: Vec<Past>,
}

impl Acting {
    /// As declared, at some samples of a run.
    pub fn declared(&mut self, run: &RunData, samples: Range<usize>) {
        self.samples.clear();
        self.samples.extend(run.declared.at(samples));
    }
}
