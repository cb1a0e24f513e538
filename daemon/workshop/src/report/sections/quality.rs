//! What the data are like.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use dynocar_analysis::dataset::{ForceSource, GradientSource, OrderCounts, PositionSource, Run};
use dynocar_analysis::explain::evidence::RunData;

use super::Section;
use crate::report::Subject;
use crate::report::html::{Column, Table, count, escape, grouped};
use crate::run_facts::{mass_t, recorded, recorded_in_words};

/// The section.
pub fn section(subject: &Subject) -> Section {
    let explanation = subject.explanation;
    let used: Vec<(&Run, Option<&RunData>)> = subject
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
    let mut body = format!(
        "<p>{} of {} rows were used, {:.1} h of motion. Nothing is dropped silently: what was \
         rejected, replaced or missing is counted here.</p>\n",
        grouped(samples),
        grouped(rows),
        moving_s / 3600.0
    );
    body += &runs_table(&used);
    body += &counts_table(&used);
    body += &sources(subject);
    body += &diagnostics(subject);
    Section { id: "quality", title: "Data quality", body }
}

fn runs_table(used: &[(&Run, Option<&RunData>)]) -> String {
    let has_date = used.iter().any(|(run, _)| recorded(run).is_some());
    let mut head = vec![("Run", Column::Numbers), ("File", Column::Names)];
    head.extend(has_date.then_some(("Recorded (UTC)", Column::Words)));
    head.extend([
        ("Role", Column::Words),
        ("Direction", Column::Numbers),
        ("Mass, t", Column::Numbers),
        ("Duration, s", Column::Numbers),
        ("Distance, km", Column::Numbers),
        ("Top speed, m/s", Column::Numbers),
        ("Rows", Column::Numbers),
        ("Used", Column::Numbers),
        ("Rejected", Column::Numbers),
        ("Outliers replaced", Column::Numbers),
        ("Gaps (longest)", Column::Numbers),
        ("Restarts", Column::Numbers),
    ]);
    let mut table = Table::new("The runs", &head);
    for (run, data) in used {
        let quality = &run.quality;
        let of_data = |value: &dyn Fn(&RunData) -> String| data.map_or("–".into(), value);
        let mut row = vec![run.number.to_string(), escape(&run.file)];
        row.extend(has_date.then(|| recorded_in_words(run)));
        row.extend([
            run.role.name().into(),
            if run.direction > 0 { "+1".into() } else { "−1".into() },
            mass_t(run),
            format!("{:.0}", quality.duration_s),
            format!("{:.1}", quality.distance_m / 1000.0),
            quality.speed_range_mps.map_or("–".into(), |(_, high)| format!("{high:.1}")),
            grouped(quality.lines.rows),
            of_data(&|data| grouped(data.samples().len())),
            of_data(&|data| count(data.rejected)),
            of_data(&|data| count(data.replaced)),
            gaps(&quality.order),
            of_data(&|data| count(data.recording.restarts())),
        ]);
        table.push(row);
    }
    table.html()
}

fn gaps(order: &OrderCounts) -> String {
    match order.gaps {
        0 => "–".into(),
        gaps => format!("{gaps} ({:.1} s)", order.longest_gap_s),
    }
}

/// What was rejected, by reason, and what is missing, by quantity, run by run.
fn counts_table(used: &[(&Run, Option<&RunData>)]) -> String {
    let mut rows: BTreeMap<(u8, String), BTreeMap<u32, usize>> = BTreeMap::new();
    let mut add = |group: u8, what: &str, run: &Run, count: usize| {
        if count > 0 {
            *rows
                .entry((group, what.replace('_', " ")))
                .or_default()
                .entry(run.number)
                .or_default() += count;
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
    let numbers: Vec<String> = used.iter().map(|(run, _)| format!("Run {}", run.number)).collect();
    let mut head = vec![("What", Column::Words)];
    head.extend(numbers.iter().map(|name| (name.as_str(), Column::Numbers)));
    head.push(("All", Column::Numbers));
    let mut table = Table::new("Rejected, missing and outlying, by run", &head);
    for ((group, what), by_run) in &rows {
        let title = ["Rejected", "Missing", "Outlying"][usize::from(*group)];
        let mut cells = vec![format!("{title}: {}", escape(what))];
        cells.extend(
            used.iter().map(|(run, _)| count(by_run.get(&run.number).copied().unwrap_or(0))),
        );
        cells.push(grouped(by_run.values().sum()));
        table.push(cells);
    }
    table.html()
}

fn sources(subject: &Subject) -> String {
    let runs = &subject.dataset.runs;
    let force = |source: ForceSource| match source {
        ForceSource::Column => "as recorded",
        ForceSource::ControlForce => "from the signed control force",
        ForceSource::Handle => "from the handle's share of the effort curve",
        ForceSource::Pressure => "from the friction brake's pressure",
        ForceSource::Power => "from the drive's power over the speed",
        ForceSource::None => "not recorded",
    };
    let position = |run: &Run| match run.position_source {
        PositionSource::Column => "as recorded",
        PositionSource::IntegratedSpeed => "integrated from the speed",
    };
    let gradient = |run: &Run| match run.gradient_source {
        GradientSource::Track => "from the line's file",
        GradientSource::Column => "as recorded",
        GradientSource::SpecificForce => "from the accelerometer",
        GradientSource::Altitude => "from the altitude",
        GradientSource::Unknown => "unknown, taken as level",
    };
    let line = |name: &str, of: &dyn Fn(&Run) -> &'static str| {
        let mut words: Vec<&str> = runs.iter().map(of).collect();
        words.sort_unstable();
        words.dedup();
        format!("<div><dt>{name}</dt><dd>{}</dd></div>\n", words.join("; "))
    };
    let mut html = String::from("<dl class=\"sources\">\n");
    html += &line("Position", &position);
    html += &line("Gradient", &gradient);
    html += &line("Traction force", &|run| force(run.traction_source));
    html += &line("Brake force", &|run| force(run.brake_source));
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
        let _ = writeln!(html, "<li>Run {}: {}</li>", runs.join(", "), escape(&text));
    }
    html + "</ul>\n"
}
