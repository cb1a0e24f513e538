//! Every pipeline that answers resistance or mass, in a user's day: trains that stop, loads that are
//! weighed wrong or not at all, maps, wheels, forces and clocks that are a little off.
//!
//! - [`world`]: a train, its line and its day, with the size of the mistakes in their declaration
//! - [`brake`]: brakes that do not act as they report
//! - [`scenario_train`]: driving from stop to stop, and the controller's samples
//! - [`recorded`]: the same as a dataset
//! - [`bound`]: the least possible standard deviations of both
//! - [`score`]: scores of answers over a drive
//! - [`table`]: the scenarios, and their results in numbers

pub mod bound;
pub mod brake;
pub mod recorded;
pub mod scenario_train;
pub mod score;
pub mod table;
pub mod world;

use std::path::{Path, PathBuf};

use clap::Args;
use dynocar_shared::PipelineKind;

use self::table::NamedScenario;
use self::world::World;
use crate::output::{self, BenchError, OutputArguments, containing, expect, named, write_csv};
use world::Mistakes;

/// Resistance and mass in a user's day: how long an answer may be used, how soon, how often that
/// changes, and whether its intervals hold.
#[derive(Debug, Args)]
pub struct ScenariosArguments {
    /// Drives for each scenario
    #[arg(long, default_value_t = 20)]
    seeds: u64,
    /// The first seed
    #[arg(long, default_value_t = 1)]
    first_seed: u64,
    /// Hours of each drive
    #[arg(long, default_value_t = 2.0)]
    hours: f64,
    /// Only scenarios whose name contains this, as metro
    #[arg(long, value_name = "TEXT", default_value = "")]
    scenario: String,
    /// Rows of brakes that do not act as they report, instead of the usual ones
    #[arg(long)]
    brakes: bool,
    /// How large the mistakes are: those of careful declarations, or all that default settings expect
    #[arg(long, value_enum, default_value_t = Size::Usual)]
    mistakes: Size,
    /// Instead of measuring, write the drives as datasets into this folder
    #[arg(long, value_name = "DIR", conflicts_with = "csv")]
    write: Option<PathBuf>,
    /// A pipeline; may be repeated
    #[arg(long = "pipeline", value_name = "KIND", default_value = "train_kalman")]
    pipelines: Vec<String>,
    /// Scenarios at a time
    #[arg(long, default_value_t = 2)]
    threads: usize,
    #[command(flatten)]
    output: OutputArguments,
    /// Write the result as CSV
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
}

/// How large the mistakes are.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Size {
    Usual,
    Expected,
}

impl Size {
    fn mistakes(self) -> Mistakes {
        match self {
            Size::Usual => Mistakes::USUAL,
            Size::Expected => Mistakes::expected(),
        }
    }
}

impl ScenariosArguments {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// When the command line is wrong, or the result cannot be written.
    pub fn run(&self) -> Result<(), BenchError> {
        let all = if self.brakes { table::brakes() } else { table::scenarios() };
        let chosen = containing("--scenario", &self.scenario, all, |(it, _)| it.join(", "))?;
        let all: Vec<_> = PipelineKind::ALL.iter().map(|kind| (kind.name(), *kind)).collect();
        let kinds = self.pipelines.iter().map(|name| named("--pipeline", name, &all));
        let kinds = kinds.collect::<Result<Vec<_>, _>>()?;
        let is_some = self.hours > 0.0 && self.hours.is_finite() && self.seeds > 0;
        expect(is_some, || "--hours and --seeds: expected more than 0".into())?;
        if let Some(folder) = &self.write {
            return self.write(&chosen, folder);
        }
        let records = table::run(&table::Plan {
            scenarios: &chosen,
            kinds: &kinds,
            seeds: self.seeds,
            first_seed: self.first_seed,
            hours: self.hours,
            mistakes: self.mistakes.mistakes(),
            threads: self.threads,
        })?;
        if let Some(file) = &self.csv {
            write_csv(file, &records)?;
        }
        self.output.give(&records, || output::table(&records))
    }

    /// Writes every drive of the rows as a dataset.
    fn write(&self, rows: &[NamedScenario], folder: &Path) -> Result<(), BenchError> {
        for (name, scenario) in rows {
            for seed in self.first_seed..self.first_seed + self.seeds {
                let world = World::draw(*scenario, self.mistakes.mistakes(), seed);
                let name = format!("{}, seed {seed}", name.join(", ")).replace([',', '/'], "");
                recorded::write(world, self.hours, &folder.join(name.replace(' ', "_")))?;
            }
        }
        Ok(())
    }
}
