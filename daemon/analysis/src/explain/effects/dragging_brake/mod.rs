//! A brake that does not release: a constant force from some instant to the end of the run.
//!
//! Where the brake cylinders keep some pressure while no brake is reported, this pressure shows the windows too, also
//! in holdout runs, whose speeds the search does not use.

mod onsets;

use std::sync::Arc;

use dynocar_model::terms::brake::{self, BUILD_UP_S, build_up};
use dynocar_shared::vocabulary::EffectKind;

use self::onsets::{GRID_MIN_S, TAIL_MIN_S, by_pressure, by_speed, onset_tuple};
use super::{Candidate, Certainty, Hypothesis, Nature, On, Policy, Proposal, SharedHypothesis};
use crate::explain::answer::{Location, RunWindow};
use crate::explain::evidence::SampleForces;
use crate::explain::places::{Axis, IntervalEnd, Reach};
use crate::explain::scan::{Scan, Tuple};

/// Number of dragging brakes that hardly have the same time since departure in most runs by chance.
const CLOCKED_RUNS_MIN: usize = 3;

#[derive(Clone, Debug)]
struct Dragging {
    windows: Vec<RunWindow>,
    /// For the first windows, whose onsets were found by the speeds: time in s of the run's first sample, and its
    /// duration in s.
    by_speed: Vec<[f64; 2]>,
    /// How many runs were fitted.
    fit_runs: usize,
    choice_cost: f64,
}

/// Its runs are chosen among many, which the usual errors of single runs stand for; on slippery rails a
/// slide looks like a brake that drags.
pub const POLICY: Policy = Policy {
    certainty: Certainty::WithNuisance,
    uncertain_with: &[EffectKind::LowAdhesion],
    is_one_of_many: true,
    is_passing: true,
    ..Policy::USUAL
};

/// Proposes structures for the data at hand.
pub fn propose(scan: &Scan) -> Proposal {
    let mut candidates = Vec::new();
    let runs = &scan.problem.runs;
    let fit_runs = runs.len();
    let by_pressure = by_pressure(runs.iter().chain(scan.holdout));
    let fitted = |windows: &[RunWindow]| {
        windows.iter().any(|window| runs.iter().any(|run| run.file == window.run))
    };
    if let Some(windows) = by_pressure.clone().filter(|windows| fitted(windows)) {
        let tuple = window_tuple(scan, &windows);
        let (_, estimate) = scan.gain(&tuple);
        let hypothesis = Dragging { windows, by_speed: Vec::new(), fit_runs, choice_cost: 2.0 };
        candidates.push(Candidate::new(hypothesis, vec![estimate.max(0.0)]));
    }
    if let Some((windows, estimate, choice_cost)) = by_speed(scan) {
        let by_speed = windows.iter().map(|window| spanned(scan, window)).collect();
        let windows = with_holdout(scan, windows, by_pressure);
        let hypothesis = Dragging { windows, by_speed, fit_runs, choice_cost };
        candidates.push(Candidate::new(hypothesis, vec![estimate]));
    }
    Ok(candidates)
}

/// Time in s of the first sample of a window's run, and the run's duration in s.
fn spanned(scan: &Scan, window: &RunWindow) -> [f64; 2] {
    let run = scan.problem.runs.iter().find(|run| run.file == window.run);
    run.map_or([0.0; 2], |run| [run.offset_s, run.duration_s()])
}

fn window_tuple(scan: &Scan, windows: &[RunWindow]) -> Tuple {
    let mut sum = Tuple::zero(scan.fit.theta.len());
    for (index, run) in scan.problem.runs.iter().enumerate() {
        for window in windows.iter().filter(|window| window.run == run.file) {
            sum.add(&onset_tuple(scan, index, window.t_start_s - run.offset_s));
        }
    }
    sum
}

