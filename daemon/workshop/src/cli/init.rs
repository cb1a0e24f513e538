//! `dynocar init`: the first description of a train and of its recordings, and the texts of its files.

mod arguments;
mod recordings;

use std::path::Path;

use arguments::{DAEMON_FILE, Described, summary};
use dynocar::cli::Failure;
use dynocar::dataset::labelled_text;
use dynocar::models::UtcSecond;
use dynocar::models::text::{TRACK_FILE, TRAIN_FILE};
use dynocar::output::{print, require_folder, require_new, write_new_in_folder};
use dynocar_analysis::dataset::dataset_diagnostic::diagnostics;
use dynocar_analysis::dataset::guess::{Guess, GuessedColumn, GuessedRun, RecordingText, guess};
use dynocar_analysis::dataset::keys::column::{COLUMN, DOUBTFUL, FORMAT, SCALE, UNIT};
use dynocar_analysis::dataset::keys::dataset::{
    DECIMAL, DELIMITER, ENCODING, SKIP_ROWS, THOUSANDS, UNITS_ROW,
};
use dynocar_analysis::dataset::keys::rows::VALUE;
use dynocar_analysis::dataset::keys::{self, run};
use dynocar_analysis::dataset::text_layout::TrainRows;
use dynocar_analysis::dataset::written::TomlText;
use dynocar_analysis::dataset::{MANIFEST_FILE, Quantity, Role, TextLayout};
use dynocar_model::train::numbers::MASS;
use encoding_rs::UTF_8;
use recordings::Draft;
use toml::Value;

use super::train_text::{TrainText, TrainValues, comment};

pub use arguments::InitArguments;

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
    let daemon = daemon_text(has_track);
    let mut files = vec![(TRAIN_FILE, train.text.as_str()), (DAEMON_FILE, daemon.as_str())];
    files.extend(described.as_ref().map(|it| (MANIFEST_FILE, it.text.as_str())));
    write_new_in_folder(folder, &files)?;
    Ok(print(&summary(folder, &train, described.as_ref()))?)
}

