//! Which pipelines a measurement names.

use dynocar::config::is_slow;
use dynocar_estimators::EstimatorSettings;
use dynocar_shared::PipelineKind;

/// Every pipeline that estimates and whose step is short: they may share a thread.
pub fn fast() -> Vec<PipelineKind> {
    estimating().filter(|&kind| !is_slow(kind)).collect()
}

/// Every pipeline that now and then computes for long: they get threads of their own.
pub fn slow() -> Vec<PipelineKind> {
    estimating().filter(|&kind| is_slow(kind)).collect()
}

fn estimating() -> impl Iterator<Item = PipelineKind> {
    PipelineKind::ALL
        .iter()
        .copied()
        .filter(|&kind| kind != PipelineKind::Echo && EstimatorSettings::default_of(kind).is_some())
}

/// The pipelines of a list of names.
///
/// # Errors
///
/// In words, with the names there are.
pub fn by_names(names: &[String]) -> Result<Vec<PipelineKind>, String> {
    names
        .iter()
        .map(|name| {
            PipelineKind::from_name(name)
                .filter(|&kind| EstimatorSettings::default_of(kind).is_some())
                .ok_or_else(|| {
                    let known: Vec<_> = estimating().map(|kind| kind.name()).collect();
                    format!("{name}: expected one of {}", known.join(", "))
                })
        })
        .collect()
}
