//! The recursions of Liu 2018 behind one interface.

use dynocar_core::filter::{Gaussian, Mils, NotPositiveDefinite, Penalty, Rls};
use dynocar_core::pipeline::momentum::{DataSettings, PARAMETERS, UNKNOWNS};

use crate::resistance::noise_bank::NoiseBank;
use crate::resistance::regression::{RegressionSolution, Unknowns, WhiteRow};
use crate::resistance::settings::{INNOVATION_LENGTH_MAX, MilsSettings, RlsSettings};

/// One of the paper's algorithms.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "one stands in each pipeline, where it stays")]
pub enum Solver {
    /// All rows at once: the mixture of the noise bank itself is the estimate.
    Batch,
    /// Recursive least squares.
    Rls(Rls<UNKNOWNS>),
    /// Multi-innovation least squares; regularised RLS is its case of length 1.
    Mils {
        /// The recursion.
        recursion: Mils<UNKNOWNS, INNOVATION_LENGTH_MAX>,
        /// Robust standard deviations beyond which a row is bad, where the interval varies with bad rows.
        bad_beyond: Option<f64>,
    },
}

/// Variances of the errors of the forces, by the settings.
fn force_variances(data: &DataSettings) -> [f64; UNKNOWNS - PARAMETERS] {
    let (scale, delay) = (data.force_scale_std.powi(2), data.force_delay_std_s.powi(2));
    [scale, scale, delay]
}

fn start(data: &DataSettings, variance: f64, uses: f64) -> Unknowns {
    let forces = force_variances(data);
    Unknowns::from_fn(|i, _| match i.checked_sub(PARAMETERS) {
        None => variance,
        // A recursion that uses every row p times needs the priors p times as strong.
        Some(force) => forces[force] / uses,
    })
}

/// Returns the weights of the noise bank's penalty: lambda/2 on the resistance, the forces' own priors.
pub fn bank_penalty(data: &DataSettings, lambda: f64) -> Unknowns {
    let forces = force_variances(data);
    Unknowns::from_fn(|i, _| match i.checked_sub(PARAMETERS) {
        None => 0.5 * lambda,
        Some(force) => 1.0 / forces[force],
    })
}

impl Solver {
    /// Recursive least squares (eq. 9-11).
    pub fn rls(settings: &RlsSettings) -> Self {
        let variances = start(&settings.data, settings.start_variance, 1.0);
        Solver::Rls(Rls::new(Unknowns::zeros(), &variances, settings.forgetting))
    }

    /// Regularised multi-innovation least squares of a length, 1 for regularised RLS (eq. 12-16); with
    /// an interval that varies where bad rows are left out.
    pub fn mils(settings: &MilsSettings, length: usize, bad_beyond: Option<f64>) -> Self {
        let lambda = Unknowns::from_fn(|i, _| if i < PARAMETERS { settings.lambda } else { 0.0 });
        let penalty =
            Penalty { lambda, length: settings.length, is_printed: settings.printed_penalty };
        let variances = start(&settings.data, settings.start_variance, length as f64);
        let recursion = Mils::new(Unknowns::zeros(), &variances, length, penalty);
        Solver::Mils { recursion, bad_beyond }
    }

    /// Robust standard deviations beyond which a row must not be used.
    pub fn bad_beyond(&self, otherwise: f64) -> f64 {
        match self {
            Solver::Mils { bad_beyond: Some(bad_beyond), .. } => *bad_beyond,
            _ => otherwise,
        }
    }

    /// Takes in a row that the noise bank has accepted.
    ///
    /// # Errors
    ///
    /// When the recursion's covariance is no longer positive definite.
    pub fn take(&mut self, row: &WhiteRow) -> Result<(), NotPositiveDefinite> {
        match self {
            Solver::Batch => Ok(()),
            Solver::Rls(rls) => rls.update(&row.features, row.observed).map(drop),
            Solver::Mils { recursion, .. } => {
                recursion.update(&row.features, row.observed).map(drop)
            }
        }
    }

    /// Goes on from the bank's likeliest member, whose rows were whitened otherwise than the
    /// ones taken in so far.
    pub fn restart(&mut self, bank: &NoiseBank) {
        let Some(RegressionSolution { estimate, covariance }) = bank.likeliest_solution() else {
            return;
        };
        match self {
            Solver::Batch => {}
            Solver::Rls(rls) => rls.belief = Gaussian { mean: estimate, covariance },
            Solver::Mils { recursion, .. } => recursion.restart(estimate, covariance),
        }
    }

    /// Goes on after a row that was refused: a stack of innovations must not hold it.
    pub fn skip(&mut self) {
        if let Solver::Mils { recursion, bad_beyond: Some(_) } = self {
            recursion.forget_rows();
        }
    }

    /// Returns the solution so far; `None` while there is none.
    pub fn solution(&self, bank: &NoiseBank) -> Option<RegressionSolution> {
        let (estimate, covariance) = match self {
            Solver::Batch => return bank.mixture,
            Solver::Rls(rls) => (rls.belief.mean, rls.belief.covariance),
            Solver::Mils { recursion, .. } => (*recursion.estimate(), recursion.covariance()),
        };
        bank.widened(&RegressionSolution { estimate, covariance })
    }
}
