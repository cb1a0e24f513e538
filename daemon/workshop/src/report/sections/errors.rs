//! Errors before and after the effect, and the speeds behind them.

use dynocar_analysis::dataset::Role;
use dynocar_analysis::explain::report::IntervalEstimate;
use dynocar_analysis::explain::report::errors::{ErrorPair, Resampling, RunErrors};
use dynocar_analysis::explain::report::timeline::Trace;
use dynocar_analysis::explain::stop_to_stop::{Judged, StopToStop, reduction};

use super::{PageSection, Subject};
use crate::report::html::ColumnAlignment::{Names, Numbers, Words};
use crate::report::html::{
    TableColumn, details, escape, estimate, legend, marked_table, percent, table,
};
use crate::report::plots::{PlotError, figure, series, speeds, wide_and_narrow};

/// Returns the section.
///
/// # Errors
///
/// When a plot cannot be drawn.
pub fn section(subject: &Subject) -> Result<PageSection, PlotError> {
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
    Ok(PageSection { id: "error", title: "Error before and after", body })
}

/// A row of the summary: the runs; their errors before and after, and the reduction; true for the row that judges the
/// model.
type SummaryRow = (String, [String; 3], bool);

fn summary(subject: &Subject) -> String {
    let errors = &subject.data.errors;
    let pairs = [
        ("Holdout, whole runs", errors.holdout),
        ("Holdout, restarted every 60 s", errors.holdout_window60),
        ("Fit, whole runs", errors.fit),
        ("Fit, restarted every 60 s", errors.fit_window60),
    ];
    let is_by_stops = errors.holdout_stop_to_stop.is_some();
    let mut rows: Vec<SummaryRow> = Vec::new();
    for (k, (name, pair)) in pairs.into_iter().enumerate() {
        let Some(pair) = pair else { continue };
        let [before, after] = [&pair.before_mps, &pair.after_mps].map(estimate);
        let cells = [before, after, percent(&pair.reduction)];
        rows.push((name.into(), cells, k == 0 && !is_by_stops));
    }
    for (name, found) in
        [("Holdout", &errors.holdout_stop_to_stop), ("Fit", &errors.fit_stop_to_stop)]
    {
        rows.extend(found.iter().flat_map(|found| stop_to_stop(name, found)));
    }
    let before = if subject.has_effect() { "Before, m/s" } else { "Error, m/s" };
    let columns: [TableColumn<SummaryRow>; 4] = [
        ("Runs", Words, &|row| row.0.clone()),
        (before, Numbers, &|row| row.1[0].clone()),
        ("After, m/s", Numbers, &|row| row.1[1].clone()),
        ("Taken away", Numbers, &|row| row.1[2].clone()),
    ];
    // Without an effect there is no 'after'.
    let shown = if subject.has_effect() { &columns[..] } else { &columns[..2] };
    let caption = "Error of the predicted speed with 95 % intervals";
    let note = intervals(errors.holdout, errors.fit);
    marked_table(caption, shown, &rows, |row| row.2) + &format!("<p class=\"note\">{note}</p>\n")
}

/// Returns the rows of the errors from stop to stop: the one that judges, and the middle one.
fn stop_to_stop(name: &str, found: &StopToStop) -> [SummaryRow; 2] {
    let row =
        |what: &str, mps: [f64; 2], intervals: Option<[[f64; 2]; 2]>, taken: IntervalEstimate| {
            let side = |side: usize| {
                let interval = intervals.map(|both| both[side]);
                estimate(&IntervalEstimate { value: mps[side], interval })
            };
            let cells = [side(0), side(1), percent(&taken)];
            (format!("{name}, from stop to stop, {what} {}", found.runs), cells)
        };
    let judged = Judged::from(found);
    let taken =
        IntervalEstimate { value: judged.reduction, interval: judged.reduction_interval_95 };
    let of_median = IntervalEstimate { value: reduction(found.median_mps), interval: None };
    let (all, cells) = row("all", judged.error_mps, judged.interval_95_mps, taken);
    let (middle, of_middle) = row("median of", found.median_mps, found.interval_95_mps, of_median);
    [(all, cells, name == "Holdout"), (middle, of_middle, false)]
}

/// Returns how the intervals were found.
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

fn by_run(subject: &Subject) -> Result<String, PlotError> {
    let mut figures = String::new();
    for (role, name) in [(Role::Holdout, "Holdout runs"), (Role::Fit, "Fit runs")] {
        let own = subject.errors_of(role);
        if !own.is_empty() {
            figures +=
                &figure("", name, "", &[series::errors_of_runs(&own, role, subject.has_effect())?]);
        }
    }
    let side = |errors: Option<[f64; 2]>, side: usize| match errors {
        Some(errors) if side == 0 || subject.has_effect() => format!("{:.3}", errors[side]),
        _ => "–".into(),
    };
    let columns: [TableColumn<&RunErrors>; 7] = [
        ("Run", Numbers, &|run| subject.number(&run.file).to_string()),
        ("File", Names, &|run| escape(&run.file)),
        ("Role", Words, &|run| run.role.name().into()),
        ("Before, m/s", Numbers, &|run| side(run.full_run_mps, 0)),
        ("After, m/s", Numbers, &|run| side(run.full_run_mps, 1)),
        ("60 s before", Numbers, &|run| side(run.window60_mps, 0)),
        ("60 s after", Numbers, &|run| side(run.window60_mps, 1)),
    ];
    let mut ordered: Vec<&RunErrors> = subject.data.errors.by_run.iter().collect();
    ordered.sort_by_key(|run| subject.number(&run.file));
    let table = details("The same as a table", &table("Error of every run", &columns, &ordered));
    let key = key(subject, false);
    Ok(format!("<h3>Run by run</h3>\n{key}<div class=\"panels\">\n{figures}</div>\n{table}"))
}

fn key(subject: &Subject, has_lines: bool) -> String {
    let mut entries = Vec::new();
    if has_lines {
        entries.push(("line measured", "measured"));
    }
    let (before, after) =
        if has_lines { ("line before", "line after") } else { ("ring before", "dot after") };
    entries.push((before, subject.before()));
    entries.extend(subject.has_effect().then_some((after, "after")));
    if has_lines && subject.data.traces.iter().any(|trace| !trace.acting_s.is_empty()) {
        entries.push(("area acting", "where the effect acts"));
    }
    legend(&entries)
}

fn trace_figure(subject: &Subject, trace: &Trace) -> Result<String, PlotError> {
    let run = subject.run(&trace.file);
    let plots = wide_and_narrow(|width| speeds::draw(trace, run, width, subject.has_effect()))?;
    let errors = match trace.rmse_mps {
        Some([before, after]) if subject.has_effect() => {
            format!(": {before:.3} m/s before, {after:.3} m/s after")
        }
        Some([before, _]) => format!(": {before:.3} m/s"),
        None => String::new(),
    };
    let (number, file, role) =
        (subject.number(&trace.file), escape(&trace.file), trace.role.name());
    let caption = format!("Run {number}, {file} ({role}){errors}");
    Ok(figure("trace", &caption, &key(subject, true), &plots))
}
