//! Error before and after, and the speeds behind it.

use std::fmt::Write as _;

use dynocar_analysis::dataset::Role;
use dynocar_analysis::explain::judged::Judged;
use dynocar_analysis::explain::report::Estimate;
use dynocar_analysis::explain::report::errors::{ErrorPair, Resampling, RunErrors};
use dynocar_analysis::explain::report::traces::Trace;
use dynocar_analysis::explain::stop_to_stop::{StopToStop, reduction};

use super::{Section, legend};
use crate::report::html::{Column, Table, escape, estimate, percent};
use crate::report::plots::speeds::Width;
use crate::report::plots::{figure, runs, speeds};
use crate::report::{ReportError, Subject};

/// The section.
///
/// # Errors
///
/// When a plot cannot be drawn.
pub fn section(subject: &Subject) -> Result<Section, ReportError> {
    let mut body = String::from(
        "<p>Each model starts at a run’s first measured speed, is driven by the reported forces to \
         the end, and its speed is compared with the measured one (root mean square over moving \
         samples). From stop to stop it starts anew at each departure: where runs hold stops, the model \
         is judged by that, since over a whole run an error at one stop is carried on. Holdout runs took \
         no part in any fit. ",
    );
    body += if subject.has_effect() {
        "‘Before’ is the declared model with a, b, c refitted on the fit runs, ‘after’ the same \
         with the effect, everything refitted.</p>\n"
    } else {
        "The model is the declared one with a, b, c refitted on the fit runs; no effect was \
         added.</p>\n"
    };
    body += &summary(subject);
    body += &by_run(subject)?;
    for trace in &subject.data.traces {
        body += &trace_figure(subject, trace)?;
    }
    Ok(Section { id: "error", title: "Error before and after", body })
}

fn summary(subject: &Subject) -> String {
    let head = [
        ("Runs", Column::Words),
        (if subject.has_effect() { "Before, m/s" } else { "Error, m/s" }, Column::Numbers),
        ("After, m/s", Column::Numbers),
        ("Taken away", Column::Numbers),
    ];
    // Without an effect there is no 'after'.
    let columns = if subject.has_effect() { 4 } else { 2 };
    let caption = "Error of the predicted speed with 95 % intervals";
    let mut table = Table::new(caption, &head[..columns]);
    let errors = &subject.data.errors;
    let rows = [
        ("Holdout, whole runs", errors.holdout),
        ("Holdout, restarted every 60 s", errors.holdout_window60),
        ("Fit, whole runs", errors.fit),
        ("Fit, restarted every 60 s", errors.fit_window60),
    ];
    let is_by_stops = errors.holdout_stop_to_stop.is_some();
    for (k, (name, pair)) in rows.into_iter().enumerate() {
        let Some(pair) = pair else { continue };
        let mut cells = vec![
            name.into(),
            estimate(&pair.before_mps),
            estimate(&pair.after_mps),
            percent(&pair.reduction),
        ];
        cells.truncate(columns);
        if k == 0 && !is_by_stops { table.push_marked(cells) } else { table.push(cells) }
    }
    for (name, found) in
        [("Holdout", &errors.holdout_stop_to_stop), ("Fit", &errors.fit_stop_to_stop)]
    {
        let Some(found) = found else { continue };
        for (k, mut cells) in stop_to_stop(name, found).into_iter().enumerate() {
            cells.truncate(columns);
            if k == 0 && name == "Holdout" { table.push_marked(cells) } else { table.push(cells) }
        }
    }
    let mut html = table.html();
    let _ = writeln!(html, "<p class=\"note\">{}</p>", intervals(errors.holdout, errors.fit));
    html
}

/// The rows of the errors from stop to stop: the one that judges, and the middle one.
fn stop_to_stop(name: &str, found: &StopToStop) -> [Vec<String>; 2] {
    let row =
        |what: &str, errors_mps: [f64; 2], intervals: Option<[[f64; 2]; 2]>, taken: String| {
            let side = |side: usize| {
                let interval = intervals.map(|both| both[side]);
                estimate(&Estimate { value: errors_mps[side], interval })
            };
            vec![format!("{name}, from stop to stop, {what}"), side(0), side(1), taken]
        };
    let judged = Judged::from(found);
    let taken = Estimate { value: judged.reduction, interval: judged.reduction_interval_95 };
    let of_median = Estimate { value: reduction(found.median_mps), interval: None };
    let (all, middle) = (format!("all {}", found.runs), format!("median of {}", found.runs));
    [
        row(&all, judged.error_mps, judged.interval_95_mps, percent(&taken)),
        row(&middle, found.median_mps, found.interval_95_mps, percent(&of_median)),
    ]
}

