//! Other forms that a force outside the library may have.

use dynocar_shared::vocabulary::EffectKind;

use super::answer::RunnerUp;
use super::effects::UNKNOWN;
use super::selection::{Outcome, Search, penalty};

/// Runners-up at most.
const SHOWN: usize = 3;

/// A formula without its numbers.
fn form(formula: String) -> String {
    formula
        .chars()
        .filter(|letter| !(letter.is_ascii_digit() || ".-+−".contains(*letter)))
        .collect()
}

/// The forms next best to the one that was found, each fitted with everything else; empty where
/// nothing outside the library was found.
pub fn runners_up(search: &Search, outcome: &Outcome) -> Vec<RunnerUp> {
    let fit = &outcome.fit;
    let is_unknown = |kind: EffectKind| kind == EffectKind::Unknown;
    let Some(index) = fit.model.effects.iter().position(|effect| is_unknown(effect.kind())) else {
        return Vec::new();
    };
    let found = fit.model.effects[index].formula(fit.effect_parameters(index)).map(form);
    let own = fit.cost + penalty(fit, index);
    let rest = search.without(fit, index);
    let onto = search.problem.again(&rest, fit.noise);
    let Some(scan) = search.scan(&onto) else { return Vec::new() };
    let candidates = UNKNOWN.propose(&scan).unwrap_or_default();
    let mut others: Vec<RunnerUp> = candidates
        .into_iter()
        .filter_map(|candidate| {
            let other = search.problem.grown(&onto, [candidate.parts()]);
            let last = other.model.effects.len() - 1;
            let formula = other.model.effects[last].formula(other.effect_parameters(last))?;
            let evidence_less = other.cost + penalty(&other, last) - own;
            Some(RunnerUp { formula, evidence_less })
        })
        .filter(|other| found != Some(form(other.formula.clone())))
        .collect();
    others.sort_by(|one, other| one.evidence_less.total_cmp(&other.evidence_less));
    others.truncate(SHOWN);
    others
}
