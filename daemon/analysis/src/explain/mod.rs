//! Explaining a residual: what the declared model leaves, which undeclared effect explains it,
//! how sure that is, and what the model with the effect predicts.
//!
//! # Layout, in the order of the work
//!
//! - [`evidence`]: observations, noise, the joint fit of a, b, c and effects
//! - [`drive`]: the efficiency of a drive of which only the power is recorded
//! - [`force_time`]: forces that act before their stamps
//! - [`hypothesis`], [`effects`]: what an effect is to the others; the library, one file for each kind
//! - [`scan`], [`places`], [`residual_pressure`]: what a force of some shape, at some place or
//!   time, would explain
//! - [`selection`]: the search for effects, its significance, evidence by run, the finished model beside what is
//!   usually wrong
//! - [`gradient_prior`]: how maps err
//! - [`score`], [`stop_to_stop`], `bootstrap`: open-loop prediction of fit and holdout runs
//! - [`unexplained`], [`identifiability`], [`competing`], [`meaning`], `caveats`, [`verdict`], [`described`],
//!   [`answer`]: the statement
//! - [`report`]: what a report shows beyond it
//!
//! [`explain`] runs it all.

pub mod answer;
mod bootstrap;
mod caveats;
pub mod competing;
pub mod described;
pub mod drive;
pub mod effects;
pub mod evidence;
pub mod force_time;
pub mod gradient_prior;
pub mod hypothesis;
pub mod identifiability;
pub mod meaning;
pub mod places;
pub mod report;
pub mod residual_pressure;
pub mod scan;
pub mod score;
pub mod selection;
pub mod stop_to_stop;
pub mod unexplained;
pub mod verdict;

use dynocar_core::plausibility::Severity;

use crate::dataset::{Dataset, Role};
use answer::ExplainAnswer;
use evidence::{FitProblem, RunData, RunDataError};
use score::{PredictedRun, Score};
use selection::{Deviations, Outcome, Progress, Search};
use unexplained::Unexplained;

/// Fit and holdout runs with the models that were fitted.
pub struct Explanation {
    /// The machine-readable answer.
    pub answer: ExplainAnswer,
    /// The fit runs and their prior.
    pub problem: FitProblem,
    /// The runs set aside.
    pub holdout: Vec<RunData>,
    /// How surely its parameters are known.
    pub deviations: Deviations,
    /// Open-loop errors.
    pub score: Score,
    /// Predicted measured speeds of all runs by the grown model.
    pub predictions: Vec<PredictedRun>,
    /// What the search found.
    pub outcome: Outcome,
}

/// Explains what the declared model of a dataset leaves.
///
/// Holdout runs are read once, to score the finished model.
///
/// # Errors
///
/// When a run has no usable sample.
pub fn explain(dataset: &Dataset, progress: Progress) -> Result<Explanation, RunDataError> {
    progress(0.0, "reading the runs");
    let estimated_drive = drive::estimated(dataset)?;
    let retaken = estimated_drive.as_ref().map(|it| dataset.with_drive(it.drive));
    let dataset = retaken.as_ref().unwrap_or(dataset);
    let late = force_time::estimated(dataset)?;
    let moved = late.map(|late| dataset.with_forces_moved(late.value));
    let dataset = moved.as_ref().unwrap_or(dataset);
    let (fit_runs, holdout): (Vec<RunData>, Vec<RunData>) =
        evidence::prepare(dataset)?.into_iter().partition(|run| run.role == Role::Fit);
    let problem = FitProblem::new(fit_runs, dataset.train.resistance);
    let search = Search {
        problem: &problem,
        holdout: &holdout,
        train: &dataset.train,
        track: dataset.track.as_ref(),
        progress,
    };
    let diagnostics = dataset.diagnostics();
    // An effect that explains wrong units is none.
    let is_possible =
        diagnostics.iter().all(|diagnostic| diagnostic.severity < Severity::Fundamental);
    let mut outcome = if is_possible { search.run() } else { search.base() };
    if is_possible && Unexplained::of(&search, &outcome).is_some_and(|left| !left.is_noise()) {
        search.look_under_noise(&mut outcome);
    }
    let known = places::settle(&problem, &mut outcome.fit);
    let deviations = selection::given_usual_errors(&search, &mut outcome, dataset.step_s());
    progress(0.95, "scoring the holdout runs");
    let score = Score::of(&problem, &holdout, &outcome.base, &outcome.fit);
    let predictions = score::predictions(&problem, &holdout, &outcome.fit);
    let mut answer = verdict::answer(&search, &outcome, &deviations, &known, &score, diagnostics);
    if let Some(estimated) = estimated_drive {
        answer.add_caveat(&estimated.answer.sentence());
        answer.drive = Some(estimated.answer);
    }
    if let Some(late) = late {
        answer.add_caveat(&force_time::sentence(late));
        answer.force_late_s = Some(late);
    }
    progress(1.0, "done");
    Ok(Explanation { answer, problem, holdout, deviations, score, predictions, outcome })
}
