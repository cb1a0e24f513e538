//! What was fitted.

use dynocar_analysis::explain::report::words::number;

use super::{Section, places};
use crate::report::Subject;
use crate::report::html::{Column, Table, escape, estimate};

/// The section.
pub fn section(subject: &Subject) -> Section {
    let has_effect = subject.has_effect();
    let head = [
        ("Parameter", Column::Words),
        ("Unit", Column::Words),
        ("Declared", Column::Numbers),
        (if has_effect { "Without the effect" } else { "Fitted" }, Column::Numbers),
        ("With the effect", Column::Numbers),
    ];
    let shown = if has_effect { &head[..] } else { &head[..4] };
    let mut table = Table::new("Parameters with 95 % intervals, speeds in m/s", shown);
    for row in &subject.data.parameters {
        let is_base = row.before.is_some();
        let group = if is_base { String::new() } else { format!("{}: ", escape(&row.group)) };
        let name = format!("{group}{} <code>{}</code>", escape(&row.meaning), escape(&row.name));
        let half = row.after.interval.map(|[low, high]| 0.5 * (high - low));
        let mut cells = vec![
            name,
            escape(row.unit),
            row.declared.map_or("–".into(), |value| {
                // A declared value shows its own digits, not more than the estimate's.
                let text = number(value, half);
                let own = value.to_string();
                if own.len() < text.len() { own.replacen('-', "−", 1) } else { text }
            }),
            row.before.as_ref().map_or("–".into(), estimate),
        ];
        if has_effect {
            cells.push(estimate(&row.after));
        }
        if is_base { table.push(cells) } else { table.push_marked(cells) }
    }
    let mut body = table.html();
    body += "<p class=\"note\">Basic resistance is a + b v + c v² in N/kN. Intervals are 1.96 \
             standard deviations to either side; the deviations hold the scatter from run to run \
             and the small number of runs. a, b and c are strongly correlated: judge them together, \
             by the resistance at a speed.</p>\n";
    body += &places::table(subject);
    Section { id: "parameters", title: "Parameters", body }
}
