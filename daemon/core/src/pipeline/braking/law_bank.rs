//! Several known laws at once, each with a scale of its own and weighted by evidence.
//!
//! An interacting multiple-model filter (Blom and Bar-Shalom 1988). Every hypothesis is a law with its own scale; one
//! hypothesis may be that the brake, not the rail, limits the force ([`BrakingLaw::Demand`]). A change of hypothesis
//! keeps distance and speed but starts the scale anew, since the rail behind a tunnel portal says nothing of the rail
//! inside.

use dynocar_shared::Uncertain;
use nalgebra::Vector1;

use super::engine::{BrakingEstimate, BrakingObservation, Engine, EngineStep};
use super::law::BrakingLaw;
use super::motion::{DRIFT, SCALE, SPEED, STATES, StepInputs};
use super::tracker::{TrackerModel, measure};
use crate::filter::Gaussian;
use crate::filter::bank::{Bank, Mixture};

/// Share of the probability at which one law is reported alone; below it the laws are mixed, and their spread is part
/// of the error.
const CLEAR: f64 = 0.9;

/// Number of laws: a dry rail, a wet one, and the brake itself.
pub const LAWS: usize = 3;

/// One law with its belief.
#[derive(Clone, Debug)]
struct Hypothesis {
    model: TrackerModel,
    state: Gaussian<STATES>,
    /// Mixture by the possible changes of hypothesis: scratch memory of a step.
    mixed: Gaussian<STATES>,
    normalised: f64,
}

/// Laws weighed by evidence.
#[derive(Clone, Debug)]
pub struct LawBank {
    laws: Bank<Hypothesis, LAWS>,
    /// Their probabilities.
    shares: [f64; LAWS],
    /// Rate in 1/s at which one hypothesis gives way to another.
    change_rate_per_s: f64,
    demand: f64,
    is_started: bool,
}

impl LawBank {
    /// A bank of hypotheses, all equally probable at first.
    pub fn new(models: [TrackerModel; LAWS], change_rate_per_s: f64) -> Self {
        let empty = Mixture::<STATES>::default().belief;
        let hypothesis = |model| Hypothesis { model, state: empty, mixed: empty, normalised: 0.0 };
        let laws = Bank::even(models.map(hypothesis), 0.0);
        let shares = [0.0; LAWS];
        LawBank { laws, shares, change_rate_per_s, demand: 0.0, is_started: false }
    }

    /// Mixes the beliefs by the possible changes of hypothesis, into `mixed`; gives the logarithm of each hypothesis's
    /// weight before its likelihood.
    fn mix(&mut self, step_s: f64) -> [f64; LAWS] {
        let mut weights = [0.0; LAWS];
        // Probability of a change within the step to one certain other law.
        let switch = (self.change_rate_per_s * step_s).min(0.5) / (LAWS - 1) as f64;
        let stay = 1.0 - switch * (LAWS - 1) as f64;
        for to in 0..LAWS {
            let target = &self.laws.hypotheses()[to];
            let prior = target.model.prior_scale(target.state.mean[SPEED], self.demand);
            let mut mixture = Mixture::default();
            for (from, (law, share)) in self.laws.hypotheses().iter().zip(self.shares).enumerate() {
                let (state, kept) = match from == to {
                    true => (law.state, stay),
                    false => (reopen(&law.state, prior), switch),
                };
                mixture.add(share * kept, &state.mean, &state.covariance);
            }
            self.laws.hypotheses_mut()[to].mixed = mixture.belief;
            weights[to] = mixture.weight.max(f64::MIN_POSITIVE).ln();
        }
        weights
    }

    /// Returns the mean and spread of the coefficient over the hypotheses that `counts` admits.
    fn mixture(&self, counts: impl Fn(&BrakingLaw) -> bool) -> Option<(Uncertain, f64)> {
        let mut mixture = Mixture::<1>::default();
        for (law, share) in self.laws.hypotheses().iter().zip(self.shares) {
            if counts(&law.model.law) {
                let own = law.model.estimate(&law.state, self.demand).coefficient;
                let (mean, variance) = (Vector1::new(own.value), Vector1::new(own.std * own.std));
                mixture.add(share, &mean, &variance);
            }
        }
        let coefficient = Uncertain::new(mixture.belief.mean[0], mixture.belief.std(0));
        (mixture.weight > 0.0).then_some((coefficient, mixture.weight))
    }
}

/// Returns a belief whose scale is no longer known.
fn reopen(state: &Gaussian<STATES>, scale: Uncertain) -> Gaussian<STATES> {
    let mut opened = *state;
    opened.replace(DRIFT, 0.0, 0.0);
    opened.replace(SCALE, scale.value, scale.std * scale.std);
    opened
}

impl Engine for LawBank {
    fn start(&mut self, first: &BrakingObservation) {
        for (law, weight) in self.laws.weighed_mut() {
            law.state = law.model.initial(first);
            *weight = 0.0;
        }
        self.shares = self.laws.shares(|_| true);
        self.demand = first.demand;
        self.is_started = true;
    }

    fn step(&mut self, inputs: &StepInputs, observed: &BrakingObservation) -> Option<EngineStep> {
        if !self.is_started {
            self.start(observed);
            return Some(EngineStep::Restarted);
        }
        let priors = self.mix(inputs.step_s);
        for ((law, weight), prior) in self.laws.weighed_mut().zip(priors) {
            let Hypothesis { model, state, mixed, normalised } = law;
            let mut next = *mixed;
            model.advance(inputs, &mut next);
            let (log_likelihood, innovation) = measure(model, &mut next, observed).ok()?;
            (*state, *normalised) = (next, innovation);
            *weight = prior + log_likelihood;
        }
        self.demand = observed.demand;
        if !self.laws.settle() {
            return None;
        }
        self.shares = self.laws.shares(|_| true);
        let normalised = self.laws.likeliest().normalised;
        Some(EngineStep::Updated { normalised_innovation: Some(normalised) })
    }

    fn set_distance_variance(&mut self, variance_m2: f64) {
        for law in self.laws.hypotheses_mut() {
            law.model.noise.measured_distance_m2 = variance_m2;
        }
    }

    fn estimate(&self) -> Option<BrakingEstimate> {
        if !self.is_started {
            return None;
        }
        let is_demand = |law: &BrakingLaw| *law == BrakingLaw::Demand;
        let limited = self.mixture(is_demand).map_or(0.0, |(_, weight)| weight);
        let (best, share) = self
            .laws
            .hypotheses()
            .iter()
            .zip(self.shares)
            .filter(|(h, _)| is_demand(&h.model.law) == (limited > 0.5))
            .max_by(|(_, one), (_, other)| one.total_cmp(other))?;
        let own = best.model.estimate(&best.state, self.demand);
        let (mixed, weight) = self.mixture(|law| is_demand(law) == (limited > 0.5))?;
        let coefficient = if share > CLEAR * weight { own.coefficient } else { mixed };
        Some(BrakingEstimate { coefficient, brake_limited: Some(limited), ..own })
    }
}
