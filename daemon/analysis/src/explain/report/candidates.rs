//! Other explanations that were tried, and why they were not accepted.

use dynocar_model::words;
use dynocar_shared::vocabulary::{EffectKind, KindRow};

use crate::explain::Explanation;
use crate::explain::evidence::SCORE_MIN;
use crate::explain::score::reduction;
use crate::explain::selection::EffectTrial;
use crate::statistics::greatest_first;

/// A kind of the library.
#[derive(Clone, Debug, PartialEq)]
pub struct CandidateRow {
    /// Its name in files and answers.
    pub kind: &'static str,
    /// Its name for people.
    pub title: &'static str,
    /// True when it is part of the model.
    pub is_found: bool,
    /// Evidence of it alone in addition to a, b, c; `None` when it could not be tested.
    pub alone: Option<f64>,
    /// Share of the open-loop error that it alone removes: the smaller of that over the fit runs as fitted, and that
    /// over each run as predicted from the others.
    pub reduction: Option<f64>,
    /// Evidence jointly with everything found; `None` for a kind that was found or could not be tested.
    pub given_found: Option<f64>,
    /// Why it was accepted or not.
    pub reason: String,
}

/// Returns every kind that was tried: those found first, then by the evidence alone.
pub fn rows(explanation: &Explanation) -> Vec<CandidateRow> {
    let outcome = &explanation.outcome;
    let found: Vec<&str> = explanation.answer.effects.iter().map(|effect| effect.kind).collect();
    let competing = &explanation.answer.ambiguous_with;
    let first = outcome.rounds.first().map_or(&[][..], |round| &round[..]);
    let has_several = outcome.rounds.len() > 1;
    let last = outcome.rounds.last().filter(|_| has_several).map_or(&[][..], |round| &round[..]);
    let of = |round: &'_ [EffectTrial], kind: EffectKind| {
        round.iter().find(|trial| trial.kind == kind).map(|trial| trial.evidence)
    };
    let mut rows: Vec<CandidateRow> = first
        .iter()
        .map(|trial| {
            let kind = trial.kind.name();
            let is_found = found.contains(&kind);
            let given_found = of(last, trial.kind).filter(|_| !is_found);
            let reduction = reduction(&explanation.problem, &outcome.base, &trial.fit);
            let mut row = CandidateRow {
                kind,
                title: KindRow::of(trial.kind).title,
                is_found,
                alone: Some(trial.evidence),
                reduction: Some(reduction),
                given_found,
                reason: String::new(),
            };
            row.reason = reason(explanation, &row, competing.contains(&kind));
            row
        })
        .collect();
    greatest_first(&mut rows, |row| row.alone.unwrap_or(f64::NEG_INFINITY));
    greatest_first(&mut rows, |row| f64::from(row.is_found));
    let not_testable = outcome.not_testable.iter().filter(|(kind, _)| of(first, *kind).is_none());
    rows.extend(not_testable.map(|(kind, why)| CandidateRow {
        kind: kind.name(),
        title: KindRow::of(*kind).title,
        is_found: false,
        alone: None,
        reduction: None,
        given_found: None,
        reason: format!("not testable: {why}"),
    }));
    rows
}

fn reason(explanation: &Explanation, row: &CandidateRow, is_rival: bool) -> String {
    let found = explanation.answer.effects.iter().map(|e| words::kind_name(e.kind).to_string());
    let found = words::joined(&found.collect::<Vec<_>>());
    let alone = row.alone.unwrap_or(0.0);
    let considered = || {
        let own = explanation.answer.considered.iter().find(|it| it.kind == row.kind);
        own.map_or(String::new(), |it| it.reason.clone())
    };
    if row.is_found {
        return "part of the model".into();
    }
    if is_rival {
        return format!("explains the runs as well as {found}: not distinguishable");
    }
    match row.given_found {
        Some(given_found) if alone > SCORE_MIN && given_found <= SCORE_MIN => {
            format!("borrows from the same residual: adds nothing beside {found}")
        }
        _ => considered(),
    }
}
