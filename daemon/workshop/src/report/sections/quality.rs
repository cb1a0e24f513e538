//! Quality of the data, and the command that repeats the result.

use std::collections::BTreeMap;

use dynocar_analysis::dataset::{OrderCounts, Run};
use dynocar_analysis::explain::evidence::RunData;

use super::{PageSection, Subject};
use crate::report::html::ColumnAlignment::{Names, Numbers, Words};
use crate::report::html::{TableColumn, count, details, escape, grouped, table};
use crate::report::provenance::{FileDigest, Provenance};
use crate::run_facts::{self, mass_t, recorded, recorded_in_words};

/// Returns the section.
pub fn section(subject: &Subject) -> PageSection {
    let explanation = subject.explanation;
    let used: Vec<UsedRun> = subject
        .dataset
        .runs
        .iter()
        .map(|run| {
            let mut all = explanation.problem.runs.iter().chain(&explanation.holdout);
            (run, all.find(|data| data.file == run.file))
        })
        .collect();
    let samples: usize =
        used.iter().filter_map(|(_, data)| Some(data.as_ref()?.samples().len())).sum();
    let rows: usize = used.iter().map(|(run, _)| run.quality.lines.rows).sum();
    let moving_s: f64 = used.iter().filter_map(|(_, data)| Some(data.as_ref()?.moving_s())).sum();
    let counted =
        "Nothing is dropped silently: what was rejected, replaced or missing is counted here.";
    let searched = used.iter().filter(|(_, data)| data.is_some()).count();
    let mut body = if searched < used.len() {
        format!(
            "<p>The search looked at {searched} of {} runs, each second as one mean, {:.1} h of motion. {counted}</p>\n",
            grouped(used.len()),
            moving_s / 3600.0
        )
    } else {
        format!(
            "<p>{} of {} rows were used, {:.1} h of motion. {counted}</p>\n",
            grouped(samples),
            grouped(rows),
            moving_s / 3600.0
        )
    };
    body += &runs_table(&used);
    body += &counts_table(&used);
    body += &sources(subject);
    body += &diagnostics(subject);
    PageSection { id: "quality", title: "Data quality", body }
}

/// A run and its used data.
type UsedRun<'a> = (&'a Run, Option<&'a RunData>);

fn runs_table(used: &[UsedRun]) -> String {
    let of_data = |it: &UsedRun, value: fn(&RunData) -> String| it.1.map_or("–".into(), value);
    let top_mps = |run: &Run| run.quality.speed_range_mps.map(|(_, high)| format!("{high:.1}"));
    let columns: [TableColumn<UsedRun>; 15] = [
        ("Run", Numbers, &|it| it.0.number.to_string()),
        ("File", Names, &|it| escape(&it.0.file)),
        ("Recorded (UTC)", Words, &|it| recorded_in_words(it.0)),
        ("Role", Words, &|it| it.0.role.name().into()),
        ("Direction", Numbers, &|it| if it.0.direction > 0 { "+1".into() } else { "−1".into() }),
        ("Mass, t", Numbers, &|it| mass_t(it.0)),
        ("Duration, s", Numbers, &|it| format!("{:.0}", it.0.quality.duration_s)),
        ("Distance, km", Numbers, &|it| format!("{:.1}", it.0.quality.distance_m / 1000.0)),
        ("Top speed, m/s", Numbers, &|it| top_mps(it.0).unwrap_or("–".into())),
        ("Rows", Numbers, &|it| grouped(it.0.quality.lines.rows)),
        ("Used", Numbers, &|it| of_data(it, |data| grouped(data.samples().len()))),
        ("Rejected", Numbers, &|it| of_data(it, |data| count(data.rejected))),
        ("Outliers replaced", Numbers, &|it| of_data(it, |data| count(data.replaced))),
        ("Gaps (longest)", Numbers, &|it| gaps(&it.0.quality.order)),
        ("Restarts", Numbers, &|it| of_data(it, |data| count(data.recording.restarts()))),
    ];
    let has_date = used.iter().any(|(run, _)| recorded(run).is_some());
    let is_shown = |it: &TableColumn<_>| has_date || !it.0.starts_with("Recorded");
    table("The runs", &columns.into_iter().filter(is_shown).collect::<Vec<_>>(), used)
}

