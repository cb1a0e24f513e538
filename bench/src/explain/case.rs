//! One simulated dataset and its explanation.

use std::{io, path::Path};

use dynocar_analysis::dataset::Dataset;
use dynocar_analysis::explain::{Explanation, explain};
use dynocar_tests::simulator::dataset_writer::{
    dataset_files, read_files, write_dataset, write_truth,
};
use dynocar_tests::simulator::{SimulatedDataset, SimulatorSettings, simulate};

use super::scenario::Scenario;
use super::world::World;

/// What is simulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Case {
    /// The family.
    pub scenario: Scenario,
    /// The seed.
    pub seed: u64,
    /// The world it happens in.
    pub world: World,
}

impl Case {
    /// Simulates the case.
    pub fn simulate(&self) -> SimulatedDataset {
        simulate(&self.settings())
    }

    /// What the simulator is asked for.
    pub fn settings(&self) -> SimulatorSettings {
        self.scenario.settings(self.seed, self.world)
    }

    /// Writes the dataset, with its truth beside it, as `<kind>-<seed>` into a folder.
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
