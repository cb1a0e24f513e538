//! Several known laws at once, each scaled, weighed by evidence.
//!
//! An interacting multiple-model filter (Blom and Bar-Shalom 1988). Every hypothesis is a law
//! with its own scale; one of them may be that the brake, not the rail, is the smaller one
//! ([`Law::Demand`]). A change of hypothesis keeps distance and speed and opens the scale anew,
//! since the rail behind the tunnel portal says nothing of the rail inside.

use dynocar_shared::Uncertain;
use nalgebra::Vector1;

use super::engine::{Engine, EngineError, Estimate, Observation, Step};
use super::law::Law;
use super::motion::{STATES, State, StepInputs};
use super::tracker::{TrackerModel, measure};
use crate::filter::Gaussian;
use crate::filter::mixture::{Mixture, likeliest, to_shares};

const SPEED: usize = State::Speed as usize;
const SCALE: usize = State::Scale as usize;
const DRIFT: usize = State::Drift as usize;

/// Share of the probability at which one law stands alone; else the laws are mixed, and their
/// spread is part of the error.
const CLEAR: f64 = 0.9;

/// One law with its belief.
#[derive(Clone, Debug)]
struct Hypothesis {
    model: TrackerModel,
    state: Gaussian<STATES>,
    probability: f64,
    /// Scratch of a step.
    mixed: Gaussian<STATES>,
    log_likelihood: f64,
    normalised: f64,
}

/// Laws weighed by evidence.
#[derive(Clone, Debug)]
pub struct LawBank {
    hypotheses: Vec<Hypothesis>,
    /// Their probabilities.
    shares: Vec<f64>,
    /// Rate in 1/s at which one hypothesis gives way to another.
    change_rate_per_s: f64,
    demand: f64,
    is_started: bool,
}

impl LawBank {
    /// A bank of at least one hypothesis, all equally probable at first.
    ///
    /// # Panics
    ///
    /// When there is no hypothesis.
    pub fn new(models: Vec<TrackerModel>, change_rate_per_s: f64) -> Self {
        assert!(!models.is_empty(), "a bank holds at least one law");
        let empty = Mixture::<STATES>::default().belief;
        let shares = vec![0.0; models.len()];
        let hypotheses = models
            .into_iter()
            .map(|model| Hypothesis {
                model,
                state: empty,
                probability: 0.0,
                mixed: empty,
                log_likelihood: 0.0,
                normalised: 0.0,
            })
            .collect();
        LawBank { hypotheses, shares, change_rate_per_s, demand: 0.0, is_started: false }
    }

    /// Probability of a change within a step to one certain other hypothesis.
    fn switch_probability(&self, step_s: f64) -> f64 {
        let others = (self.hypotheses.len() - 1).max(1) as f64;
        (self.change_rate_per_s * step_s).min(0.5) / others
    }

    /// Mixes the beliefs as the possible changes of hypothesis ask, into `mixed`.
    fn mix(&mut self, step_s: f64) {
        let switch = self.switch_probability(step_s);
        let stay = 1.0 - switch * (self.hypotheses.len() - 1) as f64;
        for to in 0..self.hypotheses.len() {
            let target = &self.hypotheses[to];
            let prior = target.model.prior_scale(target.state.mean[SPEED], self.demand);
            let weight_of = |from: usize, hypothesis: &Hypothesis| {
                hypothesis.probability * if from == to { stay } else { switch }
            };
            let mut mixture = Mixture::default();
            for (from, hypothesis) in self.hypotheses.iter().enumerate() {
                let own = &hypothesis.state;
                let state = if from == to { *own } else { reopen(own, prior) };
                mixture.add(weight_of(from, hypothesis), &state.mean, &state.covariance);
            }
            let target = &mut self.hypotheses[to];
            target.mixed = mixture.belief;
            // The prior weight of the hypothesis, before its likelihood.
            target.log_likelihood = mixture.weight.max(f64::MIN_POSITIVE).ln();
        }
    }

