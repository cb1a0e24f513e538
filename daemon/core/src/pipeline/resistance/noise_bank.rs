//! The noise of the rows, learned beside the parameters.
//!
//! How much of a residual is noise of the speed and how much a slow force that the model does
//! not know (wind, errors of the gradient profile) decides both the weights of the rows and what
//! the estimate is worth. A small bank of disturbance models runs side by side; each keeps the
//! generalised least squares of its rows and its restricted likelihood (Patterson and Thompson
//! 1971), and their mixture is weighted by it.

use nalgebra::SMatrix;

use super::regression::{
    Disturbance, Observation, PARAMETERS, RowWhitener, UNKNOWNS, Unknowns, disturbance_of,
    loosen_disturbance,
};
use super::solver::Solution;
use crate::filter::SquareRootInformation;

/// Standard deviations of the disturbance in N/kN: from nothing to as large as resistance itself.
const STDS_N_PER_KN: [f64; 6] = [0.01, 0.03, 0.1, 0.3, 1.0, 3.0];
/// Correlation times in s: a gust, a gradient section, a change of wind or weather.
const TIMES_S: [f64; 3] = [10.0, 60.0, 400.0];
const MEMBERS: usize = 1 + STDS_N_PER_KN.len() * TIMES_S.len();
/// Until the rows tell: a disturbance of 0.1 N/kN over 60 s.
const LIKELIEST_AT_FIRST: usize = 1 + 2 * TIMES_S.len() + 1;
/// Rows for which the noise model as declared counts beside the rows seen.
const PRIOR_ROWS: f64 = 3.0;
/// Rows after which the penalty, which forgetting takes off too, is made up for.
const RENEWAL_ROWS: u32 = 50;
/// Members of less weight than this are left out of the mixture.
const WEIGHT_MIN: f64 = 1e-4;

#[derive(Clone, Debug, PartialEq)]
struct Member {
    disturbance: Disturbance,
    whitener: RowWhitener,
    information: SquareRootInformation<UNKNOWNS>,
    log_variances: f64,
    weight: f64,
}

/// A row of the likeliest member, its error of variance 1 as far as the scale is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WhiteRow {
    /// Regressors.
    pub features: Unknowns,
    /// What they should add up to.
    pub observed: f64,
}

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
    /// Its place in the bank.
    pub member: usize,
    /// Its disturbance, scaled as the rows say.
    pub disturbance: Disturbance,
    /// Variance of its rows: 1 when all is as modelled.
    pub scale: f64,
}

/// Disturbance models side by side.
#[derive(Clone, Debug, PartialEq)]
pub struct NoiseBank {
    members: [Member; MEMBERS],
    penalty: Unknowns,
    forgetting: f64,
    likeliest: usize,
    rows_since_renewal: u32,
    last_time_ns: Option<i64>,
    mixture: Option<Solution>,
}

impl NoiseBank {
    /// A bank without rows, every member with the penalty `sum of weight * unknown^2`.
    pub fn new(penalty: &Unknowns, forgetting: f64) -> Self {
        let member = |index: usize| Member {
            disturbance: match index.checked_sub(1) {
                None => Disturbance { std_n_per_kn: 0.0, time_s: TIMES_S[0] },
                Some(place) => Disturbance {
                    std_n_per_kn: STDS_N_PER_KN[place / TIMES_S.len()],
                    time_s: TIMES_S[place % TIMES_S.len()],
                },
            },
            whitener: RowWhitener::new(nalgebra::zero(), nalgebra::zero()),
            information: SquareRootInformation::new(penalty, &Unknowns::zeros()),
            log_variances: 0.0,
            weight: 0.0,
        };
        NoiseBank {
            members: std::array::from_fn(member),
            penalty: *penalty,
            forgetting,
            likeliest: LIKELIEST_AT_FIRST,
            rows_since_renewal: 0,
            last_time_ns: None,
            mixture: None,
        }
    }

    /// Forgets all rows.
    pub fn clear(&mut self) {
        *self = NoiseBank::new(&self.penalty, self.forgetting);
    }

