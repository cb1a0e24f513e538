//! Contents of a file as understood, with pictures; of a dataset its runs: motion, quality of the data, notes.

use std::iter;
use std::path::Path;
use std::sync::Arc;

use dynocar::cli::Failure;
use dynocar::cli::text::{TextTable, WIDTH, short, wrap};
use dynocar::config::DaemonConfig;
use dynocar::dataset::FileKind;
use dynocar::output::{report_line, write_in_folder};
use dynocar_analysis::dataset::quality::{QuantityCount, ReasonCount};
use dynocar_analysis::dataset::{
    DatasetDiagnostic, DatasetError, Diagnostic, Manifest, Phases, Quantity, Role, Run, RunQuality,
    dataset_diagnostic, formats,
};
use dynocar_analysis::explain::report::residual_line::AlongLine;
use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;

use crate::report::plots::{Width, as_file, effort, line};
use crate::run_facts::{self, mass_t, moment, recorded, recorded_in_words};

type Read = Result<Run, DatasetError>;

/// Returns the tables and diagnostics of all runs.
pub(super) fn report(
    manifest: &Manifest,
    runs: &[Read],
    of_dataset: &[DatasetDiagnostic],
) -> String {
    let count = |role| manifest.runs.iter().filter(|run| run.role == role).count();
    let (fit, holdout) = (count(Role::Fit), count(Role::Holdout));
    let mut text = format!("runs     {}: {fit} to fit, {holdout} held out\n", runs.len());
    text += &motion_table(manifest, runs).to_string();
    let unit = manifest.speed_unit();
    text += &format!("  {} is the top speed; standing to unknown are seconds\n", unit.name());
    text += "\ndata\n";
    text += &data_table(runs).to_string();
    text.push('\n');
    text += &sources(runs);
    text += &diagnostics(manifest, runs, of_dataset);
    text
}

fn motion_table(manifest: &Manifest, runs: &[Read]) -> TextTable {
    let unit = manifest.speed_unit();
    let has_date = runs.iter().flatten().any(|run| recorded(run).is_some());
    let mut header = vec!["run", "file"];
    header.extend(has_date.then_some("recorded"));
    header.extend(["role", "dir", "t", "from s", "for s", "km", unit.name(), "standing"]);
    header.extend(["coasting", "traction", "braking", "unknown"]);
    let words: &[usize] = if has_date { &[1, 2, 3] } else { &[1, 2] };
    let mut table = TextTable::new(&header, words);
    for (index, run) in runs.iter().enumerate() {
        let entry = &manifest.runs[index];
        let mut row = vec![(index + 1).to_string(), manifest.runs[index].file.clone()];
        if has_date {
            row.push(run.as_ref().map_or_else(|_| String::new(), recorded_in_words));
        }
        row.push(entry.role.name().into());
        row.push(format!("{:+}", entry.direction));
        match run {
            Err(_) => row.push("error".into()),
            Ok(run) => {
                let quality = &run.quality;
                let top = quality.speed_range_mps.map(|(_, high)| unit.from_base(high));
                row.push(mass_t(run));
                row.push(format!("{:.1}", quality.start_s));
                row.push(format!("{:.1}", quality.duration_s));
                row.push(format!("{:.2}", quality.distance_m / 1000.0));
                row.push(top.map_or_else(|| "-".into(), |high| format!("{high:.1}")));
                let Phases { standstill_s, coasting_s, traction_s, braking_s, unknown_s } =
                    quality.phases;
                let phases = [standstill_s, coasting_s, traction_s, braking_s, unknown_s];
                let shown = |s: f64| if s == 0.0 { "-".into() } else { format!("{s:.0}") };
                row.extend(phases.map(shown));
            }
        }
        table.push(row);
    }
    table
}

