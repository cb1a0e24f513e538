//! What else was considered, and why it lost.

use dynocar_analysis::explain::evidence::SCORE_MIN;
use dynocar_analysis::explain::identifiability::not_held;
use dynocar_analysis::explain::report::candidates::CandidateRow;

use super::Section;
use crate::report::Subject;
use crate::report::html::Column::{Numbers, Words};
use crate::report::html::{TableColumn, escape, marked_table, minus};

/// The section.
pub fn section(subject: &Subject) -> Section {
    let rows = &subject.data.candidates;
    let has_beside = rows.iter().any(|row| row.beside.is_some());
    let evidence =
        |value: Option<f64>| value.map_or("–".into(), |value| minus(&format!("{value:.0}")));
    let reduction = |share: f64| minus(&format!("{:.0} %", 100.0 * share));
    let columns: [TableColumn<CandidateRow>; 5] = [
        ("Candidate", Words, &|it| format!("{} <code>{}</code>", escape(it.title), it.kind)),
        ("Evidence alone", Numbers, &|it| evidence(it.alone)),
        ("Error taken away alone", Numbers, &|it| it.reduction.map_or("–".into(), reduction)),
        ("Evidence given what was found", Numbers, &|it| evidence(it.beside)),
        ("Outcome", Words, &|it| escape(&it.reason)),
    ];
    let is_kept = |it: &TableColumn<_>| has_beside || !it.0.starts_with("Evidence given");
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
    let forms: Vec<String> = forms
        .map(|other| {
            let less = minus(&format!("{:.0}", other.evidence_less));
            format!("<li>{} (evidence less by {less})</li>\n", escape(&minus(&other.formula)))
        })
        .collect();
    if !forms.is_empty() {
        body += "<p>Other forms that the force outside the library may have:</p>\n<ul>\n";
        body += &(forms.concat() + "</ul>\n");
    }
    Section { id: "candidates", title: "What else was considered", body }
}