fn gaps(order: &OrderCounts) -> String {
    match order.gaps {
        0 => "–".into(),
        gaps => format!("{gaps} ({:.1} s)", order.longest_gap_s),
    }
}

/// Returns the table of rejections by reason and missing values by quantity, run by run.
fn counts_table(used: &[UsedRun]) -> String {
    let mut rows: BTreeMap<(u8, String), BTreeMap<u32, usize>> = BTreeMap::new();
    let mut add = |group: u8, what: &str, run: &Run, count: usize| {
        if count > 0 {
            let by_run = rows.entry((group, what.replace('_', " "))).or_default();
            *by_run.entry(run.number).or_default() += count;
        }
    };
    for (run, _) in used {
        let quality = &run.quality;
        for refused in &quality.refused {
            add(0, refused.reason.name(), run, refused.count);
        }
        for missing in &quality.missing {
            add(1, missing.quantity.name(), run, missing.count);
        }
        add(1, "rows, by the time that passed", run, quality.order.missing_rows as usize);
        add(1, "rows without a time", run, quality.rows_without_time);
        for outlier in &quality.outliers {
            add(2, outlier.quantity.name(), run, outlier.count);
        }
    }
    if rows.is_empty() {
        return "<p>No sample was rejected and no value is missing.</p>\n".into();
    }
    type Row = ((u8, String), BTreeMap<u32, usize>);
    let what = |((group, what), _): &Row| {
        let title = ["Rejected", "Missing", "Outlying"][usize::from(*group)];
        format!("{title}: {}", escape(what))
    };
    let of_run = |(run, _): &UsedRun| {
        let number = run.number;
        let cell = move |row: &Row| count(row.1.get(&number).copied().unwrap_or(0));
        (format!("Run {number}"), cell)
    };
    let runs: Vec<_> = used.iter().map(of_run).collect();
    let mut columns: Vec<TableColumn<Row>> = vec![("What", Words, &what)];
    columns.extend(runs.iter().map(|(name, cell)| (&name[..], Numbers, cell as _)));
    columns.push(("All", Numbers, &|row| grouped(row.1.values().sum())));
    let rows: Vec<Row> = rows.into_iter().collect();
    table("Rejected, missing and outlying, by run", &columns, &rows)
}

fn sources(subject: &Subject) -> String {
    let runs = &subject.dataset.runs;
    let mut html = String::from("<dl class=\"sources\">\n");
    let names = ["Position", "Gradient", "Traction force", "Brake force"];
    for (place, name) in names.into_iter().enumerate() {
        let mut words: Vec<&str> = runs.iter().map(|run| run_facts::sources(run)[place]).collect();
        words.sort_unstable();
        words.dedup();
        html += &format!("<div><dt>{name}</dt><dd>{}</dd></div>\n", words.join("; "));
    }
    html + "</dl>\n"
}

fn diagnostics(subject: &Subject) -> String {
    let mut by_text: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for run in &subject.dataset.runs {
        for diagnostic in &run.diagnostics {
            by_text.entry(diagnostic.to_string()).or_default().push(run.number.to_string());
        }
    }
    if by_text.is_empty() {
        return String::new();
    }
    let mut html = String::from("<h3>Diagnostics</h3>\n<ul class=\"remarks\">\n");
    for (text, runs) in by_text {
        html += &format!("<li>Run {}: {}</li>\n", runs.join(", "), escape(&text));
    }
    html + "</ul>\n"
}

/// Returns the section.
pub fn reproduce(provenance: &Provenance) -> PageSection {
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
    PageSection { id: "reproduce", title: "How to reproduce", body }
}
