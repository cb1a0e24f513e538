//! Every kind of effect, simulated alone, is found by its name.

use dynocar_analysis::explain::answer::Verdict;
use dynocar_shared::vocabulary::EffectKind;

use crate::explained::explained;

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
