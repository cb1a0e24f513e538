//! The noise of the rows, learned jointly with the parameters.
//!
//! A residual is partly noise of the speed and partly a slow force that the model does not know (wind, errors of the
//! gradient profile). The proportion decides both the weights of the rows and the accuracy of the estimate. A small
//! bank of noise models runs side by side, and their solutions are mixed by their likelihood.

use dynocar_core::filter::Gaussian;
use dynocar_core::filter::bank::{Bank, Mixture};
use dynocar_core::pipeline::momentum::{Disturbance, PARAMETERS, SinceBlock, gap_s};

use super::regression::{
    AffineMotion, PRIOR_ROWS, RegressionNoise, RegressionObservation, RegressionSolution, Unknowns,
    WhiteRow,
};

/// Standard deviations of the disturbance in N/kN: from nothing to as large as resistance itself.
const STDS_N_PER_KN: [f64; 6] = [0.01, 0.03, 0.1, 0.3, 1.0, 3.0];
/// Correlation times in s: a gust, a gradient section, a change of wind or weather.
const TIMES_S: [f64; 3] = [10.0, 60.0, 400.0];
const MODELS: usize = 1 + STDS_N_PER_KN.len() * TIMES_S.len();
/// Model that counts as likeliest until the rows show another: a disturbance of 0.1 N/kN over 60 s.
const LIKELIEST_AT_FIRST: usize = 1 + 2 * TIMES_S.len() + 1;
/// Rows after which the part of the penalty that forgetting has removed is added again.
const RENEWAL_ROWS: u32 = 50;
/// Prior probability that there is no disturbance; the other models share the rest.
const UNDISTURBED_PRIOR: f64 = 0.95;
/// Probability of the set of models that widen the intervals of a filter in parallel with the bank.
const CREDIBLE: f64 = 0.99;
/// Models of less weight than this are left out of the mixture.
const WEIGHT_MIN: f64 = 1e-4;

/// The slow force that the model does not know.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disturbed {
    /// Its standard deviation in N/kN.
    pub std_n_per_kn: f64,
    /// Twice the log-likelihood ratio against there being none.
    pub evidence: f64,
}

/// The likeliest noise model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LikeliestNoise {
    /// Its index in the bank.
    pub index: usize,
    /// Its disturbance, scaled as the rows say.
    pub disturbance: Disturbance,
    /// Variance of its rows: 1 when all is as modelled.
    pub scale: f64,
}

/// Noise models side by side; the first has no disturbance.
#[derive(Clone, Debug, PartialEq)]
pub struct NoiseBank {
    models: Bank<RegressionNoise, MODELS>,
    /// Their probabilities.
    shares: [f64; MODELS],
    /// Solutions of those that matter, after the newest row.
    solutions: [Option<RegressionSolution>; MODELS],
    penalty: Unknowns,
    forgetting: f64,
    rows_since_renewal: u32,
    last_time_ns: Option<i64>,
    /// The mixture of all models; `None` while the rows do not determine the parameters.
    pub mixture: Option<RegressionSolution>,
}

impl NoiseBank {
    /// Returns a bank without rows, every model with the penalty `sum of weight * unknown^2`.
    pub fn new(penalty: &Unknowns, forgetting: f64) -> Self {
        let disturbance = |index: usize| match index.checked_sub(1) {
            None => Disturbance { std_n_per_kn: 0.0, time_s: TIMES_S[0] },
            Some(index) => Disturbance {
                std_n_per_kn: STDS_N_PER_KN[index / TIMES_S.len()],
                time_s: TIMES_S[index % TIMES_S.len()],
            },
        };
        let of_index = |index| RegressionNoise::new(disturbance(index), penalty);
        let mut models = Bank::even((0..MODELS).map(of_index), 0.0);
        models.believe(LIKELIEST_AT_FIRST);
        NoiseBank {
            models,
            shares: [0.0; MODELS],
            solutions: [None; MODELS],
            penalty: *penalty,
            forgetting,
            rows_since_renewal: 0,
            last_time_ns: None,
            mixture: None,
        }
    }