/// The head of a column and its cell for a run.
type Count = (&'static str, fn(&RunQuality) -> String);
/// Counts of a run, each in a column.
const COUNTS: [Count; 10] = [
    ("rows", |it| it.lines.rows.to_string()),
    ("step s", |it| {
        let about = if it.order.is_regular { "" } else { "~" };
        format!("{about}{}", short(it.order.step_s, 4))
    }),
    ("gaps", |it| it.order.gaps.to_string()),
    ("longest s", |it| short(it.order.longest_gap_s, 1)),
    ("rows missing", |it| (it.order.missing_rows + it.rows_without_time as u64).to_string()),
    ("out of order", |it| it.order.out_of_order.to_string()),
    ("repeated", |it| it.order.repeated.to_string()),
    ("cells missing", |it| total(&it.missing)),
    ("outliers", |it| total(&it.outliers)),
    ("refused", |it| it.refused_in_all().to_string()),
];

fn total(counts: &[QuantityCount]) -> String {
    counts.iter().map(|count| count.count).sum::<usize>().to_string()
}

fn data_table(runs: &[Read]) -> TextTable {
    let header: Vec<&str> = iter::once("run").chain(COUNTS.map(|(name, _)| name)).collect();
    let mut table = TextTable::new(&header, &[]);
    for run in runs.iter().flatten() {
        let counts = COUNTS.iter().enumerate().map(|(index, (_, count))| {
            let shown = count(&run.quality);
            if shown == "0" && index > 1 { "-".into() } else { shown }
        });
        table.push(iter::once(run.number.to_string()).chain(counts).collect());
    }
    table
}

/// Returns where position, gradient and forces come from, with the runs where that differs.
fn sources(runs: &[Read]) -> String {
    let mut text = String::from("sources\n");
    for (place, name) in ["position", "gradient", "traction", "brake"].into_iter().enumerate() {
        let mut groups: Groups<&str> = Vec::new();
        for run in runs.iter().flatten() {
            put(&mut groups, run_facts::sources(run)[place], run.number.to_string());
        }
        let with_runs = |(words, numbers): &(&str, Vec<String>)| {
            format!("{words} (runs {})", numbers.join(", "))
        };
        let parts: Vec<String> = match &groups[..] {
            [(words, _)] => vec![(*words).into()],
            groups => groups.iter().map(with_runs).collect(),
        };
        text += &format!("  {name:12}{}\n", parts.join("; "));
    }
    text
}

/// Properties with the numbers of the runs that share them.
type Groups<T> = Vec<(T, Vec<String>)>;

/// Adds a run's number to the group of the runs that share a property.
fn put<T: PartialEq>(groups: &mut Groups<T>, what: T, number: String) {
    match groups.iter_mut().find(|(other, _)| *other == what) {
        Some((_, numbers)) => numbers.push(number),
        None => groups.push((what, vec![number])),
    }
}

/// Describes each diagnostic once with its runs, impossible data first; empty when all is well.
fn diagnostics(manifest: &Manifest, runs: &[Read], of_dataset: &[DatasetDiagnostic]) -> String {
    let number = |file: &String| {
        let run = runs.iter().flatten().find(|run| run.file == *file);
        run.map_or_else(String::new, |run| run.number.to_string())
    };
    let is_of_one_run = |diagnostic: &DatasetDiagnostic| {
        let own = runs.iter().flatten().flat_map(own_diagnostics);
        own.into_iter().any(|it| it.text == diagnostic.text)
    };
    let reported_first = of_dataset.iter().filter(|diagnostic| !is_of_one_run(diagnostic));
    let mut diagnostics: Groups<String> = reported_first
        .map(|diagnostic| (diagnostic.text.clone(), diagnostic.runs.iter().map(number).collect()))
        .collect();
    for (index, run) in runs.iter().enumerate() {
        let of_run = match run {
            Ok(run) => diagnostics_of(manifest, run),
            Err(error) => vec![error.to_string()],
        };
        for diagnostic in of_run {
            put(&mut diagnostics, diagnostic, (index + 1).to_string());
        }
    }
    let mut text = String::new();
    for (diagnostic, numbers) in diagnostics {
        let runs = match numbers.len() {
            0 => "train and line".into(),
            1 => format!("run {}", numbers[0]),
            _ => format!("runs {}", numbers.join(", ")),
        };
        let lines = wrap(&format!("{runs}: {diagnostic}"), WIDTH);
        text += &format!("  {}\n", lines.join("\n    "));
    }
    if text.is_empty() { text } else { format!("\nnotes\n{text}") }
}

/// Returns a time of a run: in s, as a date where it counts from 1970, or as the clock that its file shows.
fn time(manifest: &Manifest, run: &Run, time_s: f64) -> String {
    let has_format = manifest.mapping(Quantity::Time).is_some_and(|it| it.format.is_some());
    if !has_format || formats::of_run(&run.file).needs_library() {
        let in_s = || format!("{} s", short(time_s, 3));
        return moment(time_s).map_or_else(in_s, |it| it.to_string());
    }
    let of_day_s = time_s.rem_euclid(86_400.0);
    let minutes = (of_day_s / 60.0).floor();
    let (hour, minute) = ((minutes / 60.0).floor(), minutes % 60.0);
    format!("{hour:02}:{minute:02}:{:06.3}", of_day_s - 60.0 * minutes)
}

fn diagnostics_of(manifest: &Manifest, run: &Run) -> Vec<String> {
    let quality = &run.quality;
    let mut diagnostics = Vec::new();
    let mut list = |counts: Vec<String>, what: &str| {
        if !counts.is_empty() {
            diagnostics.push(format!("{what}: {}", counts.join(", ")));
        }
    };
    let by_quantity = |counts: &[QuantityCount]| {
        counts.iter().map(|count| format!("{} {}", count.quantity, count.count)).collect()
    };
    list(by_quantity(&quality.missing), "cells missing");
    list(by_quantity(&quality.outliers), "outliers");
    list(by_quantity(&quality.noise_below_zero), "below zero by noise, set right");
    let refused = quality.refused.iter().map(|refused| {
        let ReasonCount { reason, count, first_line, first_s } = refused;
        let which = if *count == 1 { "" } else { "the first " };
        let at = time(manifest, run, *first_s);
        format!("{reason} {count} ({which}in {}:{first_line}, at {at})", run.file)
    });
    list(refused.collect(), "refused by validation");
    if quality.rows_without_time > 0 {
        diagnostics.push(format!("rows without a time, not usable: {}", quality.rows_without_time));
    }
    if quality.lines.short > 0 {
        diagnostics.push(format!("rows with fewer cells than the header: {}", quality.lines.short));
    }
    if !quality.order.is_regular {
        diagnostics.push("the time step varies, so that missing rows cannot be counted".into());
    }
    diagnostics.extend(own_diagnostics(run).map(|diagnostic| diagnostic.text.clone()));
    diagnostics
}

/// Returns the diagnostics of a run by itself: a fault of the input stands for all runs that show it.
fn own_diagnostics(run: &Run) -> impl Iterator<Item = &Diagnostic> {
    run.diagnostics.iter().filter(|diagnostic| diagnostic.fault.is_none())
}

/// Understanding of a path: the contents of a file of this kind, and all that belongs to it.
pub struct Understood {
    /// Kind of the file.
    pub(super) kind: FileKind,
    /// A dataset's file, with the fate of each of its runs.
    pub dataset: Option<(Manifest, Vec<Result<Run, DatasetError>>)>,
    /// A train.
    pub(super) train: Option<Arc<TrainModel>>,
    /// A line.
    pub(super) track: Option<Arc<Track>>,
    /// A daemon's configuration.
    pub(super) daemon: Option<DaemonConfig>,
}

impl Understood {
    /// Returns nothing yet of a file of this kind.
    pub(super) fn from_kind(kind: FileKind) -> Self {
        Understood { kind, dataset: None, train: None, track: None, daemon: None }
    }

    /// Returns the runs of a dataset, or in place of a run its error.
    fn runs(&self) -> &[Result<Run, DatasetError>] {
        self.dataset.as_ref().map_or(&[], |(_, runs)| runs)
    }

    /// Returns the diagnostics that may spoil results, the worst first.
    pub(super) fn diagnostics(&self) -> Vec<DatasetDiagnostic> {
        let Some(train) = &self.train else { return Vec::new() };
        dataset_diagnostic::diagnostics(train, self.track.as_deref(), self.runs().iter().flatten())
    }

    /// Returns the errors of single runs.
    pub fn errors(&self) -> impl Iterator<Item = &DatasetError> {
        self.runs().iter().filter_map(|run| run.as_ref().err())
    }
}

/// Draws the line's profile and the train's effort curves into a folder, as far as they are known.
///
/// # Errors
///
/// An input failure where neither a line nor a train is known; a failure of the work where a drawing cannot be made or
/// written.
pub(super) fn draw(understood: &Understood, folder: &Path) -> Result<(), Failure> {
    if understood.daemon.is_some() {
        return Err(Failure::Input(
            "--draw: expected a dataset, a train or a track, not a daemon's configuration".into(),
        ));
    }
    let (train, track) = (understood.train.as_deref(), understood.track.as_deref());
    let failed = |error| Failure::Work(format!("the drawing failed: {error}"));
    let line = line::draw(track, &AlongLine::default(), false, Width::Wide).map_err(failed)?;
    let line = line.map(|plot| plot.svg);
    let effort = train.map(effort::draw).transpose().map_err(failed)?.flatten();
    let drawn = [("line.svg", line), ("effort.svg", effort)];
    if drawn.iter().all(|(_, plot)| plot.is_none()) {
        report_line(
            "nothing drawn: no gradient, curves or permitted speed of a line, no effort of a train",
        );
    }
    for (name, plot) in drawn {
        if let Some(plot) = plot {
            let path = write_in_folder(folder, name, &as_file(&plot))?;
            report_line(&format!("drawn: {}", path.display()));
        }
    }
    Ok(())
}
