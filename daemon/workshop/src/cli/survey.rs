//! `dynocar survey`: an unsurveyed line from raw recordings with GNSS, and the result as a page.

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use dynocar::cli::Failure;
use dynocar::dataset::DatasetSource;
use dynocar::output::{give, report_line, require_files, require_folder, write_file};
use dynocar_analysis::dataset::Dataset;
use dynocar_analysis::survey::profile::GradientEntry;
use dynocar_analysis::survey::trips::SurveyedStop;
use dynocar_analysis::survey::{NotUsed, Survey};
use dynocar_model::words::number;
use dynocar_shared::{HALF_95, TrainId};

use super::threads::Threads;
use crate::report::PAGE_MARK;
use crate::report::html::ColumnAlignment::{Names, Numbers, Words};
use crate::report::html::{self, TableColumn, escape, table};
use crate::report::page::document;
use crate::report::plots::{PlotError, figure, series, wide_and_narrow};
use crate::report::provenance::{Provenance, own_command_line};
use crate::survey::write::gradient_entries;
use crate::survey::{
    LearnedAnswer, LearnedRow, SurveyAnswer, SurveyFailure, TripAnswer, survey_folder,
};

/// Survey a line from recordings with GNSS: trips, chainage, stops, gradient.
#[derive(Debug, Args)]
pub struct SurveyArguments {
    /// The folder of the raw recordings, or its dataset.toml under any name
    dataset: PathBuf,
    /// Only this train of a recording that holds several
    #[arg(long, value_name = "ID")]
    train: Option<u64>,
    /// Write the dataset of trips into this folder
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
    /// Only map the recordings on a line surveyed before
    #[arg(long, value_name = "track.toml")]
    line: Option<PathBuf>,
    /// Write the result for machines; - for standard output
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,
    /// Write a report for people: one HTML page that needs nothing else
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    #[command(flatten)]
    threads: Threads,
}

/// Surveys and writes the dataset.
///
/// # Errors
///
/// A wrong dataset or line is an input failure; a file that cannot be written one of work.
pub fn execute(arguments: &SurveyArguments) -> Result<(), Failure> {
    require_files(&[(&arguments.json, "{"), (&arguments.report, PAGE_MARK)])?;
    require_folder(&arguments.out)?;
    let source = DatasetSource { path: &arguments.dataset, train: arguments.train.map(TrainId) };
    let line = arguments.line.as_deref();
    let work = || survey_folder(source, line, &arguments.out);
    let made = arguments.threads.work(work)??;
    report_line(&format!("dataset: {} files in {}", made.files.len(), arguments.out.display()));
    if let Some(file) = &arguments.report {
        let provenance = Provenance::new(source, own_command_line()).map_err(Failure::input)?;
        let page = result_page(&made.raw, &made.survey, &made.answer, &provenance)
            .map_err(|error| Failure::Work(format!("{}: {error}", file.display())))?;
        write_file(file, &page)?;
        report_line(&format!("report: {}", file.display()));
    }
    Ok(give(arguments.json.as_deref(), &made.answer, || summary(&made.answer))?)
}

impl From<SurveyFailure> for Failure {
    fn from(failure: SurveyFailure) -> Self {
        match failure {
            SurveyFailure::Output(error) => error.into(),
            SurveyFailure::Load(error) => error.into(),
            _ => Failure::input(failure),
        }
    }
}

fn summary(answer: &SurveyAnswer) -> String {
    let mut text = format!(
        "line of {:.1} m, {} stops, {} trips, {} parts not used\n",
        answer.line.length_m,
        answer.line.stops.len(),
        answer.trips.len(),
        answer.not_used.len()
    );
    if let Some(std) = answer.line.gradient_std_permille {
        text += &format!(
            "gradient from {} passes, ± {:.2} ‰ over 100 m\n",
            answer.line.passes,
            HALF_95 * std
        );
    }
    for LearnedRow { short: name, unit, value: it, .. } in
        answer.learned.iter().flat_map(LearnedAnswer::rows)
    {
        if !name.is_empty() {
            let half = HALF_95 * it.std;
            text += &format!("    {name:<22} {:>10.4} ± {half:.4} {unit}\n", it.value);
        }
    }
    for open in &answer.cannot_tell {
        text += &format!("these recordings do not determine {open}\n");
    }
    text + "± is the half width of the 95 % interval\n"
}

