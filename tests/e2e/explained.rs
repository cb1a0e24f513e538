//! A simulated dataset of each kind of effect and the answer of `explain` to it, computed once for all tests.

use std::sync::OnceLock;

use dynocar_analysis::explain::{Explanation, explain};
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::dataset_writer::{dataset_files, read_files};
use dynocar_tests::simulator::{EffectRequest, SimulatedDataset, SimulatorSettings, simulate};

/// Seed of all of them.
pub const SEED: u64 = 23;

/// A dataset and its explanation.
pub struct Explained {
    pub simulated: SimulatedDataset,
    pub explanation: Explanation,
}

/// That of one effect of a kind, or of none.
pub fn explained(kind: EffectKind) -> &'static Explained {
    static ALL: [OnceLock<Explained>; EffectKind::ALL.len()] =
        [const { OnceLock::new() }; EffectKind::ALL.len()];
    let index = EffectKind::ALL.iter().position(|it| *it == kind).expect("a kind");
    ALL[index].get_or_init(|| {
        let kinds = if kind == EffectKind::None { Vec::new() } else { vec![kind] };
        let simulated = simulate(&SimulatorSettings::new(SEED, EffectRequest::Kinds(kinds)));
        let dataset = read_files(&dataset_files(&simulated));
        let explanation = explain(&dataset, &|_, _| {}).expect("usable runs");
        Explained { simulated, explanation }
    })
}
