//! Many runs: the search uses some of them, evenly chosen and thinned to a second; then all of them determine the sizes
//! of the effects found, and score the prediction.
//!
//! A fixed number of runs is held in memory, however many there are. Then all runs are read one after the other, as
//! recorded, and reduced to their normal equations at the finished model, which add up, or to their errors. An effect
//! that acts in some runs only is known from the searched runs alone, and these determine its size. A run counts only
//! as far along the line as the searched runs go, since the search looked for no effects beyond.

use std::sync::Arc;

use dynocar_model::track::Track;
use dynocar_model::train::{PowerTrain, TrainModel};

use super::evidence::{Density, Fit, FitProblem, RunData, RunDataError, RunNormal, prepare_at};
use super::held_out::HeldOutRun;
use super::over_time::Span;
use super::selection::{NuisanceFit, Search, SearchOutcome};
use crate::dataset::{Dataset, Role, Run};
use crate::parallel;

/// Largest number of fit runs that are all searched, as they were recorded.
pub const FIT_RUNS_MAX: usize = 32;
/// Least and greatest number of searched fit runs where there are more: a quarter of them is searched within these
/// bounds.
const FIT_RUNS_HELD: [usize; 2] = [12, 24];
/// Number of holdout runs that are held for effects in single runs.
const HOLDOUT_RUNS_HELD: usize = 6;
/// Golden ratio less 1: its multiples, less their whole parts, are spread evenly, and follow no periodic order of the
/// runs.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Returns the number of fit runs that are held.
fn fit_runs_held(fit: usize) -> usize {
    let [least, most] = FIT_RUNS_HELD;
    (fit / 4).clamp(least, most)
}

/// Which of many runs are held in memory.
///
/// Fit runs that follow each other make a group, of which one run is held.
#[derive(Clone, Debug, PartialEq)]
pub struct Held {
    /// Group of each run.
    groups: Vec<Group>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Group {
    role: Role,
    /// Its number among those of the role.
    number: usize,
    is_held: bool,
}

impl Held {
    /// Of runs with these roles in their order; `None` where all are held.
    pub fn of(roles: impl Iterator<Item = Role> + Clone) -> Option<Self> {
        let count = |role| roles.clone().filter(|own| *own == role).count();
        let (fit, holdout) = (count(Role::Fit), count(Role::Holdout));
        if fit <= FIT_RUNS_MAX {
            return None;
        }
        let mut seen = [0, 0];
        let groups = roles.map(|role| {
            let (seen, runs, most) = match role {
                Role::Fit => (&mut seen[0], fit, fit_runs_held(fit)),
                Role::Holdout => (&mut seen[1], holdout, HOLDOUT_RUNS_HELD),
            };
            let count = most.min(runs);
            let number = *seen * count / runs;
            let first = |number: usize| (number * runs).div_ceil(count);
            let (from, end) = (first(number), first(number + 1));
            let share = (GOLDEN * number as f64).fract();
            let within = (share * (end - from) as f64) as usize;
            // An effect in the newest run may be about to last.
            let is_last = number + 1 == count;
            let is_held = *seen == if is_last { end - 1 } else { from + within };
            *seen += 1;
            Group { role, number, is_held }
        });
        Some(Held { groups: groups.collect() })
    }

    /// Returns whether a run is held, by its place from 0.
    pub fn holds(&self, index: usize) -> bool {
        self.groups[index].is_held
    }

    /// Returns the first and last file of each group of fit runs.
    fn spans(&self, runs: &[Run]) -> Vec<Span> {
        let mut spans: Vec<Span> = Vec::new();
        let fit = self.groups.iter().zip(runs).filter(|(group, _)| group.role == Role::Fit);
        for (group, run) in fit {
            match spans.get_mut(group.number) {
                Some(span) => span[1].clone_from(&run.file),
                None => spans.push([run.file.clone(), run.file.clone()]),
            }
        }
        spans
    }

    /// Returns the places of the runs of a role, by group.
    fn members(&self, role: Role) -> Vec<Vec<usize>> {
        let own = || self.groups.iter().enumerate().filter(|(_, group)| group.role == role);
        let count = own().map(|(_, group)| group.number + 1).max().unwrap_or(0);
        let mut members = vec![Vec::new(); count];
        for (index, group) in own() {
            members[group.number].push(index);
        }
        members
    }
}

/// How a run is made ready for the finished model.
#[derive(Clone, Debug)]
pub struct Preparation {
    /// Train and line, without runs.
    declared: Dataset,
    drive: Option<PowerTrain>,
    late_s: Option<f64>,
    train: Arc<TrainModel>,
}

impl Preparation {
    /// With forces from the power of another drive, and moved in time, where that was found.
    pub fn new(declared: &Dataset, drive: Option<PowerTrain>, late_s: Option<f64>) -> Self {
        let declared = declared.without_runs();
        let train = drive.map_or(declared.train.clone(), |it| declared.with_drive(it).train);
        Preparation { declared, drive, late_s, train }
    }

