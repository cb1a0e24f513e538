//! Fitted values, the places of the effects, and the other explanations that were considered.

use dynocar_analysis::explain::caveats::not_held;
use dynocar_analysis::explain::evidence::SCORE_MIN;
use dynocar_analysis::explain::report::parameters::{ParameterRow, PlaceRow, PlaceRuns};
use dynocar_analysis::explain::report::sentence::CandidateRow;
use dynocar_model::words::{joined, number};

use super::{PageSection, Subject};
use crate::report::html::ColumnAlignment::{Numbers, Words};
use crate::report::html::{self, TableColumn, escape, estimate, marked_table, minus};

/// Returns the section.
pub fn parameters(subject: &Subject) -> PageSection {
    let has_effect = subject.has_effect();
    let name = |row: &ParameterRow| {
        let group = if is_base(row) { String::new() } else { format!("{}: ", escape(&row.group)) };
        format!("{group}{} <code>{}</code>", escape(&row.meaning), escape(&row.name))
    };
    let declared = |row: &ParameterRow| {
        let Some(value) = row.declared else { return "–".into() };
        // A declared value shows its own digits, not more than the estimate's.
        let text = number(value, row.after.interval.map(|[low, high]| 0.5 * (high - low)));
        let own = value.to_string();
        if own.len() < text.len() { own.replacen('-', "−", 1) } else { text }
    };
    let before = if has_effect { "Without the effect" } else { "Fitted" };
    let columns: [TableColumn<ParameterRow>; 5] = [
        ("Parameter", Words, &name),
        ("Unit", Words, &|row| escape(row.unit)),
        ("Declared", Numbers, &declared),
        (before, Numbers, &|row| row.before.as_ref().map_or("–".into(), estimate)),
        ("With the effect", Numbers, &|row| estimate(&row.after)),
    ];
    let shown = if has_effect { &columns[..] } else { &columns[..4] };
    let caption = "Parameters with 95 % intervals, speeds in m/s";
    let mut body = marked_table(caption, shown, &subject.data.parameters, |row| !is_base(row));
    body += "<p class=\"note\">Basic resistance is a + b v + c v² in N/kN. Intervals are 1.96 \
             standard deviations to either side; the deviations hold the scatter from run to run \
             and the small number of runs. a, b and c are strongly correlated: judge them together, \
             by the resistance at a speed.</p>\n";
    body += &places(subject);
    PageSection { id: "parameters", title: "Parameters", body }
}

/// Returns true for a, b and c.
fn is_base(row: &ParameterRow) -> bool {
    row.before.is_some()
}

/// A run counts as surely in or out beyond this probability.
const SURE: f64 = 0.99;
/// Runs that are named one by one at most.
const NAMED_MAX: usize = 8;

/// Returns the table with its notes; empty where no place was estimated.
fn places(subject: &Subject) -> String {
    let places = &subject.data.places;
    if places.is_empty() {
        return String::new();
    }
    let mut html = String::from("<h3>Where, and how surely</h3>\n");
    if !places.ends.is_empty() {
        let columns: [TableColumn<PlaceRow>; 3] = [
            ("Place", Words, &|row| format!("{}: {}", escape(&row.group), escape(&row.end))),
            ("Unit", Words, &|row| row.unit.into()),
            ("Found", Numbers, &|row| estimate(&row.at)),
        ];
        html += &html::table("Ends of places with 95 % intervals", &columns, &places.ends);
    }
    for runs in &places.runs {
        html += &format!("<p class=\"note\">{}</p>\n", sentence(runs));
    }
    html + "<p class=\"note\">An end can lie wherever the data speak neither for nor against it, as \
            where no train braked; it is put in the middle of that.</p>\n"
}

