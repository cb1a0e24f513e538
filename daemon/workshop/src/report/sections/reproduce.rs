//! How to get the same again.

use super::Section;
use crate::report::html::Column::{Names, Numbers, Words};
use crate::report::html::{TableColumn, details, escape, grouped, table};
use crate::report::provenance::{FileDigest, Provenance};

/// The section.
pub fn section(provenance: &Provenance) -> Section {
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
    let columns: [TableColumn<FileDigest>; 3] = [
        ("File", Names, &|file| escape(&file.path)),
        ("Bytes", Numbers, &|file| grouped(file.bytes)),
        ("SHA-256", Words, &|file| format!("<code class=\"hash\">{}</code>", file.sha256)),
    ];
    let title = "The files that were read";
    body += &details(title, &table(title, &columns, &provenance.files));
    Section { id: "reproduce", title: "How to reproduce", body }
}
