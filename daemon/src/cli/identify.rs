//! `dynocar identify`: the daemon's pipelines over recorded runs.

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::Args;
use dynocar_core::pipeline::EstimatorSettings;
use dynocar_shared::{
    Parameter, ParameterSnapshot, PipelineKind, Reason, RejectionReason, TrainId,
};
use serde::Serialize;

use super::Failure;
use super::output::write_json;
use crate::dataset;
use crate::identify::{default_estimators, identify, published_samples};

/// Learn the train's parameters from recorded runs with the daemon's own pipelines.
#[derive(Debug, Args)]
pub struct IdentifyArguments {
    /// The dataset's folder
    dataset: PathBuf,
    /// Only this estimator, as v_mils; all of them by default
    #[arg(long, value_name = "NAME")]
    estimator: Option<String>,
    /// Write the result for machines; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

#[derive(Debug, Serialize)]
struct Answer {
    dataset: String,
    estimators: Vec<EstimatorAnswer>,
}

#[derive(Debug, Serialize)]
struct EstimatorAnswer {
    name: &'static str,
    status: &'static str,
    reason: &'static str,
    values: BTreeMap<&'static str, f64>,
    std: BTreeMap<&'static str, f64>,
    resistance: Vec<ResistancePoint>,
    samples: SampleCounts,
    updates: u64,
    innovation_mean_square: f64,
    innovation_correlation: f64,
    unexplained_force_n: f64,
    unexplained_force_std_n: f64,
}

#[derive(Debug, Serialize)]
struct ResistancePoint {
    speed_mps: f64,
    w0_n_per_kn: f64,
    std: f64,
}

#[derive(Debug, Serialize)]
struct SampleCounts {
    used: u64,
    rejected: BTreeMap<&'static str, u32>,
    lost: u64,
}

/// Runs the estimators and prints what they learned.
///
/// # Errors
///
/// A wrong dataset or estimator name is an input failure.
pub fn execute(arguments: &IdentifyArguments) -> Result<(), Failure> {
    let estimators = chosen_estimators(arguments.estimator.as_deref())?;
    let dataset =
        dataset::load(&arguments.dataset).map_err(|error| Failure::Input(error.to_string()))?;
    let samples = published_samples(&dataset, TrainId(1));
    let snapshots: Vec<_> = std::thread::scope(|scope| {
        let threads: Vec<_> = estimators
            .iter()
            .map(|settings| scope.spawn(|| identify(&dataset, &samples, settings)))
            .collect();
        threads.into_iter().map(|thread| thread.join().expect("an estimator")).collect()
    });
    let mut answers = Vec::new();
    for (settings, snapshot) in estimators.iter().zip(snapshots) {
        let snapshot = snapshot.map_err(|error| Failure::Input(error.to_string()))?;
        answers.push(answer(settings.kind(), &snapshot));
    }
    let answer = Answer { dataset: dataset.name.clone(), estimators: answers };
    match &arguments.json {
        Some(file) => write_json(file, &answer),
        None => {
            print_answer(&answer);
            Ok(())
        }
    }
}

fn chosen_estimators(name: Option<&str>) -> Result<Vec<EstimatorSettings>, Failure> {
    let all = default_estimators();
    let Some(name) = name else { return Ok(all) };
    let chosen: Vec<_> = all.iter().filter(|it| it.kind().name() == name).cloned().collect();
    if chosen.is_empty() {
        let names: Vec<_> = all.iter().map(|settings| settings.kind().name()).collect();
        let names = names.join(", ");
        return Err(Failure::Input(format!("--estimator {name}: expected one of {names}")));
    }
    Ok(chosen)
}

fn answer(kind: PipelineKind, snapshot: &ParameterSnapshot) -> EstimatorAnswer {
    let parameters = || Parameter::ALL.iter().filter(|&&it| snapshot.index_of(it).is_some());
    EstimatorAnswer {
        name: kind.name(),
        status: snapshot.status().name(),
        reason: snapshot.reason().unwrap_or(Reason::None).name(),
        values: parameters().filter_map(|&it| Some((it.name(), snapshot.value(it)?))).collect(),
        std: parameters().filter_map(|&it| Some((it.name(), snapshot.std(it)?))).collect(),
        resistance: resistance_points(snapshot),
        samples: SampleCounts {
            used: snapshot.samples_used,
            rejected: RejectionReason::ALL
                .iter()
                .map(|&reason| (reason.name(), snapshot.rejected(reason)))
                .filter(|&(_, count)| count > 0)
                .collect(),
            lost: snapshot.samples_lost,
        },
        updates: snapshot.updates,
        innovation_mean_square: snapshot.innovation_mean_square,
        innovation_correlation: snapshot.innovation_correlation,
        unexplained_force_n: snapshot.unexplained_force_n,
        unexplained_force_std_n: snapshot.unexplained_force_std_n,
    }
}

/// Resistance over the driven speeds in steps of 1 m/s.
fn resistance_points(snapshot: &ParameterSnapshot) -> Vec<ResistancePoint> {
    let (low, high) = (snapshot.speed_min_mps.ceil() as u32, snapshot.speed_max_mps.floor() as u32);
    (low..=high)
        .filter_map(|speed_mps| {
            let speed_mps = f64::from(speed_mps);
            let estimate = snapshot.resistance_at(speed_mps)?;
            Some(ResistancePoint {
                speed_mps,
                w0_n_per_kn: estimate.w0_n_per_kn,
                std: estimate.w0_std_n_per_kn,
            })
        })
        .collect()
}

fn print_answer(answer: &Answer) {
    println!("{}", answer.dataset);
    for it in &answer.estimators {
        let reason = if it.reason == "none" { String::new() } else { format!(", {}", it.reason) };
        let rejected: u32 = it.samples.rejected.values().sum();
        println!(
            "\n{} ({}{reason}): {} samples used, {rejected} rejected, {} lost, {} updates",
            it.name, it.status, it.samples.used, it.samples.lost, it.updates
        );
        for (reason, count) in &it.samples.rejected {
            println!("    rejected as {reason}: {count}");
        }
        for (name, value) in &it.values {
            let std = it.std.get(name).copied().unwrap_or(f64::NAN);
            println!("    {name:<24} {value:>12.6} ± {:.6}", 1.96 * std);
        }
        let step = (it.resistance.len() / 6).max(1);
        for point in it.resistance.iter().step_by(step) {
            println!(
                "    w0 at {:>5.1} m/s          {:>12.4} ± {:.4} N/kN",
                point.speed_mps,
                point.w0_n_per_kn,
                1.96 * point.std
            );
        }
    }
    println!("\n± is the half width of the 95 % interval");
}
