//! What was fitted.

use dynocar_analysis::explain::report::parameters::ParameterRow;
use dynocar_analysis::explain::report::words::number;

use super::{Section, places};
use crate::report::Subject;
use crate::report::html::Column::{Numbers, Words};
use crate::report::html::{TableColumn, escape, estimate, marked_table};

/// The section.
pub fn section(subject: &Subject) -> Section {
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
    body += &places::table(subject);
    Section { id: "parameters", title: "Parameters", body }
}

/// True for a, b and c.
fn is_base(row: &ParameterRow) -> bool {
    row.before.is_some()
}