    /// Moves every member to an observation; gives the row, not yet taken in. `None` for the
    /// first block of a chain, which makes no row.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn predict(&mut self, observation: &Observation) -> Option<WhiteRow> {
        let gap_s = self
            .last_time_ns
            .replace(observation.time_ns())
            .map(|last_ns| observation.time_ns().saturating_sub(last_ns) as f64 * 1e-9)
            .filter(|&gap_s| gap_s > 0.0);
        if observation.is_first() {
            self.restart(observation, gap_s);
            if matches!(observation, Observation::Block(_)) {
                return None;
            }
        } else {
            for member in &mut self.members {
                member.whitener.propagate(&observation.propagation(&member.disturbance));
            }
        }
        let likeliest = &self.members[self.likeliest];
        let (row, _) = likeliest.row(observation)?;
        let root = likeliest.scale().sqrt();
        Some(WhiteRow { features: row.features / root, observed: row.observed / root })
    }

    /// Takes the predicted observation into every member; true when another member is the
    /// likeliest now.
    pub fn accept(&mut self, observation: &Observation) -> bool {
        self.rows_since_renewal += 1;
        let renewal = (self.forgetting < 1.0 && self.rows_since_renewal == RENEWAL_ROWS)
            .then(|| self.penalty * (1.0 - self.forgetting.powi(RENEWAL_ROWS as i32)));
        if renewal.is_some() {
            self.rows_since_renewal = 0;
        }
        for member in &mut self.members {
            member.accept(observation, self.forgetting);
            if let Some(weights) = &renewal {
                member.information.add_penalty(weights);
            }
        }
        let before = self.likeliest;
        self.weigh();
        self.mixture = self.mix();
        before != self.likeliest
    }

    /// The likeliest member's own solution; `None` while the rows do not determine it.
    pub fn likeliest_solution(&self) -> Option<Solution> {
        let (estimate, covariance) = self.members[self.likeliest].solution()?;
        Some(Solution { estimate, covariance })
    }

    /// Goes on without the predicted observation: as the start of a new chain for a block,
    /// whose momentum may have truly changed.
    pub fn refuse(&mut self, observation: &Observation) {
        if matches!(observation, Observation::Block(_)) {
            self.restart(observation, Some(0.0));
        }
    }

    /// Lets the disturbance have jumped, by so much in N/kN.
    pub fn loosen(&mut self, std_n_per_kn: f64) {
        for member in &mut self.members {
            let root = member.scale().sqrt();
            loosen_disturbance(&mut member.whitener, std_n_per_kn / root);
        }
    }

    fn restart(&mut self, observation: &Observation, gap_s: Option<f64>) {
        for member in &mut self.members {
            member.whitener.propagate(&observation.restart(&member.disturbance, gap_s));
        }
    }

    /// Rows taken in, the forgotten ones in part.
    pub fn count(&self) -> f64 {
        self.members[0].information.count()
    }

    /// The likeliest noise model.
    pub fn likeliest_noise(&self) -> LikeliestNoise {
        let member = &self.members[self.likeliest];
        let scale = member.scale();
        let std_n_per_kn = member.disturbance.std_n_per_kn * scale.sqrt();
        LikeliestNoise {
            member: self.likeliest,
            disturbance: Disturbance { std_n_per_kn, time_s: member.disturbance.time_s },
            scale,
        }
    }

    /// What widens the covariance of an estimate from the likeliest member's rows, for the noise
    /// is itself estimated: the mean ratio of the mixture's variances of a, b, c to that
    /// member's. `None` while there is no mixture.
    pub fn interval_factor(&self) -> Option<f64> {
        let davis = |solution: &Solution| {
            solution.covariance.fixed_view::<PARAMETERS, PARAMETERS>(0, 0).into_owned()
        };
        let mixed = davis(self.mixture.as_ref()?);
        let own = davis(&self.likeliest_solution()?).cholesky()?;
        let ratio = own.solve(&mixed).trace() / PARAMETERS as f64;
        Some(ratio.max(student_factor(self.freedom() + PRIOR_ROWS)))
    }

    /// The disturbance now, in N/kN for given parameters and their covariance, with its
    /// standard deviation.
    pub fn disturbance(&self, parameters: &Unknowns) -> (f64, f64) {
        let member = &self.members[self.likeliest];
        let (value, variance) = disturbance_of(&member.whitener, parameters);
        (value, (variance * member.scale()).max(0.0).sqrt())
    }

    /// The mixture of all members; `None` while the rows do not determine the parameters.
    pub fn mixture(&self) -> Option<Solution> {
        self.mixture
    }

    /// One small factorisation for each member of weight.
    fn mix(&self) -> Option<Solution> {
        let factor = student_factor(self.freedom() + PRIOR_ROWS);
        let mut estimate = Unknowns::zeros();
        let mut second = SMatrix::<f64, UNKNOWNS, UNKNOWNS>::zeros();
        for member in self.weighty() {
            let (own, covariance) = member.solution()?;
            estimate += own * member.weight;
            second += (covariance * factor + own * own.transpose()) * member.weight;
        }
        let total = self.total_weight();
        if total <= 0.0 {
            return None;
        }
        estimate /= total;
        Some(Solution { estimate, covariance: second / total - estimate * estimate.transpose() })
    }

    /// The slow force that the model does not know, over all members.
    pub fn disturbed(&self) -> Disturbed {
        let freedom = self.freedom();
        let total = self.total_weight();
        if freedom < 1.0 || total <= 0.0 {
            return Disturbed { std_n_per_kn: 0.0, evidence: 0.0 };
        }
        let variance: f64 =
            self.weighty().map(|m| m.weight * m.scale() * m.disturbance.std_n_per_kn.powi(2)).sum();
        let likelihood = |index: usize| self.members[index].log_likelihood(freedom);
        Disturbed {
            std_n_per_kn: (variance / total).sqrt(),
            evidence: 2.0 * (likelihood(self.likeliest) - likelihood(0)),
        }
    }

    fn weighty(&self) -> impl Iterator<Item = &Member> {
        self.members.iter().filter(|member| member.weight > WEIGHT_MIN)
    }

    fn total_weight(&self) -> f64 {
        self.weighty().map(|member| member.weight).sum()
    }

    fn freedom(&self) -> f64 {
        self.count() - 3.0
    }

    fn weigh(&mut self) {
        let freedom = self.freedom();
        if freedom < 1.0 {
            return;
        }
        let mut best = f64::NEG_INFINITY;
        for (i, member) in self.members.iter_mut().enumerate() {
            let likelihood = member.log_likelihood(freedom);
            member.weight = likelihood;
            if likelihood > best {
                (best, self.likeliest) = (likelihood, i);
            }
        }
        let mut sum = 0.0;
        for member in &mut self.members {
            member.weight = (member.weight - best).exp();
            sum += member.weight;
        }
        for member in &mut self.members {
            member.weight /= sum;
        }
    }
}