/// Width and height of the map.
const SIZE: (f64, f64) = (980.0, 420.0);

/// Returns the page: map, profile with its band, stops, passes, unused parts and open questions.
///
/// # Errors
///
/// When a plot cannot be drawn.
fn result_page(
    dataset: &Dataset,
    survey: &Survey,
    answer: &SurveyAnswer,
    made: &Provenance,
) -> Result<String, PlotError> {
    let name = escape(&dataset.name);
    let header = format!(
        "<p class=\"kicker\">Dynocar · survey</p>\n<h1>{name}</h1>\n\
         <p class=\"facts\">{:.0} m · {} stops · {} trips · {} passes learned from · {}</p>\n",
        answer.line.length_m,
        answer.line.stops.len(),
        answer.trips.len(),
        answer.line.passes,
        made.day
    );
    let mut main = String::new();
    let mut section =
        |id: &str, title: &str, body: String| main += &html::section(id, title, &body);
    section("map", "The line", map(survey, answer));
    if let Some(profile) = &survey.profile {
        let mut body = profile_plots(&gradient_entries(survey, profile, 1), "growing chainage")?;
        if !survey.alignments.is_one_track() {
            body += &profile_plots(&gradient_entries(survey, profile, -1), "falling chainage")?;
        }
        section("profile", "Gradient every 10 m, with the 95 % band of its mean over 100 m", body);
    }
    section("learned", "What was learned jointly with it", learned(answer));
    let stops = table("Stops", STOPS, &answer.line.stops);
    section("stops", "Stops, and how they repeat", stops);
    let caption = "Trips, and how far the others predict the forces of each";
    section("trips", "Trips", table(caption, TRIPS, &answer.trips));
    let caption = "Parts of the recordings that are no trip";
    section("not-used", "Not used", table(caption, NOT_USED, &answer.not_used));
    section("open", "What these recordings do not determine", open(answer));
    Ok(document(&format!("{name} – survey"), &header, &main, made))
}

fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), it| (low.min(it), high.max(it)))
}

fn path(points: impl Iterator<Item = (f64, f64)>) -> String {
    let mut path = String::new();
    for (k, (x, y)) in points.enumerate() {
        let _ = write!(path, "{}{x:.1},{y:.1}", if k == 0 { "M" } else { "L" });
    }
    path
}

fn map(survey: &Survey, answer: &SurveyAnswer) -> String {
    let alignments = &survey.alignments;
    let nodes = [1, -1]
        .into_iter()
        .filter_map(|it| alignments.of(it))
        .flat_map(|alignment| alignment.nodes_m());
    let all: Vec<[f64; 2]> = nodes.copied().collect();
    let (west, east) = range(all.iter().map(|it| it[0]));
    let (south, north) = range(all.iter().map(|it| it[1]));
    // Metres are as long upwards as sideways.
    let span = ((east - west) / SIZE.0).max((north - south) / SIZE.1).max(1e-3) * 1.15;
    let place = |at: [f64; 2]| {
        let x = 0.5 * SIZE.0 + (at[0] - 0.5 * (west + east)) / span;
        (x, 0.5 * SIZE.1 - (at[1] - 0.5 * (south + north)) / span)
    };
    let mut svg = format!(
        "<svg class=\"plot\" viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"The line on the map, \
         north upwards, with its stops\">\n",
        SIZE.0, SIZE.1
    );
    for (direction, colour) in [(-1, "before"), (1, "after")] {
        if let Some(alignment) = alignments.of(direction) {
            let line = path(alignment.nodes_m().iter().map(|&at| place(at)));
            let _ = writeln!(
                svg,
                "<path d=\"{line}\" fill=\"none\" stroke=\"var(--{colour})\" stroke-width=\"2\"/>"
            );
        }
    }
    for stop in &answer.line.stops {
        let Some(alignment) = alignments.of(stop.direction) else { continue };
        let (x, y) = place(alignment.at(alignments.along_m(stop.direction, stop.chainage_m)));
        let _ = writeln!(
            svg,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"var(--ink)\"><title>{:.0} m {}\
             </title></circle>",
            stop.chainage_m,
            escape(&stop.name)
        );
    }
    let two = alignments.falling.as_ref().is_some_and(|falling| !falling.is_same);
    svg + &scale_bar(span)
        + "</svg>\n<p class=\"note\">North is up. "
        + match two {
            true => "Blue: the way of growing chainage; brown: that of falling. ",
            false => "The line: both directions take the same way, or one was driven. ",
        }
        + "Dots: stops, with their chainage when pointed at.</p>\n"
}

