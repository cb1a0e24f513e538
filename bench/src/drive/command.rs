//! `dynocar-bench drive`.

use std::path::{Path, PathBuf};

use clap::Args;
use dynocar::output::{report_line, write_file};

use super::line::{Condition, Service};
use super::run::{Extent, Informant, drive as drive_all};
use super::score::{Scored, score};
use super::{csv, picture, table};
use crate::output::{give, write_csv};
use crate::parallel;
use crate::rig::RigError;
use crate::scenarios::world::Traffic;

/// What a controller gains: an automatic driver with declared parameters, with the daemon's answers, and
/// with the true ones.
///
/// Exit status 1 where the driver with Dynocar is worse than with declared parameters.
#[derive(Debug, Args)]
pub struct DriveArguments {
    /// Trains for each scenario, each with a seed of its own
    #[arg(long, default_value_t = 20)]
    trains: usize,
    /// Stops of each train
    #[arg(long, default_value_t = 10)]
    stops: usize,
    /// The first seed
    #[arg(long, default_value_t = 1)]
    first_seed: u64,
    /// Only scenarios whose name contains this, as metro or 'wet rail'
    #[arg(long, value_name = "TEXT", default_value = "")]
    scenario: String,
    /// The controller's cycle in ms; else 50 for metro and 200 for the others, and a metro with 10
    #[arg(long, value_name = "MS")]
    cycle_ms: Option<u32>,
    /// Scenarios at a time
    #[arg(long, default_value_t = 2)]
    threads: usize,
    /// Write the result for machines; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write the drives as CSV; FILE_answers and FILE_differences beside it
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write the picture of the ordinary scenarios, as SVG
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
}

/// Every scenario.
fn services(cycle_ms: Option<u32>) -> Vec<Service> {
    let all = [Traffic::Metro, Traffic::Emu, Traffic::HighSpeed, Traffic::Freight];
    let of = |traffic: Traffic| {
        let usual_ms = if traffic == Traffic::Metro { 50 } else { 200 };
        let cycle_ms = cycle_ms.unwrap_or(usual_ms);
        Condition::ALL.map(|condition| Service { traffic, condition, cycle_ms })
    };
    let fast = Service { traffic: Traffic::Metro, condition: Condition::Ordinary, cycle_ms: 10 };
    all.into_iter().flat_map(of).chain(cycle_ms.is_none().then_some(fast)).collect()
}

/// Runs the command; an error has its text and the exit status.
pub fn drive(arguments: &DriveArguments) -> Result<(), (String, u8)> {
    let mut chosen = services(arguments.cycle_ms);
    chosen.retain(|service| service.name().contains(&arguments.scenario));
    if chosen.is_empty() {
        let text = &arguments.scenario;
        return Err((format!("--scenario {text}: expected a part of a scenario's name"), 2));
    }
    if arguments.trains == 0 || arguments.stops == 0 {
        return Err(("--trains and --stops: expected more than 0".into(), 2));
    }
    if let Some(cycle_ms) = arguments.cycle_ms
        && !(10..=200).contains(&cycle_ms)
    {
        return Err((format!("--cycle-ms {cycle_ms}: expected 10 to 200"), 2));
    }
    let extent = Extent {
        trains: arguments.trains,
        stops: arguments.stops,
        first_seed: arguments.first_seed,
    };
    let scored: Result<Vec<Scored>, RigError> =
        parallel::over(&chosen, arguments.threads, |service| measure(*service, extent))
            .into_iter()
            .collect();
    let scored = scored.map_err(|error| (error.to_string(), 1))?;
    if let Some(file) = &arguments.picture {
        // One row of each traffic; that of its usual cycle comes first.
        let mut ordinary: Vec<(Traffic, Scored)> = Vec::new();
        for (service, it) in chosen.iter().zip(&scored) {
            let is_drawn = ordinary.iter().any(|(traffic, _)| *traffic == service.traffic);
            if service.condition == Condition::Ordinary && !is_drawn {
                ordinary.push((service.traffic, it.clone()));
            }
        }
        let ordinary: Vec<Scored> = ordinary.into_iter().map(|(_, it)| it).collect();
        let drawn = picture::svg(&ordinary).map_err(|error| (error.to_string(), 1))?;
        write_file(file, &drawn).map_err(|error| (error.to_string(), 1))?;
    }
    if let Some(file) = &arguments.csv {
        write_csv(file, &csv::drives(&scored))?;
        write_csv(&beside(file, "answers"), &csv::answers(&scored))?;
        write_csv(&beside(file, "differences"), &csv::differences(&scored))?;
    }
    give(&arguments.json, &scored, || table::tables(&scored))?;
    let broken: Vec<String> = scored
        .iter()
        .filter(|it| it.comparison.is_broken)
        .map(|it| format!("{}: {}", it.comparison.scenario, it.comparison.listed(false).join("; ")))
        .collect();
    match broken.is_empty() {
        true => Ok(()),
        false => Err((format!("worse with Dynocar:\n{}", broken.join("\n")), 1)),
    }
}

/// A file next to another: `gain_answers.csv` to `gain.csv`.
fn beside(file: &Path, what: &str) -> PathBuf {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    file.with_file_name(format!("{stem}_{what}.csv"))
}

fn measure(service: Service, extent: Extent) -> Result<Scored, RigError> {
    let mut all = [Vec::new(), Vec::new(), Vec::new()];
    for (driven, informant) in all.iter_mut().zip(Informant::ALL) {
        *driven = drive_all(service, informant, extent)?;
    }
    report_line(&format!("{}: done", service.name()));
    Ok(score(service, &all))
}
