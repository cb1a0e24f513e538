//! How to get the same again.

use std::fmt::Write as _;

use super::Section;
use crate::report::Subject;
use crate::report::html::{Column, Table, escape, grouped};

/// The section.
pub fn section(subject: &Subject) -> Section {
    let provenance = &subject.provenance;
    let mut body = format!(
        "<p>The same dataset and version give the same numbers: nothing is drawn at random without \
         a fixed seed.</p>\n<dl class=\"sources\">\n\
         <div><dt>Command</dt><dd><code>{}</code></dd></div>\n\
         <div><dt>Program</dt><dd>dynocar {}, {}</dd></div>\n\
         <div><dt>Dataset</dt><dd>SHA-256 <code class=\"hash\">{}</code></dd></div>\n\
         <div><dt>To check it, in the dataset's folder</dt><dd><code>{}</code></dd></div>\n</dl>\n",
        escape(&provenance.command),
        provenance.version,
        escape(&provenance.machine),
        provenance.sha256,
        escape(&provenance.check_command())
    );
    let head = [("File", Column::Names), ("Bytes", Column::Numbers), ("SHA-256", Column::Words)];
    let mut table = Table::new("The files that were read", &head);
    for file in &provenance.files {
        table.push(vec![
            escape(&file.path),
            grouped(file.bytes),
            format!("<code class=\"hash\">{}</code>", file.sha256),
        ]);
    }
    // Writing to a string cannot fail.
    let _ = write!(
        body,
        "<details>\n<summary>The files that were read</summary>\n{}</details>\n",
        table.html()
    );
    Section { id: "reproduce", title: "How to reproduce", body }
}
