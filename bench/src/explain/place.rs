//! The place of an answer against the truth.

use dynocar_tests::simulator::{SimulatedDataset, SimulatedRun, TrueEffect};
use serde_json::Value;

fn pairs(value: &Value) -> Vec<[f64; 2]> {
    let list = value.as_array().into_iter().flatten();
    list.filter_map(|pair| Some([pair[0].as_f64()?, pair[1].as_f64()?])).collect()
}

/// The windows of a place on one axis for all runs, each far from the next.
fn windows(place: &Value, simulated: &SimulatedDataset) -> Vec<[f64; 2]> {
    let window = |it: &Value| {
        let is_own = |run: &SimulatedRun| !run.plan.is_holdout && it["run"] == run.plan.file();
        let from_s = 1e5 * simulated.runs.iter().position(is_own)? as f64;
        Some([from_s + it["t_start_s"].as_f64()?, from_s + it["t_end_s"].as_f64()?])
    };
    place["windows"].as_array().into_iter().flatten().filter_map(window).collect()
}

/// Intersection over union of the true and the found place, where the effect has one.
pub fn place_iou(effect: &TrueEffect, own: &Value, simulated: &SimulatedDataset) -> Option<f64> {
    let (truth, found) = (effect.place(0.0), &own["where"]);
    if truth["windows"].is_array() {
        return Some(iou(&windows(&truth, simulated), &windows(found, simulated)));
    }
    let truth = truth["intervals_m"].as_array().map(|_| pairs(&truth["intervals_m"]))?;
    Some(iou(&truth, &pairs(&found["intervals_m"])))
}

/// Intersection over union of two sets of disjoint intervals.
fn iou(truth: &[[f64; 2]], found: &[[f64; 2]]) -> f64 {
    let length = |set: &[[f64; 2]]| set.iter().map(|[from, to]| to - from).sum::<f64>();
    let both: f64 = truth
        .iter()
        .flat_map(|[from, to]| {
            found.iter().map(move |[start, end]| (to.min(*end) - from.max(*start)).max(0.0))
        })
        .sum();
    both / (length(truth) + length(found) - both)
}

/// Whether the 95 % intervals of the ends of a place hold the true ends. An end of an interval is
/// compared with that of the true one which it overlaps most.
pub fn ends_within(effect: &TrueEffect, own: &Value) -> Vec<bool> {
    let known = &own["where"]["uncertainty_95"];
    let holds = |interval: &Value, truth: f64| {
        let [low, high] = [interval[0].as_f64(), interval[1].as_f64()];
        low.zip(high).is_some_and(|(low, high)| low <= truth && truth <= high)
    };
    let truth = effect.place(0.0);
    let intervals_m = pairs(&truth["intervals_m"]);
    let listed = |list: &str| known[list].as_array().into_iter().flatten();
    let mut held = Vec::new();
    for ([from, to], interval) in
        pairs(&own["where"]["intervals_m"]).into_iter().zip(listed("intervals_m"))
    {
        let overlap = |[low, high]: &[f64; 2]| high.min(to) - low.max(from);
        let nearest = intervals_m
            .iter()
            .max_by(|one, other| overlap(one).total_cmp(&overlap(other)))
            .filter(|nearest| overlap(nearest) > 0.0);
        if let Some(&[low, high]) = nearest {
            held.extend([holds(&interval[0], low), holds(&interval[1], high)]);
        }
    }
    for found in listed("windows") {
        let mut truths = truth["windows"].as_array().into_iter().flatten();
        let start_s =
            truths.find(|it| it["run"] == found["run"]).and_then(|it| it["t_start_s"].as_f64());
        held.extend(start_s.map(|start_s| holds(&found["t_start_s"], start_s)));
    }
    held
}
