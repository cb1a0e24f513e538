//! One simulated dataset and its explanation.

use dynocar_core::dataset::Dataset;
use dynocar_core::explain::{Explanation, explain};
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::dataset_writer::dataset_files;
use dynocar_tests::simulator::{EffectRequest, SimulatedDataset, SimulatorSettings, simulate};

/// What is simulated.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// The undeclared kinds; empty for a null.
    pub kinds: Vec<EffectKind>,
    /// The seed.
    pub seed: u64,
}

impl Case {
    /// Simulates the case.
    pub fn simulate(&self) -> SimulatedDataset {
        let request = EffectRequest::Kinds(self.kinds.clone());
        simulate(&SimulatorSettings::new(self.seed, request))
    }
}

/// Reads a simulated dataset through its files, as the program does, and explains it.
///
/// # Panics
///
/// When the simulator's files are refused.
pub fn explained(simulated: &SimulatedDataset) -> Explanation {
    let files = dataset_files(simulated);
    let texts: Vec<(&str, &str)> =
        files.iter().map(|(path, text)| (path.as_str(), text.as_str())).collect();
    let dataset = Dataset::load(&texts[..]).expect("a simulated dataset");
    explain(&dataset, &|_, _| {}).expect("usable runs")
}
