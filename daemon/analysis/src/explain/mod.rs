//! Explanation of a residual: the part of the motion that the declared model does not predict, the undeclared effect
//! that causes it, the significance of this effect, and the prediction of the model with it.
//!
//! # Layout, in the order of the work
//!
//! - [`evidence`]: observations, noise, the joint fit of a, b, c and effects
//! - [`found_forces`]: the efficiency of a drive whose recording has its power and not its force, and forces that act
//!   before their time stamps
//! - [`hypothesis`], [`effects`]: the interface of an effect; the library, one file for each kind
//! - [`scan`], [`places`]: the gain of a force of a given shape, and the interval, runs or window of time where it acts
//! - [`selection`]: the search for effects, their significance, the evidence of each run, and the finished model fitted
//!   jointly with the usual errors
//! - [`score`], [`stop_to_stop`]: open-loop prediction of fit and holdout runs, and the meaning of an effect
//! - [`many`]: with many runs, some of them for the search, all of them for sizes and scores
//! - [`over_time`], [`held_out`]: numbers that differ between runs, and confirmation by the holdout runs
//! - [`unexplained`], [`competing`], [`caveats`], [`verdict`], [`answer`]: the statement
//! - [`report`]: further contents of a report
//!
//! [`explain`] runs it all.

pub mod answer;
pub mod caveats;
pub mod competing;
pub mod effects;
pub mod evidence;
pub mod found_forces;
pub mod held_out;
pub mod hypothesis;
mod location;
pub mod many;
pub mod over_time;
pub mod places;
pub mod report;
pub mod scan;
pub mod score;
pub mod selection;
pub mod stop_to_stop;
pub mod unexplained;
pub mod verdict;

use std::borrow::Cow;

use dynocar_core::plausibility::Severity;

use crate::dataset::Dataset;
use crate::dataset::dataset_diagnostic::diagnostics;
use crate::parallel;
use answer::ExplainAnswer;
use evidence::{Density, FitProblem, RunData, RunDataError};
use found_forces::{EstimatedDrive, FoundForces};
use held_out::HeldOutRun;
use many::{Held, Many, Preparation};
use score::PredictionScore;
use selection::{Deviations, Progress, Search, SearchOutcome};
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
    pub score: PredictionScore,
    /// Result of the search.
    pub outcome: SearchOutcome,
    /// How runs are made ready for its models.
    pub preparation: Preparation,
}

/// Explains the residual of a dataset's declared model.
///
/// Holdout runs are read once, to score the finished model. Of [`many`] fit runs, the search uses some.
///
/// # Errors
///
/// When a run has no usable sample.
pub fn explain(dataset: &Dataset, progress: Progress) -> Result<Explanation, RunDataError> {
    let Some(held) = Held::of(dataset.runs.iter().map(|run| run.role)) else {
        return explained(Cow::Borrowed(dataset), None, progress);
    };
    let runs = dataset.runs.iter().enumerate().filter(|(index, _)| held.holds(*index));
    let chosen =
        Dataset { runs: runs.map(|(_, run)| run.clone()).collect(), ..dataset.without_runs() };
    let read = |index: usize| Ok(dataset.runs[index].clone());
    explained(Cow::Owned(chosen), Some(Many { dataset, held: &held, read: &read }), progress)
}

/// Explains the residual of the declared model over many runs, of which only the `held` ones are in memory.
///
/// # Errors
///
/// When a run has no usable sample, or cannot be read.
pub fn explain_many<E: From<RunDataError> + Send>(
    held: Dataset,
    many: Many<E>,
    progress: Progress,
) -> Result<Explanation, E> {
    explained(Cow::Owned(held), Some(many), progress)
}

