//! `dynocar stops`: deceleration and stopping distance from recorded stops, without a measured brake force.

use std::path::{Path, PathBuf};

use clap::Args;
use dynocar_analysis::dataset::DatasetDiagnostic;
use dynocar_analysis::stops::{
    DecelerationSpread, FindSettings, FrictionPoint, FromSpeed, Gradient, LawPoint, QuantileRange,
    RecordedStop, StoppingDistance, Study, StudySettings,
};
use serde::Serialize;

use crate::dataset;
use crate::report::html::TableColumns;
use crate::run_facts::diagnostics;
use dynocar::cli::Failure;
use dynocar::cli::text::TextTable;
use dynocar::dataset::SourceArguments;
use dynocar::output::{give, require_files};
use dynocar_shared::HALF_95;

/// Estimate deceleration and stopping distance from recorded stops, without forces.
///
/// It needs the speed alone, and uses the command of the brake where it is recorded.
#[derive(Debug, Args)]
pub struct StopsArguments {
    #[command(flatten)]
    source: SourceArguments,
    /// Predict the next stop from this speed in m/s; may be given several times
    #[arg(long, value_name = "MPS", value_parser = positive)]
    from: Vec<f64>,
    #[command(flatten)]
    study: StudyArguments,
    /// Write the result for machines; - for standard output
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,
}

/// How stops are studied.
#[derive(Debug, Args)]
pub(super) struct StudyArguments {
    /// How well stops repeat, as relative standard deviation, until enough of them show it
    #[arg(long, value_name = "SHARE", default_value = "0.03", value_parser = share)]
    repeatability: f64,
    /// Least share of the declared brake effort that counts as all of the brake
    #[arg(long, value_name = "SHARE", default_value = "0.85", value_parser = share)]
    applied: f64,
}

impl StudyArguments {
    pub(super) fn settings(&self) -> StudySettings {
        let find = FindSettings { share_min: self.applied, ..FindSettings::default() };
        StudySettings { find, repeatability: self.repeatability }
    }
}

/// Returns the words for datasets without a stop.
pub(super) fn no_stop(dataset: &Path) -> Failure {
    Failure::Input(format!(
        "{}: no run holds a stop: a train that reached {} m/s or more and then stands",
        dataset.display(),
        FindSettings::default().from_mps
    ))
}

/// Largest number of modulated stops that are shown one by one.
const SINGLE_MAX: usize = 12;
/// Speeds in m/s at which the deceleration of a modulated stop is shown.
const SHOWN_MPS: [f64; 6] = [25.0, 20.0, 15.0, 10.0, 5.0, 3.0];

fn positive(text: &str) -> Result<f64, String> {
    above_zero(text, 200.0, "expected a speed above 0 and up to 200 m/s")
}

pub(super) fn share(text: &str) -> Result<f64, String> {
    above_zero(text, 1.0, "expected a share above 0 and up to 1")
}

fn above_zero(text: &str, most: f64, expected: &str) -> Result<f64, String> {
    let number: f64 = text.parse().map_err(|_| String::from("expected a number"))?;
    let is_allowed = number > 0.0 && number <= most;
    is_allowed.then_some(number).ok_or_else(|| expected.into())
}

#[derive(Debug, Serialize)]
struct StopsAnswer {
    dataset: String,
    /// Diagnostics that may spoil the results, the worst first.
    #[serde(rename = "notes")]
    diagnostics: Vec<DatasetDiagnostic>,
    #[serde(flatten)]
    study: Study,
}

/// Studies the stops and prints the results.
///
/// # Errors
///
/// A wrong dataset is an input failure; so is one without a stop.
pub fn execute(arguments: &StopsArguments) -> Result<(), Failure> {
    require_files(&[(&arguments.json, "{")])?;
    let dataset = dataset::load(arguments.source.source())?;
    let study = Study::new(&dataset, &arguments.study.settings(), &arguments.from);
    if study.stops.is_empty() {
        return Err(no_stop(&arguments.source.dataset));
    }
    for speed_mps in &arguments.from {
        let why = match &study.law {
            Some(law) if law.stopping_distance(*speed_mps, &Gradient::default()).is_some() => {
                continue;
            }
            Some(law) => format!(
                "--from {speed_mps}: the stops were seen from {:.1} m/s down; nothing is reported of faster ones",
                law.fastest_mps()
            ),
            None => format!("--from {speed_mps}: no run to fit holds a stop by all of the brake"),
        };
        return Err(Failure::Input(why));
    }
    let answer =
        StopsAnswer { dataset: dataset.name.clone(), diagnostics: dataset.diagnostics(), study };
    Ok(give(arguments.json.as_deref(), &answer, || text(&answer))?)
}

