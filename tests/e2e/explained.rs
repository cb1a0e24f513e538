//! A simulated dataset of each kind of effect, and the answer of `explain`, computed once for all tests; and the test
//! that each kind is found by its name.

use std::sync::OnceLock;

use dynocar_analysis::explain::answer::Verdict;
use dynocar_analysis::explain::{Explanation, explain};
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::dataset_writer::{dataset_files, read_files};
use dynocar_tests::simulator::{EffectRequest, SimulatedDataset, SimulatorSettings, simulate};

/// Seed of all datasets.
pub const SEED: u64 = 23;

/// A dataset and its explanation.
pub struct Explained {
    pub simulated: SimulatedDataset,
    pub explanation: Explanation,
}

/// Returns the dataset with one effect of a kind, or with none, and its explanation.
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

/// Explains a dataset with one effect of a kind.
fn is_found(kind: EffectKind) {
    let answer = &explained(kind).explanation.answer;
    let verdict = if kind == EffectKind::Unknown { Verdict::Unknown } else { Verdict::Effect };
    assert_eq!(answer.verdict, verdict, "{kind}: {}", answer.statement);
    let found: Vec<&str> = answer.effects.iter().map(|effect| effect.kind).collect();
    assert_eq!(found, [kind.name()], "{}", answer.statement);
    let [before_mps, after_mps] = answer.fit_runs.expect("runs to fit");
    assert!(after_mps < before_mps, "{kind}: {}", answer.statement);
    // The load of a run that was left out, as one is here, nobody can know.
    let is_predictable = kind != EffectKind::MassChange;
    if is_predictable {
        assert!(answer.rmse_after < answer.rmse_before, "{kind}: {}", answer.statement);
    }
}

#[test]
fn every_kind_is_found_by_its_name() {
    let kinds: Vec<EffectKind> =
        EffectKind::ALL.iter().copied().filter(|kind| *kind != EffectKind::None).collect();
    std::thread::scope(|scope| {
        for some in kinds.chunks(kinds.len().div_ceil(2)) {
            scope.spawn(move || some.iter().for_each(|&kind| is_found(kind)));
        }
    });
}