fn sentence(place: &PlaceRuns) -> String {
    let listed = |runs: Vec<String>| {
        let more = runs.len().saturating_sub(NAMED_MAX);
        let mut named: Vec<String> = runs.into_iter().take(NAMED_MAX).collect();
        if more > 0 {
            named.push(format!("{more} more"));
        }
        escape(&joined(&named))
    };
    let with = |wanted: &dyn Fn(f64) -> bool| -> Vec<String> {
        let runs = place.runs.iter().filter(|(_, known)| wanted(*known));
        runs.map(|(run, _)| run.clone()).collect()
    };
    let open: Vec<String> = place
        .runs
        .iter()
        .filter(|(_, known)| (1.0 - SURE..=SURE).contains(known))
        .map(|(run, known)| format!("{run} ({:.0} %)", 100.0 * known))
        .collect();
    let groups = [
        ("acts for sure in", with(&|known| known > SURE)),
        ("for sure not in", with(&|known| known < 1.0 - SURE)),
        ("perhaps in", open),
    ];
    let parts: Vec<String> = groups
        .into_iter()
        .filter(|(_, runs)| !runs.is_empty())
        .map(|(words, runs)| format!("{words} {}", listed(runs)))
        .collect();
    let group = escape(&place.group);
    format!("Among the fit runs, {group} {} (more than 99 % counts as sure).", parts.join("; "))
}

/// Returns the section.
pub fn candidates(subject: &Subject) -> PageSection {
    let rows = &subject.data.candidates;
    let has_given_found = rows.iter().any(|row| row.given_found.is_some());
    let evidence =
        |value: Option<f64>| value.map_or("–".into(), |value| minus(&format!("{value:.0}")));
    let reduction = |share: f64| minus(&format!("{:.0} %", 100.0 * share));
    let columns: [TableColumn<CandidateRow>; 5] = [
        ("Candidate", Words, &|it| format!("{} <code>{}</code>", escape(it.title), it.kind)),
        ("Evidence alone", Numbers, &|it| evidence(it.alone)),
        ("Error taken away alone", Numbers, &|it| it.reduction.map_or("–".into(), reduction)),
        ("Evidence given what was found", Numbers, &|it| evidence(it.given_found)),
        ("Outcome", Words, &|it| escape(&it.reason)),
    ];
    let is_kept = |it: &TableColumn<_>| has_given_found || !it.0.starts_with("Evidence given");
    let kept: Vec<_> = columns.into_iter().filter(is_kept).collect();
    let mut body = format!(
        "<p>Every kind of the library was fitted together with a, b and c. Evidence is the \
         decrease of −2 log likelihood less the price of the parameters and of the structures \
         that were tried; times the square of the share of the error that it takes away, of runs \
         that were fitted and of runs left out of the fit, it must exceed {SCORE_MIN:.0}, and the effect \
         must be large enough to matter. ‘Alone’ is on top of a, b and c only.</p>\n"
    );
    body += &match rows.is_empty() {
        true => "<p>The runs hold too little motion for any of them.</p>\n".into(),
        false => marked_table("All kinds of the library", &kept, rows, |row| row.is_found),
    };
    for caveat in not_held(&subject.explanation.answer.identifiability) {
        body += &format!("<p>{}</p>\n", escape(caveat.trim()));
    }
    let forms = subject.explanation.answer.effects.iter().flat_map(|effect| &effect.runners_up);
    let forms: Vec<String> =
        forms.map(|other| format!("<li>{}</li>\n", escape(&minus(&other.in_words())))).collect();
    if !forms.is_empty() {
        body += "<p>Other forms that the force outside the library may have:</p>\n<ul>\n";
        body += &(forms.concat() + "</ul>\n");
    }
    PageSection { id: "candidates", title: "What else was considered", body }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_distinguished_by_how_surely_the_effect_acts_in_them() {
        let runs = [("1.csv", 1.0), ("2.csv", 0.0), ("3.csv", 0.6), ("<4>.csv", 0.999)];
        let runs = runs.map(|(run, known)| (run.to_string(), known)).to_vec();
        assert_eq!(
            sentence(&PlaceRuns { group: "low adhesion".into(), runs }),
            "Among the fit runs, low adhesion acts for sure in 1.csv and &lt;4&gt;.csv; \
             for sure not in 2.csv; perhaps in 3.csv (60 %) (more than 99 % counts as sure)."
        );
    }
}
