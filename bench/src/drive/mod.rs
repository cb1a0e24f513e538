//! Gain of a controller: an automatic driver with declared parameters, with the daemon's answers, and with the true
//! ones.
//!
//! - [`answers`]: the daemon's answers as parameters of the driver, and their errors
//! - [`knowledge`]: beliefs of a driver about its train, and the train's abilities
//! - [`braking`]: the braking curve to the stopping point
//! - [`plan`]: the line as the map has it, and the speed profile for the timetable with the least energy
//! - [`driver`]: tracking the plan and the braking curve
//! - [`deviations`]: brakes, rails, wind, tunnels, curves and loads that the world of ordinary mistakes lacks
//! - [`train`]: the simulated train, whose true parameters no estimator sees
//! - [`journey`]: a train and its driver from stop to stop
//! - [`link`]: channels to a separate daemon, in lock-step
//! - [`run`]: all trains of a service with one kind of parameters
//! - [`score`], [`picture`]: the result

pub mod deviations;
pub mod driver;
pub mod journey;
pub mod knowledge;
pub mod link;
pub mod plan;
pub mod run;
pub mod score;
pub mod train;

use std::path::PathBuf;

use clap::Args;
use dynocar::output::{report_line, write_file};
use serde_json::json;

use self::deviations::{CONDITIONS, ORDINARY, Service};
use self::run::{DriveExtent, Informant};
use self::score::Scored;
use crate::ending;
use crate::output::{
    BenchError, OutputArguments, Record, containing, expect, expect_none, table, write_csv,
};
use crate::scenarios::world::Traffic;

/// Measures the gain of a controller: an automatic driver with declared parameters, with the daemon's answers, and
/// with the true ones.
///
/// Exit status 1 where the driver with Dynocar is worse than with declared parameters.
#[derive(Debug, Args)]
pub struct DriveArguments {
    #[command(flatten)]
    extent: DriveExtent,
    /// Only scenarios whose name contains this, as metro or 'wet rail'
    #[arg(long, value_name = "TEXT", default_value = "")]
    scenario: String,
    /// The controller's cycle in ms; else 50 for metro and 200 for the others, and a metro with 10
    #[arg(long, value_name = "MS")]
    cycle_ms: Option<u32>,
    /// Scenarios at a time
    #[arg(long, default_value_t = 2)]
    threads: usize,
    #[command(flatten)]
    output: OutputArguments,
    /// Write the drives as CSV; FILE_answers and FILE_differences next to it
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write the picture of the ordinary scenarios, as SVG
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
}

/// Returns every scenario.
fn services(cycle_ms: Option<u32>) -> Vec<Service> {
    let all = [Traffic::Metro, Traffic::Emu, Traffic::HighSpeed, Traffic::Freight];
    let of = |traffic: Traffic| {
        let usual_ms = if traffic == Traffic::Metro { 50 } else { 200 };
        let cycle_ms = cycle_ms.unwrap_or(usual_ms);
        CONDITIONS.map(|condition| Service { traffic, condition, cycle_ms })
    };
    let fast = Service { traffic: Traffic::Metro, condition: ORDINARY, cycle_ms: 10 };
    all.into_iter().flat_map(of).chain(cycle_ms.is_none().then_some(fast)).collect()
}

impl DriveArguments {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// When the command line is wrong, a process fails, or the driver with Dynocar is worse.
    pub fn run(&self) -> Result<(), BenchError> {
        let extent = self.extent;
        let all = services(self.cycle_ms);
        let chosen = containing("--scenario", &self.scenario, all, Service::name)?;
        expect(extent.trains > 0 && extent.stops > 0, || {
            "--trains and --stops: expected more than 0".into()
        })?;
        let cycle_ms = self.cycle_ms.unwrap_or(50);
        expect((10..=200).contains(&cycle_ms), || {
            format!("--cycle-ms {cycle_ms}: expected 10 to 200")
        })?;
        let mut scored =
            ending::over_until_due(&chosen, self.threads, |service| measure(*service, extent));
        // Those whose processes the same signal ended are not whole.
        scored.retain(|it| it.is_ok() || !ending::is_due());
        let scored = scored.into_iter().collect::<Result<Vec<Scored>, _>>()?;
        if let Some(file) = &self.picture {
            write_file(file, &score::picture(&ordinary(&scored))?)?;
        }
        let lines = scored.iter().flat_map(|it| &it.lines).map(|line| line.record.clone());
        let answers = scored.iter().flat_map(|it| it.answers.clone());
        let differences = scored.iter().flat_map(|it| it.differences.clone());
        let tables: [Vec<Record>; 3] = [lines.collect(), answers.collect(), differences.collect()];
        if let Some(file) = &self.csv {
            let stem = file.file_stem().unwrap_or_default().to_string_lossy();
            for (ending, records) in ["", "_answers", "_differences"].iter().zip(&tables) {
                write_csv(&file.with_file_name(format!("{stem}{ending}.csv")), records)?;
            }
        }
        let [drives, answers, differences] = &tables;
        let all = json!({ "drives": drives, "answers": answers, "differences": differences });
        self.output.give(&all, || tables.each_ref().map(|it| table(it)).join("\n"))?;
        let broken = scored.into_iter().filter_map(|it| it.broken);
        expect_none("worse with Dynocar", broken.collect())
    }
}

/// Returns the ordinary service of each traffic; that of its usual cycle comes first.
fn ordinary(scored: &[Scored]) -> Vec<&Scored> {
    let mut first: Vec<&Scored> = Vec::new();
    for it in scored.iter().filter(|it| it.service.condition == ORDINARY) {
        if first.iter().all(|other| other.service.traffic != it.service.traffic) {
            first.push(it);
        }
    }
    first
}

fn measure(service: Service, extent: DriveExtent) -> Result<Scored, BenchError> {
    let mut all = [Vec::new(), Vec::new(), Vec::new()];
    for (driven, (informant, _)) in all.iter_mut().zip(Informant::ALL) {
        *driven = run::drive(service, informant, extent)?;
    }
    report_line(&format!("{}: done", service.name()));
    Ok(score::score(service, &all))
}
