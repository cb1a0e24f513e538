//! The place of an answer against the truth.

use dynocar_tests::simulator::run_file::run_file;
use dynocar_tests::simulator::{Effect, SimulatedDataset};
use serde_json::Value;

fn pairs(value: &Value) -> Vec<[f64; 2]> {
    let list = value.as_array().into_iter().flatten();
    list.filter_map(|pair| Some([pair[0].as_f64()?, pair[1].as_f64()?])).collect()
}

/// Intersection over union of the true and the found place, where the effect has one.
pub fn place_iou(effect: &Effect, own: &Value, simulated: &SimulatedDataset) -> Option<f64> {
    match effect {
        Effect::LocalResistance { intervals_m, .. } | Effect::LowAdhesion { intervals_m, .. }
            if !intervals_m.is_empty() =>
        {
            let truth: Vec<[f64; 2]> = intervals_m.iter().map(|&(from, to)| [from, to]).collect();
            Some(iou(&truth, &pairs(&own["where"]["intervals_m"])))
        }
        Effect::DraggingBrake { windows, .. } => {
            let (mut truth, mut found) = (Vec::new(), Vec::new());
            for (number, run) in simulated.runs.iter().enumerate() {
                if run.plan.is_holdout {
                    continue;
                }
                // One axis for all runs, each far from the next.
                let on_axis = |ends_s: [f64; 2]| ends_s.map(|it| 1e5 * number as f64 + it);
                let of_run = windows.iter().filter(|window| window.run == number);
                truth.extend(of_run.map(|it| on_axis([it.start_s, it.end_s])));
                let listed = own["where"]["windows"].as_array().into_iter().flatten();
                let of_run = listed.filter(|window| window["run"] == run.plan.file());
                let ends_s =
                    |it: &Value| Some([it["t_start_s"].as_f64()?, it["t_end_s"].as_f64()?]);
                found.extend(of_run.filter_map(ends_s).map(on_axis));
            }
            Some(iou(&truth, &found))
        }
        _ => None,
    }
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
pub fn ends_within(effect: &Effect, own: &Value) -> Vec<bool> {
    let known = &own["where"]["uncertainty_95"];
    let holds = |interval: &Value, truth: f64| {
        let [low, high] = [interval[0].as_f64(), interval[1].as_f64()];
        low.zip(high).is_some_and(|(low, high)| low <= truth && truth <= high)
    };
    match effect {
        Effect::LocalResistance { intervals_m, .. } | Effect::LowAdhesion { intervals_m, .. } => {
            let found = pairs(&own["where"]["intervals_m"]);
            let intervals = known["intervals_m"].as_array().into_iter().flatten();
            let mut held = Vec::new();
            for ([from, to], interval) in found.into_iter().zip(intervals) {
                let overlap = |true_m: &&(f64, f64)| true_m.1.min(to) - true_m.0.max(from);
                let nearest = intervals_m
                    .iter()
                    .max_by(|one, other| overlap(one).total_cmp(&overlap(other)))
                    .filter(|nearest| overlap(nearest) > 0.0);
                if let Some(&(low, high)) = nearest {
                    held.extend([holds(&interval[0], low), holds(&interval[1], high)]);
                }
            }
            held
        }
        Effect::DraggingBrake { windows, .. } => {
            let intervals = known["windows"].as_array().into_iter().flatten();
            intervals
                .filter_map(|found| {
                    let own = windows.iter().find(|window| found["run"] == run_file(window.run))?;
                    Some(holds(&found["t_start_s"], own.start_s))
                })
                .collect()
        }
        _ => Vec::new(),
    }
}
