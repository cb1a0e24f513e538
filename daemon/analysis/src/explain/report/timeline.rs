//! An explanation as events and series in time, run by run: what lies beside the data on a timeline.

use serde::{Deserialize, Serialize};

use super::effect::described;
use super::panels::Zones;
use super::traces::predicted;
use super::windows::missing_resistance;
use crate::dataset::Dataset;
use crate::explain::Explanation;
use crate::explain::answer::Verdict;
use crate::explain::evidence::RunData;

/// An explanation in time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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

/// One run in time; times are in s in the recording's own count.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
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
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
    /// The timeline of an explanation of a dataset.
    pub fn of(dataset: &Dataset, explanation: &Explanation) -> Self {
        let all = || explanation.problem.runs.iter().chain(&explanation.holdout);
        let of_file = |file: &str| all().find(|it| it.file == file);
        let of_run = |run: &crate::dataset::Run| {
            Some(RunTimeline::of(run.number, of_file(&run.file)?, explanation))
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
    fn of(number: u32, run: &RunData, explanation: &Explanation) -> Self {
        let [before, after] = [&explanation.base, &explanation.grown].map(|it| predicted(it, run));
        let (samples, time_s) = (run.samples(), run.recording.time_s());
        let simulated = (0..samples.len()).filter(|&i| run.recording.is_simulated(i));
        let speeds = simulated.map(|i| SpeedPoint {
            time_s: run.offset_s + time_s[i],
            measured_mps: samples[i].speed_mps,
            before_mps: before.speed_mps()[i],
            after_mps: after.speed_mps()[i],
        });
        let [base, grown] =
            [&explanation.base, &explanation.grown].map(|it| missing_resistance(it, run));
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
            speeds: speeds.collect(),
            residuals: residuals.collect(),
            effects: acting(run, explanation),
        }
    }
}

/// Where the effects act on a run, effect by effect.
fn acting(run: &RunData, explanation: &Explanation) -> Vec<ActingEffect> {
    let position_m = |time_s: f64| {
        let i = run.recording.time_s().partition_point(|&it| run.offset_s + it < time_s);
        run.samples().get(i)?.position_m
    };
    let mut acting = Vec::new();
    for (index, effect) in explanation.answer.effects.iter().enumerate() {
        for [from_s, to_s] in Zones::of(effect).acting_s(run) {
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
