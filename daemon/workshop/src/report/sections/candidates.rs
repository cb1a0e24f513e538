//! What else was considered, and why it lost.

use dynocar_analysis::explain::evidence::SCORE_MIN;
use dynocar_analysis::explain::identifiability::not_held;

use super::Section;
use crate::report::Subject;
use crate::report::html::{Column, Table, escape, minus};

/// The section.
pub fn section(subject: &Subject) -> Section {
    let has_beside = subject.data.candidates.iter().any(|row| row.beside.is_some());
    let head = [
        ("Candidate", Column::Words),
        ("Evidence alone", Column::Numbers),
        ("Error taken away alone", Column::Numbers),
        ("Evidence given what was found", Column::Numbers),
        ("Outcome", Column::Words),
    ];
    let kept: Vec<(&str, Column)> = head
        .into_iter()
        .filter(|(name, _)| has_beside || !name.starts_with("Evidence given"))
        .collect();
    let mut table = Table::new("All kinds of the library", &kept);
    for row in &subject.data.candidates {
        let evidence =
            |value: Option<f64>| value.map_or("–".into(), |value| minus(&format!("{value:.0}")));
        let mut cells = vec![
            format!("{} <code>{}</code>", escape(row.title), row.kind),
            evidence(row.alone),
            row.reduction.map_or("–".into(), |share| minus(&format!("{:.0} %", 100.0 * share))),
        ];
        if has_beside {
            cells.push(evidence(row.beside));
        }
        cells.push(escape(&row.reason));
        if row.is_found { table.push_marked(cells) } else { table.push(cells) }
    }
    let mut body = format!(
        "<p>Every kind of the library was fitted together with a, b and c. Evidence is the \
         decrease of −2 log likelihood less the price of the parameters and of the structures \
         that were tried; times the square of the share of the error that it takes away, of runs \
         that were fitted and of runs left out of the fit, it must exceed {SCORE_MIN:.0}, and the effect \
         must be large enough to matter. ‘Alone’ is on top of a, b and c only.</p>\n"
    );
    if subject.data.candidates.is_empty() {
        body += "<p>The runs hold too little motion for any of them.</p>\n";
    } else {
        body += &table.html();
    }
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