impl Member {
    fn row(&self, observation: &Observation) -> Option<(WhiteRow, f64)> {
        let (columns, variance) = self.whitener.innovation(&observation.sighting());
        if !(variance > 0.0 && variance.is_finite()) {
            return None;
        }
        let root = variance.sqrt();
        let features = columns.fixed_rows::<UNKNOWNS>(1) / root;
        Some((WhiteRow { features, observed: columns[0] / root }, variance))
    }

    fn accept(&mut self, observation: &Observation, forgetting: f64) {
        let Some((row, variance)) = self.row(observation) else { return };
        self.information.forget(forgetting);
        self.log_variances = forgetting * self.log_variances + variance.ln();
        self.information.update(&row.features, row.observed);
        let corrected = self.whitener.correct(&observation.sighting());
        debug_assert!(corrected.is_ok(), "the row's variance was positive");
    }

    /// Restricted log-likelihood with the scale profiled out, up to a constant.
    fn log_likelihood(&self, freedom: f64) -> f64 {
        -0.5 * (freedom + PRIOR_ROWS) * self.scale().ln()
            - 0.5 * self.log_variances
            - 0.5 * self.information.log_determinant()
    }

    /// Residual variance of unit-variance rows, the model itself counting for some.
    fn scale(&self) -> f64 {
        let freedom = (self.information.count() - 3.0).max(0.0);
        (self.information.residual_sum() + PRIOR_ROWS) / (freedom + PRIOR_ROWS)
    }

    fn solution(&self) -> Option<(Unknowns, SMatrix<f64, UNKNOWNS, UNKNOWNS>)> {
        let estimate = self.information.solve().ok()?;
        Some((estimate, self.information.covariance().ok()? * self.scale()))
    }
}

/// Widens a variance so that 1.96 standard deviations hold 95 % although the variance itself
/// is estimated with so many degrees of freedom (Student's t).
fn student_factor(freedom: f64) -> f64 {
    1.0 + 2.5 / (freedom - 1.2).max(0.8)
}
