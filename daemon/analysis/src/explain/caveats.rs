//! What limits a verdict, in words.

use super::answer::{EffectAnswer, Identifiability};
use super::described::small;
use super::identifiability::not_held;
use super::informed::undetermined;
use super::score::Score;
use super::selection::{Outcome, Search};

/// What limits a verdict.
pub fn caveats(
    search: &Search,
    outcome: &Outcome,
    effects: &[EffectAnswer],
    score: &Score,
    std: &[f64],
    identifiability: &[Identifiability],
) -> Vec<String> {
    let mut caveats = vec![worse_held_out(effects, score), small_beside(outcome, effects)];
    caveats.push(undetermined(search.problem, &outcome.fit, std));
    caveats.extend(not_held(identifiability));
    caveats
}

/// Sentences without the space before them, and none that is empty.
pub fn trimmed(sentences: &[String]) -> Vec<String> {
    let trimmed = sentences.iter().map(|it| it.trim().to_owned());
    trimmed.filter(|it| !it.is_empty()).collect()
}

/// What is certain and small in the model beside the effects that are named; empty without either.
fn small_beside(outcome: &Outcome, effects: &[EffectAnswer]) -> String {
    let small: Vec<String> = outcome.small_trials().map(small).collect();
    if small.is_empty() || effects.is_empty() {
        return String::new();
    }
    format!(" Certain, small, and part of the updated model: {}.", small.join(", "))
}

/// That the runs held out are predicted worse with what was found; empty when they are not.
fn worse_held_out(effects: &[EffectAnswer], score: &Score) -> String {
    let Some(judged) = score.judged() else { return String::new() };
    let [before, after] = judged.error_mps;
    let [shown_before, shown_after] = [before, after].map(|error| format!("{error:.3}"));
    if effects.is_empty() || after <= before || shown_after == shown_before {
        return String::new();
    }
    let acts_in_runs = |it: &EffectAnswer| it.place.runs.is_some() || it.place.windows.is_some();
    let why = if effects.iter().all(acts_in_runs) {
        "it was found in single runs, and is not looked for in those held out. Where they err most, it may \
         act too: fit them (role = \"fit\") to find out."
    } else {
        "it holds for the runs that were fitted, not for those."
    };
    format!(
        " The runs held out are predicted worse with it{}, {shown_before} m/s before and \
         {shown_after} after: {why}",
        judged.predicted()
    )
}