fn explained<E: From<RunDataError> + Send>(
    dataset: Cow<Dataset>,
    many: Option<Many<E>>,
    progress: Progress,
) -> Result<Explanation, E> {
    progress(0.0, "reading the runs");
    let density = if many.is_some() { Density::Thinned } else { Density::Recorded };
    let Prepared { forces, preparation, problem, holdout } = Prepared::new(&dataset, density)?;
    let track = preparation.track().map(|track| &**track);
    let all = many.as_ref().map_or(&dataset.runs, |many| &many.dataset.runs);
    let diagnostics = diagnostics(preparation.train(), track, all);
    let recorded_step_s = dataset.step_s();
    drop(dataset);
    let search = Search {
        problem: &problem,
        holdout: &holdout,
        train: preparation.train(),
        track: preparation.track(),
        progress,
    };
    // An effect cannot explain wrong units.
    let is_possible =
        diagnostics.iter().all(|diagnostic| diagnostic.severity < Severity::Fundamental);
    let mut outcome = if is_possible { search.run() } else { search.base() };
    if is_possible && Unexplained::new(&search, &outcome).is_some_and(|left| !left.is_noise()) {
        search.look_under_noise(&mut outcome);
    }
    let known = places::settle(&problem, &mut outcome.fit);
    selection::move_to_nuisance_fit(&search, &mut outcome);
    // A dead time and a lag are separated by the shape of the force, which the search of many runs saw thinned.
    let is_joined = match &many {
        Some(many) => many.join(&search, &preparation, &mut outcome)?,
        None => false,
    };
    let seen = if is_joined { Density::Recorded } else { density };
    let step_s = seen.step_s(recorded_step_s);
    let deviations = selection::deviations_given(&problem, &outcome, step_s);
    progress(0.95, "scoring the holdout runs");
    let judged = judged(many.as_ref(), &search, &preparation, &outcome)?;
    let scores = judged.iter().map(|run| run.score.clone()).collect();
    let score = PredictionScore::new(&problem, scores, &outcome.base, &outcome.fit);
    let spans = match &many {
        Some(many) => many.spans(),
        None => problem.runs.iter().map(|run| [run.file.clone(), run.file.clone()]).collect(),
    };
    let joint = outcome.nuisance_fit();
    let finished = joint.as_ref().map_or(&outcome.fit, |joint| &joint.fit);
    let courses = over_time::courses(&problem, finished, &spans, &deviations.std);
    let held_out = held_out::by_held_out_runs(
        (&problem, finished),
        &judged,
        (&deviations, step_s),
        known.len(),
    );
    let known = caveats::FinishedFit {
        deviations: &deviations,
        places: &known,
        courses: &courses,
        held_out: &held_out,
    };
    let mut answer = verdict::answer(&search, &outcome, &known, &score, diagnostics);
    forces.add_to(&mut answer);
    if let Some(many) = &many {
        answer.add_caveat(&many.sentence(&outcome));
    }
    progress(1.0, "done");
    Ok(Explanation { answer, problem, holdout, deviations, score, outcome, preparation })
}

/// Reduces the runs held out to their errors and their evidence on a finished model.
fn judged<E: From<RunDataError> + Send>(
    many: Option<&Many<E>>,
    search: &Search,
    preparation: &Preparation,
    outcome: &SearchOutcome,
) -> Result<Vec<HeldOutRun>, E> {
    let of = |run: &RunData| HeldOutRun::new((search.problem, outcome), run, Some(run));
    match many {
        Some(many) => many.judged(search, preparation, outcome),
        None => Ok(parallel::of_each(search.holdout, of)),
    }
}

/// Prepared runs, with the corrections of their forces that were found.
struct Prepared {
    forces: FoundForces,
    preparation: Preparation,
    problem: FitProblem,
    holdout: Vec<RunData>,
}

impl Prepared {
    /// Makes the runs of a dataset ready: once, and once more for each correction of their forces that is found.
    fn new(declared: &Dataset, density: Density) -> Result<Self, RunDataError> {
        let step_s = declared.step_s();
        let is_time_open = found_forces::is_time_sought(step_s);
        let has_power = declared.runs.iter().any(|run| run.power().is_some());
        let first = if is_time_open || has_power { Density::Recorded } else { density };
        let (mut problem, mut holdout) = FitProblem::of(declared, first)?;
        let mut dataset = Cow::Borrowed(declared);
        let estimated_drive = found_forces::estimated_drive(&problem, declared.train.drive);
        if let Some(EstimatedDrive { drive, .. }) = &estimated_drive {
            dataset = Cow::Owned(dataset.with_drive(*drive));
            (problem, holdout) = FitProblem::of(&dataset, Density::Recorded)?;
        }
        let late =
            if is_time_open { found_forces::estimated_lateness(&problem, step_s) } else { None };
        if let Some(late) = late {
            dataset = Cow::Owned(dataset.with_forces_moved(late.value));
        }
        if late.is_some() || first != density {
            (problem, holdout) = FitProblem::of(&dataset, density)?;
        }
        let drive = estimated_drive.as_ref().map(|it| it.drive);
        let preparation = Preparation::new(declared, drive, late.map(|late| late.value));
        Ok(Prepared {
            forces: FoundForces { drive: estimated_drive, late },
            preparation,
            problem,
            holdout,
        })
    }
}
