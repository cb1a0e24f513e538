//! `dynocar-bench drive`.

use std::path::PathBuf;

use clap::Args;
use dynocar::output::{report_line, write_file};

use super::line::{Condition, Service};
use super::run::{Extent, Informant, drive as drive_all};
use super::score::{Scored, score};
use super::{picture, records};
use crate::output::{Failure, Record, expect, give, table, write_csv};
use crate::parallel;
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

impl DriveArguments {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// When the command line is wrong, a process fails, or the driver with Dynocar is worse.
    pub fn run(&self) -> Result<(), Failure> {
        let mut chosen = services(self.cycle_ms);
        chosen.retain(|service| service.name().contains(&self.scenario));
        expect(!chosen.is_empty(), || {
            format!("--scenario {}: expected a part of a scenario's name", self.scenario)
        })?;
        expect(self.trains > 0 && self.stops > 0, || {
            "--trains and --stops: expected more than 0".into()
        })?;
        let cycle_ms = self.cycle_ms.unwrap_or(50);
        expect((10..=200).contains(&cycle_ms), || {
            format!("--cycle-ms {cycle_ms}: expected 10 to 200")
        })?;
        let extent = Extent { trains: self.trains, stops: self.stops, first_seed: self.first_seed };
        let scored = parallel::over(&chosen, self.threads, |service| measure(*service, extent));
        let scored = scored.into_iter().collect::<Result<Vec<Scored>, _>>()?;
        if let Some(file) = &self.picture {
            write_file(file, &picture::svg(&ordinary(&chosen, &scored))?)?;
        }
        let lines = scored.iter().flat_map(|it| &it.lines).map(records::drive);
        let answers = scored.iter().flat_map(|it| &it.answers).map(records::answer);
        let differences = scored.iter().flat_map(|it| records::differences(&it.comparison));
        let tables: [Vec<Record>; 3] = [lines.collect(), answers.collect(), differences.collect()];
        if let Some(file) = &self.csv {
            let stem = file.file_stem().unwrap_or_default().to_string_lossy();
            for (ending, records) in ["", "_answers", "_differences"].iter().zip(&tables) {
                write_csv(&file.with_file_name(format!("{stem}{ending}.csv")), records)?;
            }
        }
        give(&self.json, &scored, || tables.each_ref().map(|it| table(it)).join("\n"))?;
        let broken: Vec<String> = scored
            .iter()
            .filter(|it| it.comparison.is_broken)
            .map(|it| format!("{}: {}", it.comparison.scenario, it.comparison.worse()))
            .collect();
        match broken.is_empty() {
            true => Ok(()),
            false => Err(format!("worse with Dynocar:\n{}", broken.join("\n")).into()),
        }
    }
}

/// The ordinary service of each traffic; that of its usual cycle comes first.
fn ordinary(chosen: &[Service], scored: &[Scored]) -> Vec<Scored> {
    let is_ordinary = |service: &Service| service.condition == Condition::Ordinary;
    let all = chosen.iter().zip(scored).filter(|(service, _)| is_ordinary(service));
    let mut first: Vec<(Traffic, Scored)> = Vec::new();
    for (service, it) in all {
        if first.iter().all(|(traffic, _)| *traffic != service.traffic) {
            first.push((service.traffic, it.clone()));
        }
    }
    first.into_iter().map(|(_, it)| it).collect()
}

fn measure(service: Service, extent: Extent) -> Result<Scored, Failure> {
    let mut all = [Vec::new(), Vec::new(), Vec::new()];
    for (driven, informant) in all.iter_mut().zip(Informant::ALL) {
        *driven = drive_all(service, informant, extent)?;
    }
    report_line(&format!("{}: done", service.name()));
    Ok(score(service, &all))
}