/// How the intervals were found.
fn intervals(holdout: Option<ErrorPair>, fit: Option<ErrorPair>) -> String {
    let words = |pair: ErrorPair, name: &str| match pair.resampling {
        Resampling::Runs(2) => format!(
            "The two {name} runs are drawn with replacement: with so few, an interval hardly says \
             more than how the two differ."
        ),
        Resampling::Runs(count) => {
            format!("Intervals: bootstrap over the {count} {name} runs.")
        }
        Resampling::Blocks(count) => format!(
            "There is only one {name} run: its intervals are a bootstrap over its {count} blocks \
             of 60 s and say nothing of other runs; errors that last longer than a block make them \
             too narrow."
        ),
    };
    let holdout = match holdout {
        Some(pair) => words(pair, "holdout"),
        None => "No run was held out: nothing here is judged on fresh data.".into(),
    };
    let fit = fit.map_or(String::new(), |pair| words(pair, "fit"));
    format!("{holdout} {fit}")
}

fn by_run(subject: &Subject) -> Result<String, ReportError> {
    let errors = &subject.data.errors.by_run;
    let mut html = String::new();
    let mut figures = String::new();
    for (role, name) in [(Role::Holdout, "Holdout"), (Role::Fit, "Fit")] {
        let own: Vec<(usize, &RunErrors)> = errors
            .iter()
            .filter(|run| run.role == role)
            .map(|run| (subject.number(&run.file), run))
            .collect();
        if own.is_empty() {
            continue;
        }
        let plot = runs::draw(&own, role, subject.has_effect()).map_err(|source| {
            ReportError::Plot { plot: format!("the errors of the {name} runs"), source }
        })?;
        figures += &figure("", &format!("{name} runs"), "", &[plot]);
    }
    html += "<h3>Run by run</h3>\n";
    html += &key(subject, false);
    let _ = write!(html, "<div class=\"panels\">\n{figures}</div>\n");
    let head = [
        ("Run", Column::Numbers),
        ("File", Column::Names),
        ("Role", Column::Words),
        ("Before, m/s", Column::Numbers),
        ("After, m/s", Column::Numbers),
        ("60 s before", Column::Numbers),
        ("60 s after", Column::Numbers),
    ];
    let mut table = Table::new("Error of every run", &head);
    let mut ordered: Vec<&RunErrors> = errors.iter().collect();
    ordered.sort_by_key(|run| subject.number(&run.file));
    for run in ordered {
        let side = |errors: Option<[f64; 2]>, side: usize| match errors {
            Some(errors) if side == 0 || subject.has_effect() => format!("{:.3}", errors[side]),
            _ => "–".into(),
        };
        table.push(vec![
            subject.number(&run.file).to_string(),
            escape(&run.file),
            run.role.name().into(),
            side(run.full_run_mps, 0),
            side(run.full_run_mps, 1),
            side(run.window60_mps, 0),
            side(run.window60_mps, 1),
        ]);
    }
    let _ = write!(
        html,
        "<details>\n<summary>The same as a table</summary>\n{}</details>\n",
        table.html()
    );
    Ok(html)
}

fn key(subject: &Subject, has_lines: bool) -> String {
    let mut entries = Vec::new();
    if has_lines {
        entries.push(("line measured", "measured"));
    }
    let (before, after) =
        if has_lines { ("line before", "line after") } else { ("ring before", "dot after") };
    if subject.has_effect() {
        entries.extend([(before, "before"), (after, "after")]);
    } else {
        entries.push((before, "declared model, a, b, c refitted"));
    }
    if has_lines && subject.data.traces.iter().any(|trace| !trace.acting_s.is_empty()) {
        entries.push(("area acting", "where the effect acts"));
    }
    legend(&entries)
}

fn trace_figure(subject: &Subject, trace: &Trace) -> Result<String, ReportError> {
    let draw = |width| {
        speeds::draw(trace, width, subject.has_effect())
            .map_err(|source| ReportError::Plot { plot: trace.file.clone(), source })
    };
    let (wide, narrow) = (draw(Width::Wide)?, draw(Width::Narrow)?);
    let role = if trace.role == Role::Holdout { "holdout" } else { "fit" };
    let errors = match trace.rmse_mps {
        Some([before, after]) if subject.has_effect() => {
            format!(": {before:.3} m/s before, {after:.3} m/s after")
        }
        Some([before, _]) => format!(": {before:.3} m/s"),
        None => String::new(),
    };
    let (number, file) = (subject.number(&trace.file), escape(&trace.file));
    let caption = format!("Run {number}, {file} ({role}){errors}");
    Ok(figure("trace", &caption, &key(subject, true), &[wide, narrow]))
}