    /// Adds knowledge of the unknowns from another source to every model, as a row of unit variance.
    pub fn know(&mut self, features: &Unknowns, observed: f64) {
        for model in self.models.hypotheses_mut() {
            model.information.add_knowledge(features, observed);
        }
        self.solutions = [None; MODELS];
    }

    /// Forgets all rows.
    pub fn clear(&mut self) {
        *self = NoiseBank::new(&self.penalty, self.forgetting);
    }

    /// Moves every model to an observation; gives the likeliest model's row, not yet taken in.
    /// `None` for the first block of a chain, which makes no row.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn predict(&mut self, observation: &RegressionObservation) -> Option<WhiteRow> {
        let gap_s = gap_s(&mut self.last_time_ns, observation.time_ns());
        for model in self.models.hypotheses_mut() {
            match observation.is_first() {
                true => model.restart(observation, gap_s),
                false => model.propagate(observation),
            }
        }
        match observation {
            RegressionObservation::Block(block) if block.is_first => None,
            _ => self.models.likeliest().row(observation),
        }
    }

    /// Takes the predicted observation into every model; true when another one is the likeliest
    /// now.
    ///
    /// # Real-time
    ///
    /// One small factorisation for each model of weight, no allocation.
    pub fn accept(&mut self, observation: &RegressionObservation) -> bool {
        let seen = observation.sighting();
        for model in self.models.hypotheses_mut() {
            model.accept(&seen, self.forgetting);
        }
        self.renew_penalty();
        let before = self.models.likeliest_index();
        self.weigh();
        let likeliest = self.models.likeliest_index();
        for (index, model) in self.models.hypotheses().iter().enumerate() {
            let matters = self.shares[index] > WEIGHT_MIN || index == likeliest;
            self.solutions[index] = if matters { model.solution() } else { None };
        }
        self.mixture = self.mix(1.0, self.student_factor());
        before != likeliest
    }

    /// Goes on without the predicted observation: as the start of a new chain for a block,
    /// whose momentum may have truly changed.
    pub fn refuse(&mut self, observation: &RegressionObservation) {
        if matches!(observation, RegressionObservation::Block(_)) {
            for model in self.models.hypotheses_mut() {
                model.restart(observation, Some(0.0));
            }
        }
    }

    /// Lets the disturbance have jumped, by so much in N/kN.
    pub fn loosen(&mut self, std_n_per_kn: f64) {
        for model in self.models.hypotheses_mut() {
            model.loosen(std_n_per_kn);
        }
    }

    /// Returns the rows taken in, the forgotten ones in part.
    pub fn count(&self) -> f64 {
        self.undisturbed().count()
    }

    /// Returns the likeliest model's own solution; `None` while the rows do not determine it.
    pub fn likeliest_solution(&self) -> Option<RegressionSolution> {
        let cached = self.solutions[self.models.likeliest_index()];
        cached.or_else(|| self.models.likeliest().solution())
    }

    /// Returns the speed and disturbance by the likeliest model, so long after the newest block.
    pub fn likeliest_motion(&self, since: &SinceBlock) -> AffineMotion {
        self.models.likeliest().motion(since)
    }

    /// Returns the likeliest noise model.
    pub fn likeliest_noise(&self) -> LikeliestNoise {
        let model = self.models.likeliest();
        let scale = model.scale();
        let Disturbance { std_n_per_kn, time_s } = model.disturbance;
        let disturbance = Disturbance { std_n_per_kn: std_n_per_kn * scale.sqrt(), time_s };
        LikeliestNoise { index: self.models.likeliest_index(), disturbance, scale }
    }

    /// Returns the disturbance now, in N/kN for given unknowns, with its standard deviation.
    pub fn disturbance(&self, unknowns: &Unknowns) -> (f64, f64) {
        self.models.likeliest().disturbance_now(unknowns)
    }

    /// Returns a solution from the likeliest model's rows, its covariance of a, b, c widened as the
    /// mixture's is against that model's: the disturbance is itself uncertain. `None` while there
    /// is no mixture.
    ///
    /// Models of the last hundredth of the probability are left out: an interval of 95 % that
    /// reached for them too would be too wide in the other 99 cases of 100. Nor is it widened
    /// for the rows' scale, since the filter takes the noise of its speeds from the scatter of
    /// all samples, which are many times as many as the rows.
    pub fn widened(&self, solution: &RegressionSolution) -> Option<RegressionSolution> {
        let davis = |solution: &RegressionSolution| {
            solution.covariance.fixed_view::<PARAMETERS, PARAMETERS>(0, 0).into_owned()
        };
        let mixed = davis(&self.mix(CREDIBLE, 1.0)?).cholesky()?.unpack();
        let own = davis(&self.likeliest_solution()?).cholesky()?.unpack();
        let root = davis(solution).cholesky()?.unpack();
        // With roots S of the covariances: S_solution S_own^-1 S_mixed.
        let wide = root * own.solve_lower_triangular(&mixed)?;
        let mut covariance = solution.covariance;
        covariance
            .fixed_view_mut::<PARAMETERS, PARAMETERS>(0, 0)
            .copy_from(&(wide * wide.transpose()));
        Some(RegressionSolution { estimate: solution.estimate, covariance })
    }

    /// Returns the slow force that the model does not know, over all models.
    pub fn disturbed(&self) -> Disturbed {
        if self.mixture.is_none() {
            return Disturbed { std_n_per_kn: 0.0, evidence: 0.0 };
        }
        let weighty = self.models.hypotheses().iter().zip(self.shares);
        let variance: f64 = weighty
            .filter(|(_, share)| *share > WEIGHT_MIN)
            .map(|(model, share)| share * model.scale() * model.disturbance.std_n_per_kn.powi(2))
            .sum();
        let gain = self.models.likeliest().log_likelihood() - self.undisturbed().log_likelihood();
        Disturbed { std_n_per_kn: variance.sqrt(), evidence: 2.0 * gain }
    }

    /// Returns the mixture of the likeliest models that together have so much of the probability, each
    /// covariance times a factor.
    fn mix(&self, probability: f64, factor: f64) -> Option<RegressionSolution> {
        let mut order: [usize; MODELS] = std::array::from_fn(|index| index);
        order.sort_unstable_by(|&i, &j| self.shares[j].total_cmp(&self.shares[i]));
        let mut mixture = Mixture::default();
        for index in order {
            let weight = self.shares[index];
            if mixture.weight >= probability || weight <= WEIGHT_MIN {
                break;
            }
            let own = self.solutions[index].as_ref()?;
            mixture.add(weight, &own.estimate, &(own.covariance * factor));
        }
        let Gaussian { mean: estimate, covariance } = mixture.belief;
        (mixture.weight > 0.0).then_some(RegressionSolution { estimate, covariance })
    }

    fn weigh(&mut self) {
        if self.undisturbed().freedom() < 1.0 {
            return;
        }
        for (index, (model, weight)) in self.models.weighed_mut().enumerate() {
            *weight = model.log_likelihood() + log_prior(index);
        }
        self.models.settle();
        self.shares = self.models.shares(|_| true);
    }

    fn undisturbed(&self) -> &RegressionNoise {
        &self.models.hypotheses()[0]
    }

    /// Adds, from time to time, the part of the priors that forgetting has removed.
    fn renew_penalty(&mut self) {
        self.rows_since_renewal += 1;
        if self.forgetting < 1.0 && self.rows_since_renewal == RENEWAL_ROWS {
            self.rows_since_renewal = 0;
            let weights = self.penalty * (1.0 - self.forgetting.powi(RENEWAL_ROWS as i32));
            for model in self.models.hypotheses_mut() {
                model.information.add_penalty(&weights);
            }
        }
    }

    /// Widens a variance so that 1.96 standard deviations hold 95 % although the variance itself
    /// is estimated with few degrees of freedom (Student's t).
    fn student_factor(&self) -> f64 {
        let freedom = self.undisturbed().freedom() + PRIOR_ROWS;
        1.0 + 2.5 / (freedom - 1.2).max(0.8)
    }
}

