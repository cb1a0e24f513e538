//! An explanation as events and series in time, run by run, to be shown with the data on a timeline; measured and
//! predicted speeds of some runs, thinned for drawing.

use dynocar_model::simulate::Restart;

use super::effect::described;
use super::panels::{Zones, zones};
use super::windows::missing_resistance;
use crate::dataset::{Dataset, Role};
use crate::explain::Explanation;
use crate::explain::answer::Verdict;
use crate::explain::evidence::{Fit, RunData};
use crate::explain::score::{predicted, run_error};
use crate::statistics::greatest_first;

/// An explanation in time.
#[derive(Clone, Debug, PartialEq)]
pub struct Timeline {
    /// The verdict.
    pub verdict: Verdict,
    /// The verdict in a sentence or two.
    pub statement: String,
    /// RMSE in m/s on the holdout runs without the effects.
    pub rmse_before_mps: Option<f64>,
    /// RMSE in m/s on the holdout runs with the effects.
    pub rmse_after_mps: Option<f64>,
    /// The dataset's runs in their order.
    pub runs: Vec<RunTimeline>,
}

/// One run in time; times are in s in the recording's own time.
#[derive(Clone, Debug, PartialEq)]
pub struct RunTimeline {
    /// The run's file.
    pub file: String,
    /// Its place in the dataset, from 1.
    pub number: u32,
    /// Measured and predicted speeds, open loop from the run's first sample to its last.
    pub speeds: Vec<SpeedPoint>,
    /// The residual as a force, window by window.
    pub residuals: Vec<ResidualWindow>,
    /// Where the effects act, by time.
    pub effects: Vec<ActingEffect>,
}

/// Speeds at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedPoint {
    /// The moment in s.
    pub time_s: f64,
    /// Measured, in m/s.
    pub measured_mps: f64,
    /// Predicted without the effects, in m/s.
    pub before_mps: f64,
    /// Predicted with the effects, in m/s.
    pub after_mps: f64,
}

/// The resistance that a model lacks over about 20 s; positive retards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResidualWindow {
    /// First moment in s.
    pub from_s: f64,
    /// Last moment in s.
    pub to_s: f64,
    /// Without the effects, in N/kN.
    pub before_n_per_kn: f64,
    /// With the effects, in N/kN.
    pub after_n_per_kn: f64,
}

/// A section of a run in which an effect acts.
#[derive(Clone, Debug, PartialEq)]
pub struct ActingEffect {
    /// The effect's kind.
    pub kind: String,
    /// Its place among the effects found, from 1.
    pub number: u32,
    /// Kind, size and place in words.
    pub text: String,
    /// First moment in s.
    pub from_s: f64,
    /// Last moment in s.
    pub to_s: f64,
    /// Chainage of the train's centre at both, in m, where it is known.
    pub positions_m: Option<[f64; 2]>,
    /// Share of the open-loop error on the fit runs that goes when the effect is added last.
    pub error_reduction: f64,
    /// Probability that the search finds as much where nothing acts.
    pub p_value: f64,
}

impl Timeline {
    /// Returns the timeline of an explanation of a dataset.
    pub fn new(dataset: &Dataset, explanation: &Explanation) -> Self {
        let all = || explanation.problem.runs.iter().chain(&explanation.holdout);
        let of_file = |file: &str| all().find(|it| it.file == file);
        let of_run = |run: &crate::dataset::Run| {
            Some(RunTimeline::new(run.number, of_file(&run.file)?, explanation))
        };
        Timeline {
            verdict: explanation.answer.verdict,
            statement: explanation.answer.statement.clone(),
            rmse_before_mps: explanation.answer.rmse_before,
            rmse_after_mps: explanation.answer.rmse_after,
            runs: dataset.runs.iter().filter_map(of_run).collect(),
        }
    }
}

impl RunTimeline {
    fn new(number: u32, run: &RunData, explanation: &Explanation) -> Self {
        let simulated = (0..run.samples().len()).filter(|&i| run.recording.is_simulated(i));
        let [base, grown] = [&explanation.outcome.base, &explanation.outcome.fit]
            .map(|it| missing_resistance(it, run));
        let residuals = base.into_iter().zip(grown).map(|((span, before), (_, after))| {
            let bins = &run.bins[span.0..span.1];
            ResidualWindow {
                from_s: run.offset_s + bins[0].time_s,
                to_s: run.offset_s + bins[bins.len() - 1].time_s,
                before_n_per_kn: before,
                after_n_per_kn: after,
            }
        });
        RunTimeline {
            file: run.file.clone(),
            number,
            speeds: simulated.map(speeds(explanation, run)).collect(),
            residuals: residuals.collect(),
            effects: acting(run, explanation),
        }
    }
}

