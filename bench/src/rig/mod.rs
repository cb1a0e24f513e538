//! Tools for measurements of processes: separate run-time directories and cores; and the pipelines that a measurement
//! names on its command line or builds with default settings.
//!
//! - [`site`]: a run-time directory with a daemon, removed afterwards
//! - [`cores`]: cores and priorities; the kernel's counters of a process: processor time, memory, waits

pub mod cores;
pub mod site;

use std::sync::Arc;

use dynocar::config::is_slow;
use dynocar_core::pipeline::Pipeline;
use dynocar_core::pipeline::admission::Admission;
use dynocar_estimators::EstimatorSettings;
use dynocar_model::force::{ForceResolver, ResolvedSample};
use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;
use dynocar_shared::{PipelineKind, TrainId, TrainSample};

use crate::output::{BenchError, named};

/// Returns a pipeline of a kind with its default settings.
///
/// # Panics
///
/// When the kind cannot be built.
pub fn default_pipeline(
    kind: PipelineKind,
    id: TrainId,
    train: &Arc<TrainModel>,
    track: Option<Arc<Track>>,
) -> Pipeline {
    let settings = EstimatorSettings::default_of(kind).expect("the kind can be built");
    let estimator = settings.build(train).expect("default settings are in range");
    Pipeline::new(id, 0, Arc::clone(train), track, estimator)
}

/// Returns a function from samples of a train to the inputs of its estimators; `None` for a refused sample.
pub fn resolving(
    id: TrainId,
    train: &Arc<TrainModel>,
    track: Option<Arc<Track>>,
) -> impl FnMut(&TrainSample) -> Option<ResolvedSample> {
    let mut admission = Admission::new(id, Arc::clone(train));
    let mut resolver = ForceResolver::new(Arc::clone(train), track);
    move |sample| Some(resolver.resolve(&admission.validate(sample).ok()?))
}

/// Returns every pipeline that estimates and whose step is short: they may share a thread.
pub fn fast_pipelines() -> Vec<PipelineKind> {
    estimating().filter(|&kind| !is_slow(kind)).collect()
}

/// Returns every pipeline that now and then computes for long: they get threads of their own.
pub fn slow_pipelines() -> Vec<PipelineKind> {
    estimating().filter(|&kind| is_slow(kind)).collect()
}

fn estimating() -> impl Iterator<Item = PipelineKind> {
    PipelineKind::ALL
        .iter()
        .copied()
        .filter(|&kind| kind != PipelineKind::Echo && EstimatorSettings::default_of(kind).is_some())
}

/// Returns the pipelines of a list of names; `fast`, `slow` and `all` are groups.
///
/// # Errors
///
/// In words, with the names there are.
pub fn pipelines_by_names(names: &[String]) -> Result<Vec<PipelineKind>, BenchError> {
    let all: Vec<_> = estimating().map(|kind| (kind.name(), kind)).collect();
    match names {
        [name] if name == "all" => Ok([fast_pipelines(), slow_pipelines()].concat()),
        [name] if name == "fast" => Ok(fast_pipelines()),
        [name] if name == "slow" => Ok(slow_pipelines()),
        names => names.iter().map(|name| named("--pipelines", name, &all)).collect(),
    }
}
