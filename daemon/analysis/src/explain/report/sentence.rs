//! The verdict of the page: the statement's words, the meaning of an effect, the error reduction, and the other
//! explanations that were tried.

use dynocar_model::words;
use dynocar_shared::vocabulary::{EffectKind, KindRow};

use super::effect::meaning;
use super::errors::Errors;
use crate::dataset::Role;
use crate::explain::Explanation;
use crate::explain::answer::{ExplainAnswer, Verdict, VerdictWords};
use crate::explain::evidence::SCORE_MIN;
use crate::explain::score::reduction;
use crate::explain::selection::EffectTrial;
use crate::statistics::greatest_first;

/// Returns the verdict of an answer, the meaning of its effect and the error reduction.
pub fn sentence(answer: &ExplainAnswer, errors: &Errors) -> String {
    let VerdictWords { heading, whole, left } = &answer.words;
    let is_impossible = answer.impossibilities().next().is_some();
    let (verdict, means) = match &answer.effects[..] {
        [one] if answer.verdict == Verdict::Effect => (whole, meaning(&one.meaning)),
        // The page describes several effects in a list next to the sentence.
        [_, _, ..] if answer.verdict == Verdict::Effect => (heading, String::new()),
        _ => (whole, String::new()),
    };
    let means = if means.is_empty() { means } else { format!(" It means {means}.") };
    let gained = match answer.effects.len() {
        _ if is_impossible => String::new(),
        0 => String::new(),
        1 => gained(errors, " With it"),
        _ => gained(errors, " With them"),
    };
    format!("{verdict}{means}{left}{gained}")
}