/// Returns a table of some rows; `left` are the columns of words.
pub(super) fn table<'t, T: 't>(
    columns: TableColumns<T>,
    left: &[usize],
    rows: impl Iterator<Item = &'t T>,
) -> TextTable {
    let head: Vec<&str> = columns.iter().map(|column| column.0).collect();
    let mut table = TextTable::new(&head, left);
    rows.for_each(|row| table.push(columns.iter().map(|column| column.1(row)).collect()));
    table
}

const STOPS: TableColumns<RecordedStop> = &[
    ("run", |it| it.file.clone()),
    ("role", |it| it.role.name().into()),
    ("from s", |it| format!("{:.1}", it.from_s)),
    ("m/s", |it| format!("{:.1}", it.from_mps)),
    ("s", |it| format!("{:.1}", it.time_s)),
    ("m", |it| format!("{:.0}", it.distance_m)),
    ("m/s²", |it| format!("{:.2}", it.mean_deceleration_mps2)),
    ("stood s", |it| it.dwell_s.map_or("-".into(), |it| format!("{it:.0}"))),
    ("brake", |it| format!("{:?}", it.manner).to_lowercase()),
    ("found by", |it| format!("{:?}", it.found_by).to_lowercase()),
    ("predicted m", |it| it.predicted.map_or("-".into(), |it| format!("{:.0}", it.distance_m))),
    ("bound m", |it| it.predicted.map_or("-".into(), |it| format!("{:.0}", it.distance_bound_m))),
];

const LAW: TableColumns<LawPoint> = &[
    ("m/s", |it| format!("{:.0}", it.speed_mps)),
    ("m/s²", |it| format!("{:.3}", it.deceleration_mps2)),
    ("±", |it| format!("{:.3}", HALF_95 * it.std_mps2)),
    ("± next stop", |it| format!("{:.3}", HALF_95 * it.next_std_mps2)),
    ("stops", |it| it.stops.to_string()),
];

const DISTANCES: TableColumns<StoppingDistance> = &[
    ("from m/s", |it| format!("{:.1}", it.from_mps)),
    ("s", |it| format!("{:.1}", it.time_s)),
    ("m", |it| format!("{:.0}", it.distance_m)),
    ("95 % within m", |it| format!("{:.0}", it.distance_bound_m)),
];

const FRICTION: TableColumns<FrictionPoint> = &[
    ("m/s", |it| format!("{:.0}", it.speed_mps)),
    ("friction", |it| format!("{:.2}", it.share)),
    ("±", |it| format!("{:.2}", HALF_95 * it.share_std)),
    ("adhesion ≥", |it| it.adhesion_at_least.map_or("-".into(), |it| format!("{it:.3}"))),
];

fn spread(it: &QuantileRange, digits: usize) -> String {
    format!("{:.digits$} ({:.digits$} to {:.digits$})", it.median, it.low, it.high)
}

const FROM_SPEEDS: TableColumns<FromSpeed> = &[
    ("from m/s", |it| format!("{:.0} to {:.0}", it.from_mps[0], it.from_mps[1])),
    ("stops", |it| it.stops.to_string()),
    ("m", |it| spread(&it.distance_m, 0)),
    ("s", |it| spread(&it.time_s, 0)),
    ("mean m/s²", |it| spread(&it.mean_deceleration_mps2, 2)),
];

const CHOSEN: TableColumns<DecelerationSpread> = &[
    ("at m/s", |it| format!("{:.0}", it.speed_mps)),
    ("stops", |it| it.stops.to_string()),
    ("m/s²", |it| spread(&it.deceleration_mps2, 2)),
    ("hardest tenth above", |it| format!("{:.2}", it.deceleration_mps2.high)),
];

