//! The simulated datasets of `explain` and `monitor`.

use std::io;
use std::path::Path;

use clap::Args;
use clap::builder::RangedU64ValueParser;
use dynocar_analysis::dataset::Dataset;
use dynocar_analysis::explain::{Explanation, explain};
use dynocar_tests::simulator::dataset_writer::{
    dataset_files, read_files, write_dataset, write_truth,
};
use dynocar_tests::simulator::{SimulatedDataset, SimulatorSettings, simulate};

use super::scenario::{ExplainScenario, ExplainWorld};
use crate::output::{BenchError, OutputArguments, named};
use crate::parallel;

/// A simulated case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SimulatedCase {
    /// The family.
    pub scenario: ExplainScenario,
    /// The seed.
    pub seed: u64,
    /// The simulated world.
    pub world: ExplainWorld,
    /// Number of runs, a quarter of them held out.
    pub runs: usize,
}

impl SimulatedCase {
    /// Simulates the case.
    pub fn simulate(&self) -> SimulatedDataset {
        simulate(&self.settings())
    }

    /// Returns the settings of the simulator.
    pub fn settings(&self) -> SimulatorSettings {
        let holdout_runs = (self.runs / 4).max(1);
        let settings = self.scenario.settings(self.seed, self.world);
        SimulatorSettings { runs: self.runs, holdout_runs, ..settings }
    }

    /// Writes the dataset, with its truth next to it, as `<kind>-<seed>` into a folder.
    ///
    /// # Errors
    ///
    /// When the files cannot be written.
    pub fn write(&self, folder: &Path) -> io::Result<()> {
        let name = format!("{}-{}", self.scenario.name(), self.seed);
        let simulated = self.simulate();
        write_dataset(&simulated, &folder.join(&name))?;
        write_truth(&simulated, &folder.join(name + ".truth.json"))
    }
}

/// The simulated datasets of a command, and the destination of its result.
#[derive(Debug, Args)]
pub struct FamilyArguments {
    /// Simulated datasets for each kind
    #[arg(long, default_value_t = 20)]
    seeds: usize,
    /// The first seed
    #[arg(long, default_value_t = 1)]
    pub first_seed: u64,
    /// Only this kind, as tunnel_drag, or none, two_effects, none_poor_recording; may be repeated
    #[arg(long = "kind", value_name = "NAME")]
    kinds: Vec<String>,
    /// Errors simulated besides the effect
    #[arg(long, value_enum, default_value_t = ExplainWorld::Plain)]
    world: ExplainWorld,
    /// Runs of a dataset, a quarter of them held out
    #[arg(long, default_value_t = 8, value_parser = RangedU64ValueParser::<usize>::new().range(2..))]
    runs: usize,
    /// Datasets at a time
    #[arg(long, default_value_t = 2)]
    threads: usize,
    /// Print the outcome of every dataset on standard error
    #[arg(long)]
    pub verbose: bool,
    #[command(flatten)]
    pub output: OutputArguments,
}

impl FamilyArguments {
    /// Returns the scenarios asked for, else the usual ones.
    ///
    /// # Errors
    ///
    /// When there is no such kind.
    pub fn scenarios(
        &self,
        usual: Vec<ExplainScenario>,
    ) -> Result<Vec<ExplainScenario>, BenchError> {
        let all: Vec<_> = ExplainScenario::all().into_iter().map(|it| (it.name(), it)).collect();
        let chosen = self.kinds.iter().map(|name| named("--kind", name, &all));
        if self.kinds.is_empty() { Ok(usual) } else { chosen.collect() }
    }

    /// Returns every scenario with every seed, scenario by scenario.
    pub fn cases(&self, scenarios: &[ExplainScenario]) -> Vec<SimulatedCase> {
        let (first, world, runs) = (self.first_seed, self.world, self.runs);
        let seeds = move || first..first + self.seeds as u64;
        let of = |&scenario| seeds().map(move |seed| SimulatedCase { scenario, seed, world, runs });
        scenarios.iter().flat_map(of).collect()
    }

    /// Does the work on every case until the command is to end; returns the results by scenario.
    pub fn over<R: Clone + Send>(
        &self,
        scenarios: &[ExplainScenario],
        work: impl Fn(&SimulatedCase) -> R + Sync,
    ) -> Vec<(ExplainScenario, Vec<R>)> {
        let results = parallel::until_due(&self.cases(scenarios), self.threads, work);
        let by_scenario = results.chunks(self.seeds.max(1)).map(<[R]>::to_vec);
        scenarios.iter().copied().zip(by_scenario).collect()
    }
}

/// Reads a simulated dataset through its files, as the program does.
///
/// # Panics
///
/// When the simulator's files are refused.
pub fn read(simulated: &SimulatedDataset) -> Dataset {
    read_files(&dataset_files(simulated))
}

/// Explains a simulated dataset.
///
/// # Panics
///
/// When a run has no usable sample.
pub fn explained(dataset: &Dataset) -> Explanation {
    explain(dataset, &|_, _| {}).expect("usable runs")
}