    /// Returns the train, with the drive that was found.
    pub fn train(&self) -> &TrainModel {
        &self.train
    }

    /// Returns the line.
    pub fn track(&self) -> Option<&Arc<Track>> {
        self.declared.track.as_ref()
    }

    /// Returns a run made ready.
    ///
    /// # Errors
    ///
    /// When it has no usable sample.
    pub fn run(&self, run: Run, density: Density) -> Result<RunData, RunDataError> {
        let mut one = Dataset { runs: vec![run], ..self.declared.clone() };
        if let Some(drive) = self.drive {
            one = one.with_drive(drive);
        }
        if let Some(late_s) = self.late_s {
            one = one.with_forces_moved(late_s);
        }
        Ok(prepare_at(&one, density)?.remove(0))
    }
}

/// Runs of which not all are in memory.
pub struct Many<'a, E> {
    /// All of them, with the properties of each; their samples need not be there.
    pub dataset: &'a Dataset,
    /// Which of them are held.
    pub held: &'a Held,
    /// Reads one by its place.
    pub read: &'a (dyn Fn(usize) -> Result<Run, E> + Sync),
}

/// Returns whether a model's effects act in each run alike.
fn is_common(fit: &Fit) -> bool {
    fit.model.effects.iter().all(|effect| {
        let place = effect.place();
        let nature = effect.nature();
        place.windows.is_none() && place.runs.is_none() && !nature.is_one_number_a_run
    })
}