/// Returns all stops together, where there are several.
fn day(study: &Study) -> String {
    if study.stops.len() < 3 {
        return String::new();
    }
    let mut text = format!(
        "\nall stops together: the middle (and what 8 of 10 lie within)\n{}\n{}the middle is the driver's \
         choice; the brake gives at least what the hardest tenth took\n",
        table(FROM_SPEEDS, &[], study.day.from_speeds.iter()),
        table(CHOSEN, &[], study.day.decelerations.iter())
    );
    if let Some(dwell_s) = &study.day.dwell_s {
        text += &format!("the train stood for {} s\n", spread(dwell_s, 0));
    }
    text
}

fn text(answer: &StopsAnswer) -> String {
    let study = &answer.study;
    let mut text = format!(
        "{}\n{}\n{}{}{}",
        answer.dataset,
        diagnostics(&answer.diagnostics),
        table(STOPS, &[0, 1, 8, 9], study.stops.iter()),
        day(study),
        modulated(&study.stops)
    );
    if let Some(law) = &study.law {
        let step = (law.points.len() / 12).max(1);
        text += &format!(
            "\ndeceleration over speed, the mean of the stops by all of the brake\n{}comes after {:.2} s \
             and builds up in {:.2} s (lost: ± {:.2} s from stop to stop); stops repeat within {:.1} % (standard deviation)\n\nthe next stop, from command \
             to standstill\n{}{}",
            table(LAW, &[], law.points.iter().rev().step_by(step)),
            law.response.dead_time_s,
            law.response.build_up_s,
            HALF_95 * law.response.std_s,
            100.0 * law.repeatability,
            table(DISTANCES, &[], study.distances.iter()),
            friction(&study.stops)
        );
    }
    text += "\nnot determined by these data\n";
    for line in &study.cannot_tell {
        text += &format!("  {line}\n");
    }
    text + "\n± is the half width of the 95 % interval\n"
}

/// Describes the other stops: the driver's deceleration at some speeds, and why it is no law.
fn modulated(stops: &[RecordedStop]) -> String {
    let others: Vec<&RecordedStop> = stops.iter().filter(|it| it.no_law.is_some()).collect();
    let fastest = others.iter().map(|it| it.from_mps).fold(0.0, f64::max);
    let speeds: Vec<f64> = SHOWN_MPS.into_iter().filter(|it| *it <= fastest).collect();
    if speeds.is_empty() || others.len() > SINGLE_MAX {
        return String::new();
    }
    let mut header = vec!["run".into(), "from s".into()];
    header.extend(speeds.iter().map(|it| format!("at {it:.0} m/s")));
    header.push("no law of the brake, since".into());
    let header: Vec<&str> = header.iter().map(|it: &String| &it[..]).collect();
    let mut table = TextTable::new(&header, &[0, header.len() - 1]);
    for stop in others {
        let mut row = vec![stop.file.clone(), format!("{:.1}", stop.from_s)];
        row.extend(speeds.iter().map(|speed_mps| {
            let at = stop.decelerations.iter().find(|it| it.speed_mps == *speed_mps);
            at.map_or("-".into(), |it| {
                format!("{:.2} ± {:.2}", it.deceleration_mps2, HALF_95 * it.std_mps2)
            })
        }));
        row.push(stop.no_law.clone().unwrap_or_default());
        table.push(row);
    }
    format!("\nstops with a modulated brake: deceleration in m/s² over speed\n{table}")
}

/// Returns the friction behind the longest stop.
fn friction(stops: &[RecordedStop]) -> String {
    let by_length =
        |one: &&RecordedStop, other: &&RecordedStop| one.friction.len().cmp(&other.friction.len());
    let Some(stop) = stops.iter().max_by(by_length).filter(|it| !it.friction.is_empty()) else {
        return String::new();
    };
    let step = (stop.friction.len() / 8).max(1);
    let table = table(FRICTION, &[], stop.friction.iter().step_by(step));
    format!(
        "\nfriction over its mean in the stop of {} at {:.1} s, by brake_smoother and \
         adhesion_smoother\n{table}",
        stop.file, stop.from_s
    )
}