/// Returns a bar of a round length, for a map of some m for each unit of the drawing.
fn scale_bar(span: f64) -> String {
    let most_m = 0.25 * SIZE.0 * span;
    let decade_m = 10f64.powf(most_m.log10().floor());
    let bar_m = [5.0, 2.0, 1.0].map(|it| it * decade_m).into_iter().find(|it| *it <= most_m);
    let bar_m = bar_m.unwrap_or(decade_m);
    let (left, right, y) = (20.0, 20.0 + bar_m / span, SIZE.1 - 20.0);
    let name =
        if bar_m < 1000.0 { format!("{bar_m:.0} m") } else { format!("{:.0} km", bar_m / 1e3) };
    format!(
        "<path d=\"M{left},{y}H{right:.1}\" stroke=\"var(--muted)\" stroke-width=\"3\"/>\n<text \
         x=\"{left}\" y=\"{}\" fill=\"var(--muted)\" font-size=\"15\">{name}</text>\n",
        y - 8.0
    )
}

fn profile_plots(entries: &[GradientEntry], direction: &str) -> Result<String, PlotError> {
    let plots = wide_and_narrow(|width| series::gradient(entries, direction, width))?;
    Ok(figure("trace", &format!("For {direction}"), "", &plots))
}

fn learned(answer: &SurveyAnswer) -> String {
    let Some(learned) = &answer.learned else {
        return "<p>The line was known: nothing was learned.</p>\n".into();
    };
    let rows = learned.rows().into_iter();
    let rows: Vec<_> = rows.map(|it| (it.long, it.value.value, HALF_95 * it.value.std)).collect();
    let columns: [TableColumn<(&str, f64, f64)>; 3] = [
        ("quantity", Words, &|it| it.0.into()),
        ("value", Numbers, &|it| number(it.1, Some(it.2))),
        ("±", Numbers, &|it| number(it.2, Some(it.2))),
    ];
    table("Learned, with 95 % intervals", &columns, &rows)
}

const STOPS: &[TableColumn<'_, SurveyedStop>] = &[
    ("chainage, m", Numbers, &|it| format!("{:.1}", it.chainage_m)),
    ("name", Names, &|it| escape(&it.name)),
    ("direction", Numbers, &|it| it.direction.to_string()),
    ("stands", Numbers, &|it| it.stands.to_string()),
    ("scatter, m", Numbers, &|it| it.std_m.map_or("–".into(), &|it| format!("{it:.1}"))),
];

const TRIPS: &[TableColumn<'_, TripAnswer>] = &[
    ("file", Names, &|it| escape(&it.file)),
    ("recording", Names, &|it| escape(&it.source)),
    ("role", Words, &|it| it.role.into()),
    ("direction", Numbers, &|it| it.direction.to_string()),
    ("from, s", Numbers, &|it| format!("{:.0}", it.from_s)),
    ("to, s", Numbers, &|it| format!("{:.0}", it.to_s)),
    ("length, m", Numbers, &|it| format!("{:.0}", it.length_m)),
    ("residual left out, N", Numbers, &|it| {
        it.left_out_residual_n.map_or("–".into(), |value| format!("{value:.0}"))
    }),
];

const NOT_USED: &[TableColumn<'_, NotUsed>] = &[
    ("recording", Names, &|it| escape(&it.source)),
    ("from, s", Numbers, &|it| format!("{:.0}", it.from_s)),
    ("to, s", Numbers, &|it| format!("{:.0}", it.to_s)),
    ("why", Words, &|it| it.reason.into()),
];

fn open(answer: &SurveyAnswer) -> String {
    let items = answer.cannot_tell.iter().map(|open| format!("<li>{}</li>\n", escape(open)));
    format!("<ul>\n{}</ul>\n", items.collect::<String>())
}