impl<E: From<RunDataError> + Send> Many<'_, E> {
    /// Moves a model that was found in the held, thinned runs to its best fit to all runs as they were recorded: both
    /// the fit jointly with the usual errors and the fit that predicts. Returns false where the model stays, since only
    /// some runs show its effects.
    pub(super) fn join(
        &self,
        search: &Search,
        preparation: &Preparation,
        outcome: &mut SearchOutcome,
    ) -> Result<bool, E> {
        let problem = search.problem;
        let Some(joint) = outcome.nuisance_fit().filter(|_| is_common(&outcome.fit)) else {
            return Ok(false);
        };
        (search.progress)(0.95, "reading all runs");
        let fits = [&joint.fit, &outcome.fit, &outcome.base];
        let [of_joint, own, base] = self.normals(problem, preparation, fits)?;
        let count = outcome.fit.model.effects.len();
        let fit = problem.joined(&joint.fit, of_joint, count, |fit| {
            let [again] = self.normals(problem, preparation, [fit])?;
            Ok::<_, E>(again)
        })?;
        let effects = 3..outcome.fit.theta.len();
        let moved: Vec<f64> = effects.map(|i| fit.theta[i] - joint.fit.theta[i]).collect();
        outcome.set_nuisance_fit(NuisanceFit { fit, shared: joint.shared });
        outcome.fit = problem.with_davis_joined(&outcome.fit, &own, &moved);
        outcome.base = problem.with_davis_joined(&outcome.base, &base, &[]);
        Ok(true)
    }

    /// Returns the normal equations of the fit runs, by group, as far along the line as the searched runs go.
    fn normals<const N: usize>(
        &self,
        problem: &FitProblem,
        preparation: &Preparation,
        fits: [&Fit; N],
    ) -> Result<[Vec<RunNormal>; N], E> {
        let mut sums = fits.map(|_| Vec::new());
        for group in self.held.members(Role::Fit) {
            let each = parallel::of_each(&group, |index| -> Result<_, E> {
                let run = self.within(problem, (self.read)(*index)?, preparation)?;
                Ok(run.map(|run| fits.map(|fit| problem.normal_of(&run, fit))))
            });
            let mut sum = fits.map(|fit| RunNormal::none(fit.theta.len()));
            for own in each {
                let own = own?.into_iter().flatten();
                sum.iter_mut().zip(own).for_each(|(sum, own)| sum.add(&own));
            }
            sums.iter_mut().zip(sum).for_each(|(sums, sum)| sums.push(sum));
        }
        Ok(sums)
    }

    /// Reduces the holdout runs to their errors and their evidence; the held ones alone where something acts in some runs only.
    pub(super) fn judged(
        &self,
        search: &Search,
        preparation: &Preparation,
        outcome: &SearchOutcome,
    ) -> Result<Vec<HeldOutRun>, E> {
        let problem = search.problem;
        if !is_common(&outcome.fit) {
            let judged = |run: &RunData| HeldOutRun::new((problem, outcome), run, Some(run));
            return Ok(parallel::of_each(search.holdout, judged));
        }
        let roles = self.dataset.runs.iter().map(|run| run.role).enumerate();
        let own: Vec<usize> = roles.filter(|it| it.1 == Role::Holdout).map(|it| it.0).collect();
        let judge = |index: &usize| -> Result<_, E> {
            let read = (self.read)(*index)?;
            let within = self.within(problem, read.clone(), preparation)?;
            let run = preparation.run(read, Density::Recorded)?;
            Ok(HeldOutRun::new((problem, outcome), &run, within.as_ref()))
        };
        // Their evidence adds up in groups, so that memory does not grow with their number.
        let of_group = own.len().div_ceil(FIT_RUNS_HELD[1]).max(1);
        let mut judged = Vec::new();
        for part in own.chunks(of_group * (8 / of_group).max(2)) {
            let each = parallel::of_each(part, judge).into_iter();
            let mut each = each.collect::<Result<Vec<HeldOutRun>, E>>()?;
            each.chunks_mut(of_group).for_each(HeldOutRun::gather);
            judged.append(&mut each);
        }
        Ok(judged)
    }

    /// Makes a run ready as far along the line as the searched runs go; `None` for one that goes elsewhere.
    fn within(
        &self,
        problem: &FitProblem,
        mut run: Run,
        preparation: &Preparation,
    ) -> Result<Option<RunData>, RunDataError> {
        if let Some(reach_m) = problem.reach_m(f64::from(run.direction)) {
            run.forget_forces_beyond(reach_m);
            if !run.has_forces() {
                return Ok(None);
            }
        }
        preparation.run(run, Density::Recorded).map(Some)
    }

    /// Returns the first and last file of the runs in each row of normal equations.
    pub(super) fn spans(&self) -> Vec<Span> {
        self.held.spans(&self.dataset.runs)
    }

    /// Returns how many runs determine the sizes of effects, as a sentence to follow another.
    pub(super) fn sentence(&self, outcome: &SearchOutcome) -> String {
        let fit = self.dataset.with_role(Role::Fit).count();
        let sizes = match is_common(&outcome.fit) {
            true => "all of them say how large it is",
            false => "it acts in some runs only, and these alone say how large it is",
        };
        format!(
            " Effects were looked for in {} of {fit} fit runs, evenly chosen; {sizes}.",
            fit_runs_held(fit)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn held(fit: usize, holdout: usize) -> Option<Held> {
        let roles = (0..fit + holdout).map(|index| {
            let is_held_out =
                index * holdout / (fit + holdout) != (index + 1) * holdout / (fit + holdout);
            if is_held_out { Role::Holdout } else { Role::Fit }
        });
        Held::of(roles)
    }

    #[test]
    fn few_runs_are_all_held_and_of_many_as_many_whatever_their_number() {
        assert_eq!(held(FIT_RUNS_MAX, 8), None);
        assert_eq!(held(0, 300), None);
        for (fit, holdout) in [(33, 3), (48, 16), (192, 64), (1000, 0), (767, 257)] {
            let held = held(fit, holdout).unwrap();
            let count = |role| {
                let own = held.groups.iter().filter(|it| it.role == role);
                own.filter(|it| it.is_held).count()
            };
            assert_eq!(count(Role::Fit), fit_runs_held(fit), "{fit} + {holdout}");
            assert_eq!(count(Role::Holdout), holdout.min(HOLDOUT_RUNS_HELD), "{fit} + {holdout}");
            let members: usize = held.members(Role::Fit).iter().map(Vec::len).sum();
            assert_eq!(members, fit);
            let newest = held.groups.iter().rfind(|it| it.role == Role::Fit);
            assert!(newest.is_some_and(|it| it.is_held));
            assert!(fit_runs_held(fit) <= FIT_RUNS_HELD[1]);
        }
    }

    #[test]
    fn runs_in_both_directions_by_turns_are_held_of_both() {
        for fit in [48, 96, 192, 768] {
            let held = held(fit, 0).unwrap();
            let forth = (0..fit).filter(|index| held.holds(*index) && index % 2 == 0).count();
            let share = forth as f64 / fit_runs_held(fit) as f64;
            assert!((0.3..0.7).contains(&share), "{share} of {fit}");
        }
    }
}
