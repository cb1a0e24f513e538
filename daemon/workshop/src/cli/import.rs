//! `dynocar import`: a train and a line from other projects' files.

mod answer;

use std::path::PathBuf;

use clap::Args;
use dynocar_analysis::dataset::dataset_diagnostic::diagnostics;
use dynocar_analysis::dataset::{parse_track, parse_train};
use dynocar_analysis::import::{Format, ImportReading, ImportSource, import};

use super::train_text::TrainArguments;
use dynocar::cli::Failure;
use dynocar::dataset::labelled_text;
use dynocar::models::text::{TRACK_FILE, TRAIN_FILE};
use dynocar::output::{print, require_folder, require_new, write_new_in_folder};

/// Import trains and lines of railtoolkit, TTOBench or OSRD.
///
/// It writes train.toml and track.toml, and reports the outcome of every field. Nothing is overwritten.
#[derive(Debug, Args)]
pub struct ImportArguments {
    /// The files: YAML of railtoolkit, JSON of TTOBench or OSRD
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// The folder for the results; it is made where there is none
    #[arg(short, long, value_name = "FOLDER")]
    out: PathBuf,
    /// Take the files for those of this project: railtoolkit, ttobench or osrd
    #[arg(long, value_name = "PROJECT", value_parser = format)]
    format: Option<Format>,
    /// Which train, where the files hold several
    #[arg(long = "train", value_name = "ID")]
    train_id: Option<String>,
    /// Which line, where the files hold several
    #[arg(long = "line", value_name = "ID")]
    line_id: Option<String>,
    /// Share of the permitted load that is on the train, 0 to 1, where a file gives the load
    #[arg(long, value_name = "SHARE", default_value = "0", value_parser = share)]
    load: f64,
    /// The mode of traction whose effort curve counts, where a file has several
    #[arg(long, value_name = "NAME")]
    mode: Option<String>,
    #[command(flatten)]
    train: TrainArguments,
}

/// Imports and writes.
///
/// # Errors
///
/// An input failure where a file or the command line is wrong, or a result is there already; a failure
/// of the work where a file cannot be written.
pub fn execute(arguments: &ImportArguments) -> Result<(), Failure> {
    let out = &arguments.out;
    require_folder(out)?;
    let texts = arguments.files.iter().map(|path| labelled_text(path));
    let texts: Vec<_> = texts.collect::<Result<_, _>>()?;
    let sources: Vec<ImportSource> =
        texts.iter().map(|(label, text)| ImportSource { label, text }).collect();
    let reading = ImportReading { load_share: arguments.load, mode: arguments.mode.clone() };
    let imported = import(&sources, arguments.format, &reading)?;
    let train = chosen(&imported.trains, |it| &it.id, arguments.train_id.as_deref(), "train")?;
    let line = chosen(&imported.lines, |it| &it.id, arguments.line_id.as_deref(), "line")?;
    if train.is_none() && !arguments.train.is_empty() {
        return Err(Failure::Input(
            "the files hold no train, so that nothing can be said of one on the command line"
                .into(),
        ));
    }
    let train = train.map(|it| answer::train(it, &arguments.train).map(|text| (it, text)));
    let train = train.transpose()?;
    let line = line.map(|it| (it, answer::track(it)));
    let mut written = Vec::new();
    written.extend(train.as_ref().map(|(_, made)| (TRAIN_FILE, made.text.as_str())));
    written.extend(line.as_ref().map(|(_, text)| (TRACK_FILE, text.as_str())));
    for (name, _) in &written {
        require_new(&out.join(name))?;
    }
    // The readers accept the written text.
    let model = train.as_ref().map(|(_, made)| parse_train(TRAIN_FILE, &made.text)).transpose()?;
    let track = line.as_ref().map(|(_, text)| parse_track(TRACK_FILE, text)).transpose()?;
    let diagnostics =
        model.map(|model| diagnostics(&model, track.as_ref(), [])).unwrap_or_default();
    write_new_in_folder(out, &written)?;
    let names: Vec<&str> = written.iter().map(|(name, _)| *name).collect();
    Ok(print(&answer::text(out, train.as_ref(), line.as_ref(), &diagnostics, &names))?)
}

/// Returns the requested one of several; `None` where there is none.
fn chosen<'i, T>(
    all: &'i [T],
    id: impl Fn(&T) -> &String,
    wanted: Option<&str>,
    what: &str,
) -> Result<Option<&'i T>, Failure> {
    let ids: Vec<String> = all.iter().map(|it| format!("'{}'", id(it))).collect();
    let ids = ids.join(", ");
    let is_wanted = |it: &&T| wanted.is_none_or(|wanted| id(it) == wanted);
    let found: Vec<&T> = all.iter().filter(is_wanted).collect();
    match (wanted, all.len(), &found[..]) {
        (None, 0, _) => Ok(None),
        (_, _, [only]) => Ok(Some(only)),
        (None, count, _) => Err(Failure::Input(format!(
            "the files hold {count} {what}s; say which: --{what} ID, of {ids}"
        ))),
        (Some(wanted), 0, _) => {
            Err(Failure::Input(format!("--{what} {wanted}: the files hold no {what}")))
        }
        (Some(wanted), _, []) => {
            Err(Failure::Input(format!("--{what} {wanted}: expected one of {ids}")))
        }
        (Some(wanted), ..) => Err(Failure::Input(format!(
            "--{what} {wanted}: it stands in several files; give one of them at a time"
        ))),
    }
}

fn format(name: &str) -> Result<Format, String> {
    let all = Format::ALL.map(Format::name).join(", ");
    let found = Format::from_name(name);
    found.ok_or_else(|| format!("expected one of {all}"))
}

fn share(text: &str) -> Result<f64, String> {
    let share = text.parse::<f64>().ok().filter(|share| (0.0..=1.0).contains(share));
    share.ok_or_else(|| "expected a share from 0 to 1".into())
}
