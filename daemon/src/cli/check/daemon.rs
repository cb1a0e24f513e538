//! A daemon configuration in words: its trains, estimators and threads.

use std::collections::BTreeMap;
use std::path::Path;

use dynocar_dataset::SourcePosition;
use dynocar_shared::Quantity;
use serde::Serialize;

use crate::cli::Failure;
use crate::cli::text::{TextTable, line, short};
use crate::config::{DaemonConfig, TrainConfig};
use crate::shadow::rule::Adopt;

/// Reads a configuration with the train and track files that it names, and builds every estimator, so that a setting
/// out of range is found here and not when the daemon starts.
///
/// # Errors
///
/// The first mistake.
pub fn read(path: &Path) -> Result<DaemonConfig, Failure> {
    let config = DaemonConfig::load(path)?;
    for pipeline in &config.pipelines {
        for train in config.trains.iter().filter(|train| pipeline.trains.contains(&train.id)) {
            pipeline.estimator.build(&train.model).map_err(|error| {
                let label = path.display().to_string();
                let words = format!("{label}: pipelines.{}.settings.{error}", pipeline.name);
                Failure::At(SourcePosition::whole(&label), words)
            })?;
        }
    }
    Ok(config)
}

/// Returns the configuration in words and columns.
pub fn report(config: &DaemonConfig) -> String {
    let mut text = String::from("daemon\n");
    let root = config.process.root.as_ref().map(|root| root.display().to_string());
    text += &line("root", root.as_deref().unwrap_or("DYNOCAR_ROOT, else /tmp/dynocar-<user>"));
    text += &line(
        "adaptive",
        &format!("looks for samples for {} µs, then sleeps", config.process.spin_us),
    );
    text += &line("heartbeat", &format!("every {} ms", config.process.heartbeat_ms));
    let memory = if config.process.lock_memory { "locked" } else { "may be paged" };
    text += &line("memory", memory);
    if let Some(models) = &config.models {
        let rule = &models.rule;
        let by = match rule.adopt {
            Adopt::Ask => "adopted by hand",
            Adopt::WhenBetter => "adopted by the rule",
        };
        let gain = short(100.0 * rule.least_gain, 3);
        let trips = short(rule.trips_between_mistakes, 6);
        text += &line("models", &models.directory.display().to_string());
        text += &line(
            "",
            &format!(
                "{by} where {gain} % of the error or more are gained; at most one mistake in {trips} trips"
            ),
        );
    }

    let mut trains = TextTable::new(&["train", "name", "mass t", "line"], &[1, 3]);
    for train in &config.trains {
        let track = train.track.as_ref().map_or("not known", |track| &track.name);
        let mass_t = short(train.model.mass_kg / 1000.0, 3);
        trains.push(vec![train.id.to_string(), train.model.name.clone(), mass_t, track.into()]);
    }
    let mut pipelines = TextTable::new(
        &["pipeline", "name", "kind", "thread", "core", "idle", "priority", "trains"],
        &[1, 2, 3, 5, 6, 7],
    );
    for (index, pipeline) in config.pipelines.iter().enumerate() {
        let thread = &config.threads[pipeline.thread];
        let trains: Vec<_> = pipeline.trains.iter().map(ToString::to_string).collect();
        pipelines.push(vec![
            index.to_string(),
            pipeline.name.clone(),
            pipeline.estimator.kind().to_string(),
            thread.name.clone(),
            thread.core.map_or("any".into(), |core| core.to_string()),
            thread.idle.to_string(),
            thread.priority.map_or("ordinary".into(), |priority| format!("fifo {priority}")),
            trains.join(" "),
        ]);
    }
    let mut answers = TextTable::new(&["quantity", "answered for train", "by"], &[1, 2]);
    for train in &config.trains {
        for (quantity, name) in answers_of(config, train) {
            answers.push(vec![quantity.into(), train.id.to_string(), name.into()]);
        }
    }
    format!("{text}\n{trains}\n{pipelines}\n{answers}")
}

/// Returns each quantity that a train's controller may ask for, with the pipeline that answers.
fn answers_of<'a>(
    config: &'a DaemonConfig,
    train: &'a TrainConfig,
) -> impl Iterator<Item = (&'static str, &'a str)> {
    Quantity::ALL.iter().filter_map(|&quantity| {
        let pipeline_index = train.answers.pipeline_index(quantity)?;
        Some((quantity.name(), config.pipelines[pipeline_index].name.as_str()))
    })
}

/// A daemon configuration, machine-readable.
#[derive(Debug, Serialize)]
pub struct DaemonAnswer<'a> {
    trains: Vec<DaemonTrainAnswer<'a>>,
    pipelines: Vec<PipelineAnswer<'a>>,
}

#[derive(Debug, Serialize)]
struct DaemonTrainAnswer<'a> {
    id: u64,
    name: &'a str,
    track: Option<&'a str>,
    answers: BTreeMap<&'static str, &'a str>,
}

#[derive(Debug, Serialize)]
struct PipelineAnswer<'a> {
    name: &'a str,
    kind: &'static str,
    thread: &'a str,
    core: Option<usize>,
    idle: String,
    priority: Option<u8>,
    trains: Vec<u64>,
}

/// Returns the machine-readable form of a configuration.
pub fn answer(config: &DaemonConfig) -> DaemonAnswer<'_> {
    DaemonAnswer {
        trains: config
            .trains
            .iter()
            .map(|train| DaemonTrainAnswer {
                id: train.id.0,
                name: &train.model.name,
                track: train.track.as_ref().map(|track| track.name.as_str()),
                answers: answers_of(config, train).collect(),
            })
            .collect(),
        pipelines: config
            .pipelines
            .iter()
            .map(|pipeline| {
                let thread = &config.threads[pipeline.thread];
                PipelineAnswer {
                    name: &pipeline.name,
                    kind: pipeline.estimator.kind().name(),
                    thread: &thread.name,
                    core: thread.core,
                    idle: thread.idle.to_string(),
                    priority: thread.priority,
                    trains: pipeline.trains.iter().map(|train| train.0).collect(),
                }
            })
            .collect(),
    }
}