/// Describes the error reduction of the effects.
fn gained(errors: &Errors, with: &str) -> String {
    let Some((role, judged)) = errors.judged() else { return String::new() };
    let runs = if role == Role::Holdout { "the runs held out" } else { "the fit runs" };
    let runs = format!("{runs}{}", judged.predicted());
    let interval = judged.reduction_interval_95;
    let percent = |share: f64| format!("{} %", words::percent(share, interval));
    let interval = interval.map_or(String::new(), |[low, high]| {
        format!(" (95 % interval {} to {})", percent(low), percent(high))
    });
    let [before, after] = judged.error_mps;
    let values = format!("from {before:.3} to {after:.3} m/s");
    if judged.reduction > 0.0 {
        let share = percent(judged.reduction);
        format!(
            "{with}, the error of the predicted speed on {runs} falls {values}, by {share}{interval}."
        )
    } else {
        format!("{with}, the error of the predicted speed on {runs} does not fall ({values}).")
    }
}

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
pub fn candidate_rows(explanation: &Explanation) -> Vec<CandidateRow> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::answer::{
        BaseAnswer, DavisDeviations, EffectAnswer, EffectMeaning, Location, ParameterValue,
    };
    use crate::explain::competing::CompetingHypotheses;
    use crate::explain::report::IntervalEstimate;
    use crate::explain::report::effect::verdict_words;
    use crate::explain::report::errors::{ErrorPair, Resampling};
    use crate::explain::stop_to_stop::StopToStop;

    fn effect(kind: &'static str, parameter: &str) -> EffectAnswer {
        EffectAnswer {
            kind,
            place: Location::of_intervals(vec![[5200.0, 6900.0]]),
            parameters: [(parameter.to_string(), ParameterValue::Number(2.5))].into(),
            std: [(parameter.to_string(), ParameterValue::Number(0.1))].into(),
            p_value: 1e-9,
            error_reduction: 0.8,
            meaning: EffectMeaning::default(),
            contradiction: None,
            over_time: Vec::new(),
            held_out: None,
            runners_up: Vec::new(),
        }
    }

    /// Returns an ambiguous answer.
    fn ambiguous() -> ExplainAnswer {
        let none = DavisDeviations { a: 0.0, b: 0.0, c: 0.0 };
        ExplainAnswer {
            verdict: Verdict::Ambiguous,
            statement: String::new(),
            diagnostics: Vec::new(),
            words: VerdictWords::default(),
            caveats: Vec::new(),
            effects: vec![effect("local_resistance", "extra_n_per_kn")],
            ambiguous_with: vec!["tunnel_drag"],
            experiment: None,
            base: BaseAnswer { a: 1.0, b: 0.0, c: 0.0, std: none, told_by_data: none },
            metric: "full_run",
            scored_runs: 1,
            unscored: None,
            judged: None,
            rmse_before: None,
            rmse_after: None,
            error_reduction_interval: None,
            window60: None,
            stop_to_stop: None,
            fit_runs: None,
            drive: None,
            force_late_s: None,
            over_time: std::collections::BTreeMap::new(),
            unexplained_n_per_kn: None,
            considered: Vec::new(),
            identifiability: Vec::new(),
            predictions: std::collections::BTreeMap::new(),
        }
    }

    /// Returns the errors over whole runs held out that grow.
    fn updated_errors() -> Errors {
        let value = |value| IntervalEstimate { value, interval: None };
        let pair = ErrorPair {
            before_mps: value(0.8),
            after_mps: value(0.9),
            reduction: value(-0.125),
            resampling: Resampling::Blocks(1),
        };
        Errors {
            fit: None,
            holdout: Some(pair),
            fit_window60: None,
            holdout_window60: None,
            holdout_stop_to_stop: None,
            fit_stop_to_stop: None,
            by_run: Vec::new(),
        }
    }

    #[test]
    fn rivals_and_unknown_causes_are_distinguished_from_findings() {
        let errors = updated_errors();
        let said = |verdict: Verdict, effects: Vec<EffectAnswer>, rivals: &[EffectKind]| {
            let accepted = EffectKind::LocalResistance;
            let competing =
                rivals.iter().map(|it| CompetingHypotheses { accepted, kinds: vec![*it] });
            let competing: Vec<CompetingHypotheses> = competing.collect();
            let words = verdict_words(verdict, &effects, &competing, String::new());
            sentence(&ExplainAnswer { verdict, effects, words, ..ambiguous() }, &errors)
        };
        let size = "from km 5.20 to 6.90 – extra resistance 2.50 N/kN (95 % interval 2.30 to 2.70)";
        let gained = "With it, the error of the predicted speed on the runs held out does not \
                      fall (from 0.800 to 0.900 m/s).";
        let place = effect("local_resistance", "extra_n_per_kn");
        assert_eq!(
            said(Verdict::Ambiguous, vec![place.clone()], &[EffectKind::TunnelDrag]),
            format!(
                "Something undeclared acts, but these runs do not show what: it may be a local \
                 resistance {size}; tunnel drag explains them as well. {gained}"
            )
        );
        let gain = effect("traction_gain", "gain");
        let both = said(Verdict::Ambiguous, vec![gain, place.clone()], &[EffectKind::TunnelDrag]);
        assert_eq!(
            both.split(" With them").next().unwrap(),
            format!(
                "Found: a wrong scale of the reported traction force from km 5.20 to 6.90 – \
                 reported over true force 2.50 (95 % interval 2.30 to 2.70). Something else \
                 undeclared acts, but these runs do not show what: it may be a local resistance \
                 {size}; tunnel drag explains them as well."
            )
        );
        let form = effect("unknown", "extra_n_per_kn");
        assert_eq!(
            said(Verdict::Unknown, vec![form], &[]),
            format!(
                "Something undeclared acts that no effect of the library explains: a \
                 residual {size}. {gained}"
            )
        );
        assert_eq!(
            said(Verdict::Unknown, vec![place.clone()], &[]),
            format!(
                "Something undeclared acts that no effect of the library explains, beside a local \
                 resistance {size}. {gained}"
            )
        );
        let two = said(Verdict::Effect, vec![place.clone(), place], &[]);
        assert!(two.starts_with("Found: the declared model lacks 2 effects. With them, "), "{two}");
    }

    #[test]
    fn a_headline_states_the_error_from_stop_to_stop_where_there_are_stops() {
        let mut errors = updated_errors();
        // Stops that were cut off leave an error over whole runs that says nothing of the forces.
        errors.holdout_stop_to_stop = StopToStop::from_errors(vec![vec![[0.5, 0.06]; 3]; 4]);
        let said = sentence(&ambiguous(), &errors);
        let gained = "on the runs held out, from stop to stop (12 sections) falls from 0.500 to \
                      0.060 m/s, by 88 % (95 % interval 88 % to 88 %).";
        assert!(said.ends_with(gained), "{said}");
    }
}