/// Reads the recordings, guesses the meaning of their columns, and reads them once more with it.
fn describe(
    arguments: &InitArguments,
    train: &mut TrainText,
    has_track: bool,
) -> Result<Described, Failure> {
    let (texts, encoding) = recordings::texts(&arguments.csv, arguments.encoding)?;
    let files = recordings::from_folder(arguments.folder(), &arguments.csv)?;
    let marks = arguments.marks()?;
    let train_cell = arguments.train_cell.as_deref();
    let chosen = recordings::of_train(&texts, marks.delimiter, train_cell)?;
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
    let mut guess = guess(&own, &arguments.column, marks)
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
    let name = name_of(arguments.folder());
    let folder = arguments.folder();
    let mut corrections = 0;
    loop {
        let text = dataset_text(&guess, (&name, rows), &files, has_track);
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

/// Returns a name for a dataset: the name of its folder.
fn name_of(folder: &Path) -> String {
    let full = std::path::absolute(folder).unwrap_or_else(|_| folder.into());
    let name = full.file_name().map(|name| name.to_string_lossy().into_owned());
    name.filter(|name| !name.is_empty()).unwrap_or_else(|| "recordings".into())
}

/// Returns the text of `dataset.toml`; `files` are the runs' paths from its folder.
fn dataset_text(
    guess: &Guess,
    (name, rows): (&str, Option<&TrainRows>),
    files: &[String],
    has_track: bool,
) -> String {
    let head = comment(
        "",
        "Recorded runs of one train. Written by dynocar init: every line under [columns] is a guess \
         from header and values, with what speaks for it and what was not taken. Set right what is \
         wrong, and delete `doubtful = true` where it is right: until then every answer says so. `dynocar check` \
         says what it understood.",
    );
    let mut text = TomlText::new(&head, keys::dataset::TABLE);
    text.value(&keys::dataset::NAME, quoted(name));
    layout_text(&mut text, &guess.layout);
    let head = keys::dataset::POSITION_REFERENCE.assign("\"head\"");
    let note = "where the recorded position is the head's, not the centre's";
    text.lines(&format!("# {head}    # {note}\n\n"));
    text.table(keys::train_file::TABLE);
    text.value(&keys::train_file::FILE, quoted(TRAIN_FILE));
    // Which rows are the train's.
    if let Some(TrainRows::Of { column, value }) = rows {
        let rows = [(COLUMN, column), (VALUE, value)].map(|(key, it)| key.assign(quoted(it)));
        text.value(&keys::train_file::ROWS, keys::inline(rows));
    }
    text.lines(match has_track {
        true => "\n",
        false => "\n# Without a line, gradients must come with the recordings, or are unknown.\n# ",
    });
    text.table(keys::track_file::TABLE);
    text.lines(if has_track { "" } else { "# " });
    text.value(&keys::track_file::FILE, quoted(TRACK_FILE));
    text.lines("\n");
    text.table(keys::column::TABLE);
    guess.columns.iter().for_each(|it| column_text(&mut text, it));
    if !guess.unmapped.is_empty() {
        text.lines("\n# Taken for nothing:\n");
        for column in &guess.unmapped {
            let words = format!("'{}': {}", column.name.shown(), column.reason);
            text.lines(&comment("  ", &words));
        }
    }
    let count = guess.runs.len();
    for (index, (of, file)) in guess.runs.iter().zip(files).enumerate() {
        let is_held_out = count > 1 && index + 1 == count;
        let (role, why) = match is_held_out {
            true => (Role::Holdout, "only scores what the others teach"),
            false => (Role::Fit, "models learn from it"),
        };
        text.lines("\n");
        text.next_table(run::TABLE);
        text.value(&run::FILE, quoted(file));
        text.noted(&run::ROLE, quoted(role.name()), why);
        let falls = match of.direction {
            -1 => "the recorded position falls",
            _ => "1: the chainage grows; -1: it falls",
        };
        text.noted(&run::DIRECTION, of.direction, falls);
        text.suggested(&run::MASS, "100.0", "where this run's load is known");
        date_text(&mut text, guess, of);
    }
    text.into_text()
}

/// How the files' text falls into cells.
fn layout_text(text: &mut TomlText, layout: &TextLayout) {
    let letter = |mark: char| quoted(&mark.to_string());
    if layout.encoding != UTF_8 {
        text.value(&ENCODING, quoted(&layout.encoding.name().to_lowercase()));
    }
    text.value(&DELIMITER, letter(layout.delimiter.into()));
    text.value(&DECIMAL, letter(layout.decimal.into()));
    if let Some(mark) = layout.thousands {
        text.value(&THOUSANDS, letter(mark));
    }
    if layout.skip_rows > 0 {
        text.noted(&SKIP_ROWS, layout.skip_rows, "lines above the names");
    }
    if layout.units_row {
        text.noted(&UNITS_ROW, true, "a line of units below the names");
    }
}

/// The day of a run, where its times do not hold it.
fn date_text(text: &mut TomlText, guess: &Guess, of: &GuessedRun) {
    let format = guess.column(Quantity::Time).and_then(|time| time.format.as_ref());
    match (format, of.day) {
        (Some(format), _) if format.has_date() => {}
        (_, Some(day)) => {
            let day = UtcSecond { unix_s: 86_400 * u64::try_from(day).unwrap_or(0) }.day();
            text.noted(&run::DATE, day, "as the column of dates says");
        }
        _ => text.suggested(&run::DATE, "2026-03-18", "where the day is known"),
    }
}

fn column_text(text: &mut TomlText, column: &GuessedColumn) {
    let words = format!("{}: {}.", column.quantity, column.reasons.join("; "));
    text.lines(&comment("", &words));
    for doubt in &column.doubts {
        text.lines(&comment("  ", &format!("DOUBTFUL: {doubt}")));
    }
    for rejected in &column.rejected {
        text.lines(&comment("  ", rejected));
    }
    let names: Vec<String> =
        std::iter::once(&column.name).chain(&column.parts).map(|name| quoted(&name.text)).collect();
    let name = match &names[..] {
        [name] => name.clone(),
        names => format!("[{}]", names.join(", ")),
    };
    let mut keys = vec![COLUMN.assign(name)];
    match &column.format {
        Some(format) => keys.push(FORMAT.assign(quoted(format.name()))),
        None => {
            keys.push(UNIT.assign(quoted(column.unit.name())));
            let scale = Some(column.scale).filter(|it| *it != 1.0);
            keys.extend(scale.map(|it| SCALE.assign(Value::Float(it))));
        }
    }
    keys.extend((!column.doubts.is_empty()).then(|| DOUBTFUL.assign(true)));
    text.column(column.quantity, keys);
}

/// Returns a text as TOML writes it, on one line.
fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for letter in text.chars() {
        match letter {
            '"' => quoted.push_str("\\\""),
            '\\' => quoted.push_str("\\\\"),
            '\t' => quoted.push_str("\\t"),
            letter if letter.is_control() => {
                quoted.push_str(&format!("\\u{:04X}", u32::from(letter)));
            }
            letter => quoted.push(letter),
        }
    }
    quoted + "\""
}

/// The daemon's configuration as shipped: the recommended set.
const SHIPPED: &str = include_str!("../../../../config/daemon.toml");
/// Lines of the shipped configuration that belong to another train, and their replacements.
const REPLACED: [(&str, &str); 5] = [
    (
        "# Dynocar's daemon: which trains it serves, and which estimators learn what.",
        "# Dynocar's daemon: which trains it serves, and which estimators learn what. Written by\n\
         # dynocar init from the recommended set.",
    ),
    (
        "# dynocar check config/daemon.toml says what this file means.",
        "# dynocar check daemon.toml says what this file means.",
    ),
    ("file = \"demo/train.toml\"    # relative", "file = \"train.toml\"         # relative"),
    ("track = \"demo/track.toml\"   # optional", "# track = \"track.toml\"      # optional"),
    (
        "# the train file; the demo's train has neither.",
        "# the train file, table [brake]; add them before you switch it on.",
    ),
];

/// Returns the daemon's configuration: the recommended set for the train file next to it.
fn daemon_text(has_track: bool) -> String {
    let text = REPLACED
        .iter()
        .fold(String::from(SHIPPED), |text, (shipped, own)| text.replace(shipped, own));
    if has_track {
        text.replace("# track = \"track.toml\" ", "track = \"track.toml\"   ")
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynocar_analysis::dataset::guess::{GivenMarks, RecordingText, guess};
    use dynocar_analysis::dataset::manifest::{Manifest, Role};

    #[test]
    fn names_with_any_marks_lead_back_to_their_column() {
        let text = "\"t \"\"s\"\" [s]\";\"v\t\\x [km/h]\";\"a\nb\"\n0;1;2\n1;50;3\n2;90;4\n";
        let files = [RecordingText { label: "a.csv", text }];
        let guess =
            guess(&files, &[], GivenMarks::default()).unwrap_or_else(|error| panic!("{error}"));
        let files = ["da\"y\\1.csv".to_string()];
        let text = dataset_text(&guess, ("x\n[y]", None), &files, true);
        let manifest = Manifest::parse("dataset.toml", &text).unwrap_or_else(|it| panic!("{it}"));
        let columns: Vec<&str> = manifest.columns.iter().map(|it| it.column.as_str()).collect();
        assert_eq!(columns, ["t \"s\" [s]", "v\t\\x [km/h]"]);
        assert_eq!((manifest.layout.delimiter, manifest.name.as_str()), (b';', "x\n[y]"));
        assert_eq!(manifest.runs[0].file, files[0]);
        assert!(manifest.track_file.is_some() && text.contains("# Taken for nothing:"));
    }

    #[test]
    fn of_several_runs_the_last_is_held_out() {
        let text = "t,v\n0,1\n1,2\n";
        let recording = RecordingText { label: "a.csv", text };
        for count in 1..4 {
            let guess = guess(&vec![recording; count], &[], GivenMarks::default()).unwrap();
            let files: Vec<String> = (0..count).map(|index| format!("{index}.csv")).collect();
            let text = dataset_text(&guess, ("x", None), &files, false);
            let manifest = Manifest::parse("dataset.toml", &text).unwrap();
            let roles: Vec<Role> = manifest.runs.iter().map(|run| run.role).collect();
            assert_eq!(roles.contains(&Role::Holdout), count > 1);
            assert!(roles[0] == Role::Fit || count > 1);
            assert!(roles[..count.saturating_sub(1)].iter().all(|role| *role == Role::Fit));
        }
    }
}

#[cfg(test)]
mod daemon_text_tests {
    use super::*;
    use crate::cli::train_text::{TrainArguments, TrainValues};
    use dynocar::config::DaemonConfig;

    #[test]
    fn the_configuration_is_the_shipped_one_for_the_train_next_to_it() {
        for (shipped, _) in REPLACED {
            assert_eq!(SHIPPED.matches(shipped).count(), 1, "{shipped}");
        }
        let folder = tempfile::tempdir().unwrap();
        let train = TrainArguments::default().text("x", &TrainValues::default()).unwrap();
        std::fs::write(folder.path().join("train.toml"), train.text).unwrap();
        std::fs::write(folder.path().join("track.toml"), "[track]\n").unwrap();
        let shipped = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/daemon.toml");
        let shipped = DaemonConfig::load(std::path::Path::new(shipped)).unwrap();
        for has_track in [false, true] {
            let text = daemon_text(has_track);
            assert!(!text.contains("demo"), "{text}");
            let path = folder.path().join("daemon.toml");
            std::fs::write(&path, text).unwrap();
            let config = DaemonConfig::load(&path).unwrap();
            assert_eq!(config.pipelines.len(), shipped.pipelines.len());
            assert_eq!(config.trains[0].track.is_some(), has_track);
        }
    }
}