/// Returns the logarithm of a model's probability before any row.
fn log_prior(index: usize) -> f64 {
    match index {
        0 => UNDISTURBED_PRIOR.ln(),
        _ => ((1.0 - UNDISTURBED_PRIOR) / (MODELS - 1) as f64).ln(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_runs::normal;
    use super::*;
    use dynocar_core::pipeline::momentum::{MomentumBlock, MomentumColumns};
    use rand::{RngExt, SeedableRng};

    /// Blocks of 5 s with a disturbance and white noise; w0 = 2 + 0.5 (v/20) + 1 (v/20)².
    fn blocks(count: usize, disturbance: Disturbance, noise: f64) -> Vec<RegressionObservation> {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(6);
        let kept = (-5.0 / disturbance.time_s).exp();
        let (mut momentum, mut force) = (500.0, disturbance.std_n_per_kn * normal(&mut random));
        (0..count)
            .map(|index| {
                let v = 0.2 + random.random::<f64>();
                let mut impulse = MomentumColumns::zeros();
                (impulse[1], impulse[2], impulse[3]) = (5.0, 5.0 * v, 5.0 * v * v);
                momentum -= impulse[1] * (2.0 + force) + 0.5 * impulse[2] + impulse[3];
                force = kept * force
                    + disturbance.std_n_per_kn * (1.0 - kept * kept).sqrt() * normal(&mut random);
                RegressionObservation::Block(MomentumBlock {
                    is_first: index == 0,
                    momentum: momentum + noise * normal(&mut random),
                    momentum_variance: noise * noise,
                    impulse,
                    impulse_variance: 0.0,
                    time_ns: 5_000_000_000 * index as i64,
                    speed_mps: 20.0 * v,
                })
            })
            .collect()
    }

    fn after(blocks: &[RegressionObservation]) -> NoiseBank {
        let mut bank = NoiseBank::new(&Unknowns::repeat(1e-3), 1.0);
        for block in blocks {
            if bank.predict(block).is_some() {
                bank.accept(block);
            }
        }
        bank
    }

    #[test]
    fn the_bank_recognises_the_disturbance_that_made_its_rows() {
        let disturbance = Disturbance { std_n_per_kn: 0.3, time_s: 60.0 };
        let bank = after(&blocks(1500, disturbance, 0.3));
        let found = bank.likeliest_noise().disturbance;
        assert_eq!(found.time_s, 60.0);
        assert!((found.std_n_per_kn / 0.3 - 1.0).abs() < 0.2);
        assert!(bank.disturbed().evidence > 100.0);
        assert!((bank.likeliest_noise().scale - 1.0).abs() < 0.2);
    }

    #[test]
    fn rows_of_white_noise_alone_give_no_evidence_of_a_disturbance() {
        let none = Disturbance { std_n_per_kn: 0.0, time_s: 10.0 };
        let bank = after(&blocks(800, none, 0.4));
        assert!(bank.disturbed().evidence < 4.0);
        assert!(bank.disturbed().std_n_per_kn < 0.05);
        let mixture = bank.mixture.unwrap();
        let truth = [2.0, 0.5, 1.0];
        for (i, value) in truth.iter().enumerate() {
            let std = mixture.covariance[(i, i)].sqrt();
            assert!((mixture.estimate[i] - value).abs() < 3.5 * std);
        }
    }

    #[test]
    fn a_refused_block_leaves_no_trace_in_the_rows() {
        let none = Disturbance { std_n_per_kn: 0.0, time_s: 10.0 };
        let mut blocks = blocks(300, none, 0.4);
        let RegressionObservation::Block(bad) = &mut blocks[150] else { panic!("blocks only") };
        bad.momentum += 1000.0;
        let mut bank = NoiseBank::new(&Unknowns::repeat(1e-3), 1.0);
        for (index, block) in blocks.iter().enumerate() {
            let row = bank.predict(block);
            match index {
                0 => assert!(row.is_none()),
                // The spike itself, and the step back from it.
                150 | 151 => bank.refuse(block),
                _ => drop(bank.accept(block)),
            }
        }
        let mixture = bank.mixture.unwrap();
        assert!((mixture.estimate[0] - 2.0).abs() < 4.0 * mixture.covariance[(0, 0)].sqrt());
        assert_eq!(bank.count(), 297.0);
    }
}