    /// Probabilities from the log-likelihoods; false when they cannot be normalised.
    fn weigh(&mut self) -> bool {
        for (share, hypothesis) in self.shares.iter_mut().zip(&self.hypotheses) {
            *share = hypothesis.log_likelihood;
        }
        let is_sound = to_shares(&mut self.shares);
        for (share, hypothesis) in self.shares.iter().zip(&mut self.hypotheses) {
            hypothesis.probability = *share;
        }
        is_sound
    }

    fn most_probable(&self) -> &Hypothesis {
        &self.hypotheses[likeliest(0, self.shares.iter().copied())]
    }

    /// Mean and spread of the coefficient over the hypotheses that `counts` admits.
    fn mixture(&self, counts: impl Fn(&Law) -> bool) -> Option<(Uncertain, f64)> {
        let mut mixture = Mixture::<1>::default();
        for hypothesis in self.hypotheses.iter().filter(|h| counts(&h.model.law)) {
            let own = hypothesis.model.estimate(&hypothesis.state, self.demand).coefficient;
            let (mean, variance) = (Vector1::new(own.value), Vector1::new(own.std * own.std));
            mixture.add(hypothesis.probability, &mean, &variance);
        }
        let coefficient = Uncertain::new(mixture.belief.mean[0], mixture.belief.std(0));
        (mixture.weight > 0.0).then_some((coefficient, mixture.weight))
    }
}

/// A belief whose scale is no longer known.
fn reopen(state: &Gaussian<STATES>, scale: Uncertain) -> Gaussian<STATES> {
    let mut opened = *state;
    opened.replace(DRIFT, 0.0, 0.0);
    opened.replace(SCALE, scale.value, scale.std * scale.std);
    opened
}

impl Engine for LawBank {
    fn start(&mut self, first: &Observation) {
        let probability = 1.0 / self.hypotheses.len() as f64;
        for hypothesis in &mut self.hypotheses {
            hypothesis.state = hypothesis.model.initial(first);
            hypothesis.probability = probability;
        }
        self.demand = first.demand;
        self.is_started = true;
    }

    fn step(&mut self, inputs: &StepInputs, observed: &Observation) -> Result<Step, EngineError> {
        if !self.is_started {
            self.start(observed);
            return Ok(Step::Restarted);
        }
        self.mix(inputs.step_s);
        for hypothesis in &mut self.hypotheses {
            let model = &hypothesis.model;
            let mut state = hypothesis.mixed;
            model.advance(inputs, &mut state);
            let (log_likelihood, normalised) = measure(model, &mut state, observed)?;
            hypothesis.state = state;
            hypothesis.log_likelihood += log_likelihood;
            hypothesis.normalised = normalised;
        }
        self.demand = observed.demand;
        if !self.weigh() {
            return Err(EngineError::NotFinite { value: f64::NAN });
        }
        let normalised = self.most_probable().normalised;
        Ok(Step::Updated { normalised_innovation: Some(normalised) })
    }

    fn estimate(&self) -> Option<Estimate> {
        if !self.is_started {
            return None;
        }
        let is_demand = |law: &Law| *law == Law::Demand;
        let has_demand = self.hypotheses.iter().any(|h| is_demand(&h.model.law));
        let limited = self.mixture(is_demand).map_or(0.0, |(_, weight)| weight);
        let best = self
            .hypotheses
            .iter()
            .filter(|h| is_demand(&h.model.law) == (limited > 0.5))
            .max_by(|one, other| one.probability.total_cmp(&other.probability))?;
        let own = best.model.estimate(&best.state, self.demand);
        let (mixed, weight) = self.mixture(|law| is_demand(law) == (limited > 0.5))?;
        let coefficient = if best.probability > CLEAR * weight { own.coefficient } else { mixed };
        Some(Estimate { coefficient, brake_limited: has_demand.then_some(limited), ..own })
    }
}
