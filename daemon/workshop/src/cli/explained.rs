//! The answer of `dynocar explain` for people: a verdict of at most two sentences, then for each effect its place,
//! size, share of the error and recommended action.

use dynocar_analysis::explain::answer::{Considered, EffectAnswer, ExplainAnswer};
use dynocar_analysis::explain::report::effect as effect_words;
use dynocar_analysis::explain::stop_to_stop::Metric;
use dynocar_model::words;
use dynocar_shared::HALF_95;

use crate::run_facts::diagnostics;
use dynocar::cli::text::{WIDTH, wrap};

/// Columns of a row before its words.
const INDENT: usize = 12;

/// Returns the answer for people.
pub fn text(answer: &ExplainAnswer) -> String {
    let mut text = diagnostics(&answer.diagnostics)
        + &plain(&[&answer.words.heading, &answer.words.left].map(String::as_str).concat());
    for effect in &answer.effects {
        text += "\n";
        text += &found(effect);
    }
    text += "\n";
    text += &limits(answer);
    if answer.impossibilities().next().is_some() {
        return text;
    }
    text += "\n";
    text += &figures(answer);
    text + &others(answer)
}

/// Describes the other explanations, with the evidence against them; those that are no more than chance are
/// counted.
fn others(answer: &ExplainAnswer) -> String {
    let is_chance = |it: &&Considered| it.evidence.is_some_and(|evidence| evidence <= 0.0);
    let chance = answer.considered.iter().filter(is_chance).count();
    let mut text = String::from("\nevidence  not accepted\n");
    for considered in answer.considered.iter().filter(|it| !is_chance(it)) {
        let evidence = considered.evidence.map_or("-".into(), |evidence| format!("{evidence:.0}"));
        text += &format!("{evidence:>8}  {:20} {}\n", considered.kind, considered.reason);
    }
    if chance > 0 {
        text += &format!("  0 or less  {chance} other kinds: they explain no more than chance\n");
    }
    text
}

/// Returns an effect, a row for each question.
fn found(effect: &EffectAnswer) -> String {
    let mut rows = row("what", &format!("{} ({})", words::kind_name(effect.kind), effect.kind));
    let place = effect_words::located(&effect.place);
    rows += &row("where", place.as_deref().unwrap_or("everywhere"));
    for size in effect_words::sizes(&effect.parameters, &effect.std) {
        rows += &row("size", &size);
    }
    let percent = 100.0 * effect.error_reduction;
    rows += &row(
        "removes",
        &match percent {
            0.5.. => format!("{percent:.0} % of the open-loop error of the fit runs"),
            _ => "none of the open-loop error, which each run's own load and wind make".into(),
        },
    );
    let means = effect_words::meaning(&effect.meaning);
    if !means.is_empty() {
        rows += &row("means", &means);
    }
    for other in &effect.runners_up {
        rows += &row("or else", &other.in_words());
    }
    rows += &row("sure", &effect_words::sureness(effect.p_value));
    if let Some(to_do) = effect_words::to_do(effect) {
        rows += &row("to do", to_do);
    }
    rows
}

/// Describes the alternatives that explain the runs, the limits of the answer, and the runs that would settle it.
fn limits(answer: &ExplainAnswer) -> String {
    let others: Vec<String> =
        answer.ambiguous_with.iter().map(|kind| words::kind_name(kind).into()).collect();
    let others = (!others.is_empty()).then(|| row("or else", &words::joined(&others)));
    let caveats = answer.caveats.iter().map(|caveat| row("note", caveat));
    let experiment = answer.experiment.iter().map(|experiment| row("next", experiment));
    let unscored = answer.unscored.iter().map(|unscored| row("note", unscored));
    others.into_iter().chain(caveats).chain(experiment).chain(unscored).collect()
}

/// Returns the coefficients and errors.
fn figures(answer: &ExplainAnswer) -> String {
    let (base, std) = (&answer.base, &answer.base.std);
    let [a, b, c] = [std.a, std.b, std.c].map(|deviation| HALF_95 * deviation);
    let mut text = format!(
        "refitted: a = {:.3} ± {a:.3} N/kN, b = {:.4} ± {b:.4}, c = {:.6} ± {c:.6} (95 %, v in m/s)\n",
        base.a, base.b, base.c
    );
    if let Some(judged) = answer.judged.filter(|it| it.metric == Metric::StopToStop) {
        let [before, after] = judged.error_mps;
        let predicted = judged.predicted();
        text += &format!("holdout runs{predicted}: {before:.3} m/s before, {after:.3} m/s after\n");
    }
    if let (Some(before), Some(after)) = (answer.rmse_before, answer.rmse_after) {
        text += &format!("holdout runs, open loop: {before:.3} m/s before, {after:.3} m/s after\n");
    }
    text
}

/// Returns a label and its words, in lines below each other.
fn row(label: &str, words: &str) -> String {
    let lines = wrap(words, WIDTH - INDENT);
    let next = format!("\n{:INDENT$}", "");
    format!("  {label:<width$}{}\n", lines.join(&next), width = INDENT - 2)
}

fn plain(words: &str) -> String {
    format!("{}\n", wrap(words, WIDTH).join("\n"))
}
