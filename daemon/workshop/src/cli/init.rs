//! `dynocar init`: the first description of a train and of its recordings.

mod arguments;
mod recordings;
mod summary;
mod texts;

use dynocar_analysis::dataset::dataset_diagnostic::diagnostics;
use dynocar_analysis::dataset::guess::{Guess, RecordingText, guess};
use dynocar_analysis::dataset::{MANIFEST_FILE, Quantity};
use dynocar_model::train::numbers::MASS;
use toml::Value;

use super::train_text::{TrainText, TrainValues};
pub use arguments::InitArguments;
use dynocar::cli::Failure;
use dynocar::dataset::labelled_text;
use dynocar::models::text::{TRACK_FILE, TRAIN_FILE};
use dynocar::output::{print, require_folder, require_new, write_new_in_folder};
use recordings::Draft;
use summary::{DAEMON_FILE, Described};

const WRITER: &str = "dynocar init";
/// Greatest number of corrections of units that the values did not reveal.
const CORRECTIONS_MAX: usize = 4;

/// Writes the first description.
///
/// # Errors
///
/// An input failure where a recording or a figure of the train is wrong, or a file is there already;
/// a failure of the work where a file cannot be written.
pub fn execute(arguments: &InitArguments) -> Result<(), Failure> {
    let arguments = &arguments::complete(arguments)?;
    let folder = arguments.folder();
    require_folder(folder)?;
    let with_dataset = !arguments.csv.is_empty();
    if !with_dataset && !arguments.column.is_empty() {
        return Err(Failure::Input("--column: expected recordings with it: --csv FILE".into()));
    }
    let mut names = vec![TRAIN_FILE, DAEMON_FILE];
    names.extend(with_dataset.then_some(MANIFEST_FILE));
    for name in names {
        require_new(&folder.join(name))?;
    }
    let has_track = folder.join(TRACK_FILE).is_file();
    let mut train = arguments.train.text(WRITER, &TrainValues::default())?;
    let described = match with_dataset {
        true => Some(describe(arguments, &mut train, has_track)?),
        false => None,
    };
    let daemon = texts::daemon(has_track);
    let mut files = vec![(TRAIN_FILE, train.text.as_str()), (DAEMON_FILE, daemon.as_str())];
    files.extend(described.as_ref().map(|it| (MANIFEST_FILE, it.text.as_str())));
    write_new_in_folder(folder, &files)?;
    Ok(print(&summary::text(folder, &train, described.as_ref()))?)
}

/// Reads the recordings, guesses the meaning of their columns, and reads them once more with it.
fn describe(
    arguments: &InitArguments,
    train: &mut TrainText,
    has_track: bool,
) -> Result<Described, Failure> {
    let (texts, encoding) = recordings::texts(&arguments.csv, arguments.encoding)?;
    let files = recordings::from_folder(arguments.folder(), &arguments.csv)?;
    let chosen = recordings::of_train(&texts, arguments.train_cell.as_deref())?;
    let recordings: Vec<RecordingText> =
        texts.iter().map(|(label, text)| RecordingText { label, text }).collect();
    let own = recordings.iter().enumerate();
    let own: Vec<RecordingText> = own
        .map(|(at, it)| RecordingText {
            text: chosen.as_ref().map_or(it.text, |it| &it.texts[at]),
            ..*it
        })
        .collect();
    let rows = chosen.as_ref().map(|it| &it.rows);
    let mut guess = guess(&own, &arguments.column)
        .map_err(|error| recordings::with_encoding(error, encoding, arguments.encoding))?;
    guess.layout.encoding = encoding;
    let track = match has_track {
        true => Some(labelled_text(&arguments.folder().join(TRACK_FILE))?.1),
        false => None,
    };
    if let Some(mass_t) = recorded_mass_t(&guess) {
        let from = "t, the middle of the mass that the recordings hold".into();
        let figures = vec![(MASS.name, Value::Float(mass_t), from)];
        *train =
            arguments.train.text(WRITER, &TrainValues { figures, ..TrainValues::default() })?;
    }
    let name = texts::name_of(arguments.folder());
    let folder = arguments.folder();
    let mut corrections = 0;
    loop {
        let text = texts::dataset(&guess, (&name, rows), &files, has_track);
        let mut draft = vec![(MANIFEST_FILE, None, &text[..]), (TRAIN_FILE, None, &train.text)];
        draft.extend(track.as_deref().map(|track| (TRACK_FILE, None, track)));
        let runs = files.iter().zip(&recordings);
        draft.extend(runs.map(|(path, it)| (&path[..], Some(it.label), it.text)));
        let (head, runs) = Draft { folder, files: draft }.read()?;
        let knows_mass = arguments.train.knows_mass();
        let is_right = corrections == CORRECTIONS_MAX
            || !guess.turn_runs(&runs) && guess.correct(&runs, knows_mass).is_none();
        if is_right {
            let diagnostics = diagnostics(&head.train, head.track.as_deref(), &runs);
            return Ok(Described { guess, files, diagnostics, text });
        }
        corrections += 1;
    }
}

/// Returns the middle of a recorded mass in t.
fn recorded_mass_t(guess: &Guess) -> Option<f64> {
    let column = guess.column(Quantity::TrainMass)?;
    let mass_t = column.unit.to_base(column.middle * column.scale) / 1000.0;
    (mass_t > 0.0 && mass_t.is_finite()).then_some((mass_t * 10.0).round() / 10.0)
}
