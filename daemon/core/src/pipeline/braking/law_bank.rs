//! Laws of the coefficient that slows the train over speed, and several of them at once, each scaled, weighed by evidence.
//!
//! An interacting multiple-model filter (Blom and Bar-Shalom 1988). Every hypothesis is a law
//! with its own scale; one of them may be that the brake, not the rail, is the smaller one
//! ([`BrakingLaw::Demand`]). A change of hypothesis keeps distance and speed and opens the scale anew,
//! since the rail behind the tunnel portal says nothing of the rail inside.

use dynocar_shared::{RailCondition, Uncertain};
use nalgebra::Vector1;

use super::engine::{BrakingEstimate, BrakingObservation, Engine, EngineStep};
use super::motion::{DRIFT, SCALE, SPEED, STATES, StepInputs};
use super::tracker::{TrackerModel, measure};
use crate::filter::Gaussian;
use crate::filter::bank::{Bank, Mixture};

/// Share of the probability at which one law stands alone; else the laws are mixed, and their
/// spread is part of the error.
const CLEAR: f64 = 0.9;

/// Number of laws: a dry rail, a wet one, and the brake itself.
pub const LAWS: usize = 3;

/// One law with its belief.
#[derive(Clone, Debug)]
struct Hypothesis {
    model: TrackerModel,
    state: Gaussian<STATES>,
    /// Mixture by the possible changes of hypothesis: scratch of a step.
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

    /// Mixes the beliefs as the possible changes of hypothesis ask, into `mixed`; gives what
    /// each hypothesis weighs before its likelihood, in nats.
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

    /// Mean and spread of the coefficient over the hypotheses that `counts` admits.
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

/// A belief whose scale is no longer known.
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

/// Why a table of a coefficient over speed is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SpeedTableError {
    /// There are fewer than two points.
    #[error("expected at least two points, got {count}")]
    TooFewPoints {
        /// Number of points.
        count: usize,
    },
    /// A point is not finite, not positive, or not faster than the one before it.
    #[error(
        "point {index}: expected a rising speed and a coefficient above 0, got {speed_mps} m/s, {coefficient}"
    )]
    BadPoint {
        /// Number of the point, from 1.
        index: usize,
        /// Its speed in m/s.
        speed_mps: f64,
        /// Its coefficient.
        coefficient: f64,
    },
}

/// A piecewise linear coefficient over speed, held constant beyond its ends.
#[derive(Clone, Debug, PartialEq)]
pub struct SpeedTable {
    points: Vec<(f64, f64)>,
}

impl SpeedTable {
    /// A table through (speed in m/s, coefficient) points of rising speed.
    ///
    /// # Errors
    ///
    /// See [`SpeedTableError`].
    pub fn new(points: Vec<(f64, f64)>) -> Result<Self, SpeedTableError> {
        if points.len() < 2 {
            return Err(SpeedTableError::TooFewPoints { count: points.len() });
        }
        for (i, &(speed_mps, coefficient)) in points.iter().enumerate() {
            let is_rising = i == 0 || points[i - 1].0 < speed_mps;
            let is_valid = speed_mps.is_finite() && coefficient.is_finite() && coefficient > 0.0;
            if !(is_rising && is_valid) {
                return Err(SpeedTableError::BadPoint { index: i + 1, speed_mps, coefficient });
            }
        }
        Ok(SpeedTable { points })
    }

    /// Coefficient at a speed in m/s and its derivative in s/m.
    fn at(&self, speed_mps: f64) -> (f64, f64) {
        let after = self.points.partition_point(|point| point.0 <= speed_mps);
        let (Some(low), Some(high)) =
            (after.checked_sub(1).map(|i| self.points[i]), self.points.get(after))
        else {
            let end = if after == 0 { self.points[0] } else { self.points[after - 1] };
            return (end.1, 0.0);
        };
        let slope = (high.1 - low.1) / (high.0 - low.0);
        (low.1 + slope * (speed_mps - low.0), slope)
    }
}

/// The known shape of a coefficient; the estimated scale multiplies it.
#[derive(Clone, Debug, PartialEq)]
pub enum BrakingLaw {
    /// The same at all speeds: the scale is the coefficient itself.
    Constant,
    /// The demand of the brake: the scale is the achieved share of it.
    Demand,
    /// An adhesion law of Xie 2019, section 3.1.
    Rail(RailCondition),
    /// A declared curve over speed.
    Table(SpeedTable),
}

impl BrakingLaw {
    /// The law's coefficient at a speed in m/s, and its derivative by speed in s/m.
    pub fn at(&self, speed_mps: f64, demand: f64) -> (f64, f64) {
        match self {
            BrakingLaw::Constant => (1.0, 0.0),
            BrakingLaw::Demand => (demand, 0.0),
            BrakingLaw::Rail(condition) => {
                (condition.adhesion(speed_mps), condition.adhesion_slope_s_per_m(speed_mps))
            }
            BrakingLaw::Table(table) => table.at(speed_mps),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_linear_between_its_points_and_constant_beyond() {
        let law = BrakingLaw::Table(SpeedTable::new(vec![(10.0, 0.3), (20.0, 0.2)]).unwrap());
        let (value, slope) = law.at(15.0, f64::NAN);
        assert!((value - 0.25).abs() < 1e-15 && (slope + 0.01).abs() < 1e-15);
        assert_eq!(law.at(5.0, 0.0), (0.3, 0.0));
        assert_eq!(law.at(50.0, 0.0), (0.2, 0.0));
    }

    #[test]
    fn a_bad_table_is_refused_with_its_point() {
        assert_eq!(
            SpeedTable::new(vec![(0.0, 0.3)]),
            Err(SpeedTableError::TooFewPoints { count: 1 })
        );
        for bad in [(0.0, 0.3), (1.0, 0.0), (1.0, f64::NAN)] {
            let refused = SpeedTable::new(vec![(0.0, 0.3), bad]);
            assert!(matches!(refused, Err(SpeedTableError::BadPoint { index: 2, .. })));
        }
    }
}
