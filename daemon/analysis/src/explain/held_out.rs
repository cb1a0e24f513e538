//! Confirmation of effects by the holdout runs: whether they act in them too, and how large they are there.
//!
//! The fit runs contribute their information on all other numbers, as surely as the answer states these, and none on the
//! effect itself: its numbers follow from the normal equations of the holdout runs and from that information.

use nalgebra::{Cholesky, DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::evidence::{Fit, FitProblem, Positions, RunData, RunNormal, RunPositions};
use super::over_time::is_one_in_all_runs;
use super::score::RunScore;
use super::selection::{Deviations, SearchOutcome, enlarged_by_scatter, std_with_forms};

/// Least number of runs that can confirm an effect.
const RUNS_MIN: usize = 8;
/// Holdout runs whose standard deviation of an effect exceeds that of the fit runs this many times say nothing.
const DEVIATION_TIMES_MAX: f64 = 5.0;

/// A holdout run, reduced to its information on a finished model.
pub struct HeldOutRun {
    /// Errors without and with the effects.
    pub score: RunScore,
    /// Its evidence on the effects; `None` without effects, where the run shows nothing of them, and where another run
    /// has gathered it.
    evidence: Option<(RunNormal, Vec<RunPositions>)>,
}

impl HeldOutRun {
    /// Reduces a run; `within` is the part of it that may show effects.
    pub fn new(
        (problem, outcome): (&FitProblem, &SearchOutcome),
        run: &RunData,
        within: Option<&RunData>,
    ) -> Self {
        let joint = outcome.nuisance_fit();
        let fit = joint.as_ref().map_or(&outcome.fit, |joint| &joint.fit);
        let within = within.filter(|_| !outcome.fit.model.effects.is_empty());
        HeldOutRun {
            score: RunScore::new(run, &outcome.base, &outcome.fit),
            evidence: within.map(|run| (problem.normal_of(run, fit), vec![RunPositions::of(run)])),
        }
    }

    /// Gathers the evidence of some runs in one of them.
    pub fn gather(runs: &mut [HeldOutRun]) {
        let mut evidence = runs.iter_mut().filter_map(|run| run.evidence.take());
        let Some((mut normal, mut positions)) = evidence.next() else { return };
        for (other, own) in evidence {
            normal.add(&other);
            positions.extend(own);
        }
        runs[0].evidence = Some((normal, positions));
    }
}

/// The numbers of an effect by the runs held out alone.
#[derive(Clone, Debug)]
pub struct HeldOutEffect {
    /// Number of these runs.
    pub runs: usize,
    /// All parameters of the model, the effect's own as in these runs.
    pub theta: Vec<f64>,
    /// How surely they are known.
    pub deviations: Deviations,
    /// Probability that the effect's numbers differ as much from those of the fit runs where they are the same.
    pub p_value: f64,
}

/// Returns the numbers of each of the first `count` effects of a model by the holdout runs; `None` for an effect that
/// acts in some runs only or has more than two numbers, and where these runs hardly show it. `fitted` are the deviations
/// by the fit runs, whose samples are some s apart, as those of the holdout runs are.
pub fn by_held_out_runs(
    (problem, fit): (&FitProblem, &Fit),
    runs: &[HeldOutRun],
    (fitted, step_s): (&Deviations, f64),
    count: usize,
) -> Vec<Option<HeldOutEffect>> {
    let (theta, model) = (&fit.theta, &fit.model);
    let by_fit_runs = as_surely_as_stated(fit, &fitted.std);
    let mut own = RunNormal::none(theta.len());
    let evidence: Vec<&(RunNormal, Vec<RunPositions>)> =
        runs.iter().filter_map(|run| run.evidence.as_ref()).collect();
    evidence.iter().for_each(|it| own.add(&it.0));
    let positions: Vec<RunPositions> = evidence.iter().flat_map(|it| it.1.clone()).collect();
    Positions::of(&positions).add_to(&mut own, model, theta);
    let of_effect = |number: usize| {
        let (effect, range) = (&model.effects[number], model.ranges()[number].clone());
        if positions.len() < RUNS_MIN || !is_one_in_all_runs(&**effect) {
            return None;
        }
        let (start, size) = (range.start, range.len());
        let information = &own.information + without(by_fit_runs.as_ref()?, start, size)?;
        let step = problem.step_from(fit, &information, &own.score)?;
        let factor = Cholesky::new(information.clone())?;
        let left: Vec<RunNormal> = evidence.iter().map(|it| it.0.moved_by(&step)).collect();
        let known = enlarged_by_scatter(&factor.inverse(), &information, &left);
        let [fitted, held_out] = [&fitted.covariance, &known]
            .map(|all| all.view((start, start), (size, size)).into_owned());
        let is_shown = held_out.trace() < DEVIATION_TIMES_MAX.powi(2) * fitted.trace();
        let apart = step.rows(start, size).into_owned();
        let p_value = chance(&apart, &(fitted + held_out))?;
        let theta: Vec<f64> = theta.iter().zip(&step).map(|(value, step)| value + step).collect();
        let std = std_with_forms(&known, model, &theta);
        let mut deviations = Deviations { std, covariance: known, c: theta[2] };
        deviations.add_shared_errors(problem, model, &theta, step_s);
        let runs = positions.len();
        is_shown.then_some(HeldOutEffect { runs, theta, deviations, p_value })
    };
    (0..count).map(of_effect).collect()
}

/// Returns the information of a fit, weakened until its first parameters are known by their stated standard deviations:
/// the scatter between the runs, the map and the forms of effects leave them less sure than its likelihood does.
fn as_surely_as_stated(fit: &Fit, std: &[f64]) -> Option<DMatrix<f64>> {
    let mut information = fit.information();
    let likelihood = Cholesky::new(information.clone())?.inverse();
    for (i, std) in std.iter().enumerate() {
        let weaker = (likelihood[(i, i)].sqrt() / std).min(1.0);
        information.row_mut(i).scale_mut(weaker);
        information.column_mut(i).scale_mut(weaker);
    }
    Some(information)
}

/// Returns the information with `size` parameters from `start` on marginalised out.
fn without(information: &DMatrix<f64>, start: usize, size: usize) -> Option<DMatrix<f64>> {
    let own = information.view((start, start), (size, size)).into_owned();
    let shared = information.columns(start, size);
    let mut rest = information - shared * Cholesky::new(own)?.solve(&shared.transpose());
    rest.rows_mut(start, size).fill(0.0);
    rest.columns_mut(start, size).fill(0.0);
    Some(rest)
}

/// Returns the probability that numbers of such a covariance are as far from zero.
fn chance(numbers: &DVector<f64>, covariance: &DMatrix<f64>) -> Option<f64> {
    let square = numbers.dot(&Cholesky::new(covariance.clone())?.solve(numbers));
    Some(ChiSquared::new(numbers.len() as f64).ok()?.sf(square))
}