/// Adds holdout windows by pressure, if pressure and speeds agree on the fit runs.
fn with_holdout(
    scan: &Scan,
    mut windows: Vec<RunWindow>,
    by_pressure: Option<Vec<RunWindow>>,
) -> Vec<RunWindow> {
    const SAME_S: f64 = 90.0;
    let Some(by_pressure) = by_pressure else { return windows };
    let agreeing = windows.iter().filter(|window| {
        by_pressure.iter().any(|other| {
            other.run == window.run && (other.t_start_s - window.t_start_s).abs() < SAME_S
        })
    });
    let on_fit = |window: &&RunWindow| scan.problem.runs.iter().any(|run| run.file == window.run);
    let agree = agreeing.count();
    if 2 * agree > windows.len() && 2 * agree > by_pressure.iter().filter(on_fit).count() {
        windows.extend(by_pressure.iter().filter(|window| !on_fit(window)).cloned());
    }
    windows
}

impl Hypothesis for Dragging {
    fn nature(&self) -> Nature<'_> {
        Nature {
            choice_cost: self.choice_cost,
            affine_in: Some(|value| value),
            ..Nature::new(EffectKind::DraggingBrake, &brake::PARAMETERS)
        }
    }

    fn apply(&self, parameters: &[f64], On { run, first, .. }: On, forces: &mut [SampleForces]) {
        for window in self.windows.iter().filter(|window| window.run == run.file) {
            let onset_s = window.t_start_s - run.offset_s;
            for (force, time_s) in forces.iter_mut().zip(&run.recording.time_s()[first..]) {
                force.extra_n += parameters[0] * build_up(time_s - onset_s);
            }
        }
    }

    fn ends(&self) -> Vec<IntervalEnd> {
        let estimated = self.by_speed.iter().zip(&self.windows).enumerate();
        let onset =
            |(part, (&[offset_s, duration_s], window)): (usize, (&[f64; 2], &RunWindow))| {
                let at = window.t_start_s - offset_s;
                IntervalEnd {
                    axis: Axis::Time,
                    part,
                    is_upper: false,
                    at,
                    reach: Reach::Between(0.0, (duration_s - BUILD_UP_S).max(at)),
                    fine: 0.5,
                    run: Some(window.run.clone()),
                }
            };
        estimated.map(onset).collect()
    }

    fn with_end(&self, end: &IntervalEnd, at: f64) -> Option<SharedHypothesis> {
        let mut moved = self.clone();
        moved.windows[end.part].t_start_s = self.by_speed[end.part][0] + at;
        Some(Arc::new(moved))
    }

    fn contradiction(&self, _parameters: &[f64]) -> Option<&'static str> {
        let onsets = self.by_speed.iter().zip(&self.windows);
        let within_s = onsets.map(|([offset_s, _], window)| window.t_start_s - offset_s);
        // A brake may drag from the first sample on in every run.
        let within_s: Vec<f64> = within_s.filter(|onset_s| *onset_s > TAIL_MIN_S).collect();
        let as_late =
            |&one: &f64| within_s.iter().filter(|&&other| (one - other).abs() < GRID_MIN_S).count();
        let most = within_s.iter().map(as_late).max().unwrap_or(0);
        let is_clocked = most >= CLOCKED_RUNS_MIN && 2 * most > self.fit_runs;
        is_clocked.then_some("begins at one time after departure in most runs")
    }

    fn place(&self) -> Location {
        Location { windows: Some(self.windows.clone()), ..Location::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brakes_do_not_stick_by_the_clock() {
        let of = |onsets_s: &[f64], fit_runs: usize| {
            let window = |&onset_s: &f64| RunWindow {
                run: "runs/01.csv".into(),
                t_start_s: 1000.0 + onset_s,
                t_end_s: 2000.0,
            };
            let windows = onsets_s.iter().map(window).collect();
            let by_speed = vec![[1000.0, 1000.0]; onsets_s.len()];
            Dragging { windows, by_speed, fit_runs, choice_cost: 0.0 }.contradiction(&[5000.0])
        };
        assert!(of(&[401.7, 400.6, 403.2, 400.1, 400.1, 241.5], 6).is_some());
        assert!(of(&[401.7, 520.0, 403.2], 3).is_none(), "two of three");
        assert!(of(&[400.0, 401.0, 402.0, 80.0, 510.0, 700.0], 6).is_none(), "half of them");
        assert!(of(&[144.0, 151.0, 140.0], 6).is_none(), "the others have none");
        assert!(of(&[0.0, 0.0, 0.0], 3).is_none(), "brakes that drag from the start");
    }
}
