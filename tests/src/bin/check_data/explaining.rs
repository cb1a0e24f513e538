//! Answers of `dynocar explain` on the practice runs, against their truth files: verdict and kind, parameters,
//! place, and the share of the error that a fit of the true effect removes.

use std::path::Path;

use dynocar::dataset;
use dynocar_analysis::explain::explain;
use serde_json::Value;

use super::Report;
use super::truth::Truth;

/// Smallest share of the reduction of the error that knowing the effect gives.
const SHARE_MIN: f64 = 0.85;
/// Largest error of a parameter, over the size of the effect.
const PARAMETER_ERROR_MAX: f64 = 0.15;
/// Smallest intersection over union of the windows of time.
const IOU_MIN: f64 = 0.7;
/// Graded parameters, with the value that means no effect.
const GRADED: [(&str, f64); 4] =
    [("c_factor", 1.0), ("force_n", 0.0), ("wind_plus_mps", 0.0), ("k_n_per_kn_m", 600.0)];
/// Datasets of other simulators, with the kinds that their verdict must name.
const INDEPENDENT: [(&str, &[&str]); 3] =
    [("flirt-stgallen", &["curve_resistance"]), ("intermodal", &[]), ("yizhuang-metro", &[])];

/// Explains all practice datasets and the other simulators'.
pub fn check(report: &mut Report, folder: &Path) {
    for name in ["p01", "p02", "p03", "p04", "p05"] {
        let outcome = Truth::read(folder, name).and_then(|truth| {
            let answer = answer(&folder.join("practice").join(name))?;
            against(&answer, &truth)
        });
        report.note(&format!("{name}: explained"), outcome);
    }
    for (name, expected) in INDEPENDENT {
        let outcome = answer(&folder.join("independent").join(name)).and_then(|answer| {
            let kinds = kinds(&answer);
            if kinds == expected { Ok(sentence(&answer)) } else { Err(sentence(&answer)) }
        });
        report.note(&format!("{name}: explained"), outcome);
    }
}

fn answer(folder: &Path) -> Result<Value, String> {
    let dataset = dataset::load(folder).map_err(|error| error.to_string())?;
    let explanation = explain(&dataset, &|_, _| {}).map_err(|error| error.to_string())?;
    serde_json::to_value(&explanation.answer).map_err(|error| error.to_string())
}

fn kinds(answer: &Value) -> Vec<&str> {
    let effects = answer["effects"].as_array().into_iter().flatten();
    effects.filter_map(|effect| effect["kind"].as_str()).collect()
}

fn sentence(answer: &Value) -> String {
    let error = |key: &str| answer[key].as_f64().unwrap_or(f64::NAN);
    let (before, after) = (error("rmse_before"), error("rmse_after"));
    format!("{} {:?}, {before:.4} to {after:.4} m/s", answer["verdict"], kinds(answer))
}

fn against(answer: &Value, truth: &Truth) -> Result<String, String> {
    let mut detail = sentence(answer);
    if answer["verdict"] != truth.verdict.as_str() || kinds(answer) != truth.kinds() {
        return Err(detail);
    }
    let mut is_good = true;
    for (effect, found) in truth.effects.iter().zip(answer["effects"].as_array().unwrap()) {
        for (name, none) in GRADED {
            let number = |it: &Value| it["parameters"][name].as_f64();
            if let (Some(true_value), Some(value)) = (number(effect), number(found)) {
                let error = (value - true_value) / (true_value - none);
                detail += &format!(", {name} {:+.1} %", 100.0 * error);
                is_good &= error.abs() <= PARAMETER_ERROR_MAX;
            }
        }
        if let Some(iou) = truth.window_iou(effect, found) {
            detail += &format!(", IoU {iou:.2}");
            is_good &= iou >= IOU_MIN;
        }
    }
    let number = |key: &str| answer[key].as_f64().ok_or(format!("no {key}"));
    if !truth.effects.is_empty() {
        let gained = number("rmse_before")? - number("rmse_after")?;
        let share = gained / truth.attainable_mps;
        detail += &format!(", {:.0} % of the attainable reduction", 100.0 * share);
        is_good &= share >= SHARE_MIN;
    }
    if is_good { Ok(detail) } else { Err(detail) }
}