/// Returns the speeds at the samples of a run, by number; predicted open loop from its first sample to its last, anew
/// from each standstill.
fn speeds<'r>(
    explanation: &Explanation,
    run: &'r RunData,
) -> impl Fn(usize) -> SpeedPoint + use<'r> {
    let [before, after] = [&explanation.outcome.base, &explanation.outcome.fit]
        .map(|fit| predicted(fit, run, Restart::AtDepartures));
    move |i| SpeedPoint {
        time_s: run.offset_s + run.recording.time_s()[i],
        measured_mps: run.samples()[i].speed_mps,
        before_mps: before.speed_mps()[i],
        after_mps: after.speed_mps()[i],
    }
}

/// Returns where the effects act on a run, effect by effect.
fn acting(run: &RunData, explanation: &Explanation) -> Vec<ActingEffect> {
    let position_m = |time_s: f64| {
        let i = run.recording.time_s().partition_point(|&it| run.offset_s + it < time_s);
        run.samples().get(i)?.position_m
    };
    let mut acting = Vec::new();
    for (index, effect) in explanation.answer.effects.iter().enumerate() {
        for [from_s, to_s] in Zones::from_effect(effect).acting_s(run) {
            acting.push(ActingEffect {
                kind: effect.kind.into(),
                number: index as u32 + 1,
                text: described(effect),
                from_s,
                to_s,
                positions_m: position_m(from_s).zip(position_m(to_s)).map(<[f64; 2]>::from),
                error_reduction: effect.error_reduction,
                p_value: effect.p_value,
            });
        }
    }
    acting
}

/// Runs shown at most.
const TRACES_MAX: usize = 3;
/// Points of a run at most.
const POINTS_MAX: usize = 450;

/// One run, open loop from its first sample to its last and anew from each standstill.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    /// The run's file.
    pub file: String,
    /// Fit or holdout.
    pub role: Role,
    /// Stretches without a break, in order of time.
    pub pieces: Vec<Vec<SpeedPoint>>,
    /// Root mean square errors of these predictions in m/s without and with the effects.
    pub rmse_mps: Option<[f64; 2]>,
    /// Stretches of time in s in which an effect acts.
    pub acting_s: Vec<[f64; 2]>,
}

/// Returns the holdout runs with the greatest error before, the greatest first; fit runs when nothing was
/// held out.
pub fn traces(explanation: &Explanation) -> Vec<Trace> {
    let holdout = &explanation.holdout;
    let runs = if holdout.is_empty() { &explanation.problem.runs } else { holdout };
    let zones = zones(explanation);
    let mut ranked: Vec<(f64, &RunData)> = runs
        .iter()
        .map(|run| {
            let error = run_error(&explanation.outcome.base, run, Restart::AtDepartures);
            (error.rmse_mps().unwrap_or(0.0), run)
        })
        .collect();
    greatest_first(&mut ranked, |it| it.0);
    ranked.iter().take(TRACES_MAX).map(|(_, run)| trace(explanation, run, &zones)).collect()
}

fn trace(explanation: &Explanation, run: &RunData, zones: &Zones) -> Trace {
    let speeds = speeds(explanation, run);
    let count = run.samples().len();
    let every = count.div_ceil(POINTS_MAX).max(1);
    let mut pieces: Vec<Vec<SpeedPoint>> = vec![Vec::new()];
    for i in (0..count).step_by(every) {
        if !run.recording.is_simulated(i) {
            if pieces.last().is_some_and(|piece| !piece.is_empty()) {
                pieces.push(Vec::new());
            }
            continue;
        }
        if let Some(piece) = pieces.last_mut() {
            piece.push(speeds(i));
        }
    }
    pieces.retain(|piece| piece.len() > 1);
    let rmse = |fit: &Fit| run_error(fit, run, Restart::AtDepartures).rmse_mps();
    Trace {
        file: run.file.clone(),
        role: run.role,
        pieces,
        rmse_mps: rmse(&explanation.outcome.base)
            .zip(rmse(&explanation.outcome.fit))
            .map(|(b, a)| [b, a]),
        acting_s: zones.times_s(run),
    }
}
