//! The section `[models]`: the store, and what becomes of models on trial.

use std::path::Path;

use super::error::Checker;
use super::raw::RawModels;
use super::{ConfigError, ModelsConfig};
use crate::models::ModelHash;
use crate::shadow::rule::Rule;

/// Checks the section; the directory must be there when the daemon starts.
pub(super) fn check(checker: &Checker, raw: RawModels) -> Result<ModelsConfig, ConfigError> {
    let folder = checker.path.parent().unwrap_or(Path::new("."));
    let directory = folder.join(&raw.directory);
    if !directory.is_dir() {
        let given = raw.directory.display();
        return checker.refuse("models.directory", given, "an existing directory");
    }
    let is_within = |value: f64, low: f64, high: f64| (low..=high).contains(&value);
    if !is_within(raw.least_gain, 0.0, 0.9) {
        let allowed = "a share of the error, 0 to 0.9";
        return checker.refuse("models.least_gain", raw.least_gain, allowed);
    }
    if !is_within(raw.trips_between_mistakes, 20.0, 1e12) {
        let (key, given) = ("models.trips_between_mistakes", raw.trips_between_mistakes);
        return checker.refuse(key, given, "20 to 1e12 trips");
    }
    for (key, [low, high]) in &raw.bounds {
        if !(low.is_finite() && high.is_finite() && low <= high) {
            let key = format!("models.bounds.{key:?}");
            return checker.refuse(
                key,
                format!("[{low}, {high}]"),
                "the least value, then the greatest",
            );
        }
    }
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    if let Some(core) = raw.core.filter(|&core| core >= cores) {
        let allowed = format!("a core of this machine, 0 to {}", cores - 1);
        return checker.refuse("models.core", core, allowed);
    }
    Ok(ModelsConfig {
        directory,
        rule: Rule {
            adopt: raw.adopt,
            least_gain: raw.least_gain,
            trips_between_mistakes: raw.trips_between_mistakes,
            bounds: raw.bounds,
        },
        candidates_max: checker.range("models.candidates_max", raw.candidates_max, 0, 8)? as usize,
        core: raw.core,
        interval_s: checker.range("models.interval_s", raw.interval_s, 1, 3_600)?,
    })
}

/// Checks the models that a train names to be tried.
pub(super) fn candidates(
    checker: &Checker,
    names: Option<Vec<String>>,
) -> Result<Option<Vec<ModelHash>>, ConfigError> {
    let hash = |name: String| match name.parse() {
        Ok(hash) => Ok(hash),
        Err(_) => checker.refuse(
            "trains.candidates",
            name,
            "the hash of a model, 16 hexadecimal digits, as `dynocar models list` names it",
        ),
    };
    names.map(|names| names.into_iter().map(hash).collect()).transpose()
}
