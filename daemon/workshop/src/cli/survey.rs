//! `dynocar survey`: an unsurveyed line from raw recordings with GNSS.

use std::path::PathBuf;

use super::threads::Threads;
use crate::report::PAGE_MARK;
use crate::report::provenance::{Provenance, own_command_line};
use crate::survey::answer::{LearnedAnswer, LearnedRow, SurveyAnswer};
use crate::survey::{SurveyFailure, page, survey_folder};
use clap::Args;
use dynocar::cli::Failure;
use dynocar::dataset::DatasetSource;
use dynocar::output::{give, report_line, require_files, require_folder, write_file};
use dynocar_shared::{HALF_95, TrainId};

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
        let page = page::html(&made.raw, &made.survey, &made.answer, &provenance)
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
