//! `dynocar health`: is the daemon well? For supervisors, probes and people.

use std::path::PathBuf;

use clap::Args;
use dynocar_shared::TrainId;
use dynocar_transport::{Peer, Role};

use super::Failure;
use crate::config::DaemonConfig;
use crate::operator::refused_words;
use crate::output::{print, report_line};
use crate::supervision::health::{TrainHealth, Verdict, look_at};

/// Report whether the daemon is well, by an exit status for each verdict.
///
/// Without options it asks about all trains that any daemon of this host serves. The exit status is the
/// worst verdict: 0 ok, 3 degraded, 4 stale, 5 incompatible daemon, 6 no daemon (1 and 2 as for every command).
#[derive(Debug, Args)]
pub struct HealthArguments {
    /// The daemon's configuration: its root, all its trains
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Only this train
    #[arg(long, value_name = "ID")]
    train: Option<u64>,
}

/// Looks at the daemon and prints a line for each train and pipeline.
///
/// # Errors
///
/// The worst verdict of all trains unless it is ok; an unusable configuration or directory.
pub fn execute(arguments: &HealthArguments) -> Result<(), Failure> {
    let config = arguments.config.as_deref().map(DaemonConfig::load_to_observe).transpose()?;
    if let (Some(train), Some(config)) = (arguments.train, &config)
        && !config.trains.iter().any(|it| it.id == TrainId(train))
    {
        let own: Vec<String> = config.trains.iter().map(|it| it.id.to_string()).collect();
        let words = format!("--train {train}: the configuration has {}", own.join(", "));
        return Err(Failure::input(words));
    }
    let host = DaemonConfig::host_of(config.as_ref()).map_err(Failure::work)?;
    let trains: Vec<TrainId> = match (arguments.train, &config) {
        (Some(train), _) => vec![TrainId(train)],
        (None, Some(config)) => config.trains.iter().map(|train| train.id).collect(),
        (None, None) => Peer::trains(&host, Role::Daemon).map_err(Failure::work)?,
    };
    let (mut worst, mut text) = (Verdict::Ok, String::new());
    if trains.is_empty() {
        let root = host.root().display();
        worst = Verdict::NoDaemon;
        text = format!("no daemon: nobody serves any train under {root}\n");
        text += &to_do(worst.remedy());
    }
    for train in trains {
        let health = look_at(&host, train).map_err(Failure::work)?;
        text += &lines_of(&health);
        worst = worst.max(health.verdict);
    }
    if let Err(error) = print(&text) {
        // The exit status is the verdict, whether or not it can be printed in words.
        report_line(&format!("dynocar: {error}"));
    }
    if worst == Verdict::Ok { Ok(()) } else { Err(Failure::Verdict(worst.exit_status())) }
}

fn lines_of(health: &TrainHealth) -> String {
    let daemon = health.daemon.as_deref().unwrap_or("nobody serves it");
    let mut text = format!("train {}: {}: {daemon}\n", health.train, health.verdict.name());
    if !health.pipelines.is_empty() {
        text += &format!("  samples: {}\n", health.samples_in_words());
    }
    for it in &health.pipelines {
        let (kind, words, age_ms) = (it.kind, it.in_words(), it.age_ms);
        text += &format!("  pipeline {} ({kind}): {words}; vouched {age_ms} ms ago", it.index);
        if let Some(suspicion) = it.suspicion {
            text += &format!("; suspected: {suspicion}, {}", suspicion.force());
        }
        if !it.refused.is_empty() {
            text += &format!("; refused: {}", refused_words(&it.refused));
        }
        text.push('\n');
    }
    text + &to_do(health.remedy())
}

fn to_do(remedy: &str) -> String {
    format!("  to do: {remedy}\n")
}
