//! The command line of `dynocar init`, which asks for missing facts at a terminal, and its report.

use std::io::{IsTerminal, stderr, stdin};
use std::path::{Path, PathBuf};

use clap::Args;
use dialoguer::Input;
use dynocar::cli::Failure;
use dynocar::cli::text::{TextTable, entry};
use dynocar::models::text::TRAIN_FILE;
use dynocar::output::require_new;
use dynocar_analysis::dataset::guess::{GivenColumn, GivenMarks, Guess, shown_mark};
use dynocar_analysis::dataset::keys::dataset::{DECIMAL, DELIMITER};
use dynocar_analysis::dataset::text_layout::{
    OTHER_DECIMAL, by_name, decimal_of, delimiter_of, is_ambiguous,
};
use dynocar_analysis::dataset::{DatasetDiagnostic, MANIFEST_FILE, Quantity, TimeFormat};
use dynocar_model::train::numbers::MASS;
use dynocar_model::units::Unit;
use encoding_rs::{Encoding, UTF_8};

use crate::cli::train_text::{ASKED, Asked, TrainArguments, TrainText};
use crate::formats::run_reader;
use crate::report::provenance::for_shell;
use crate::run_facts::diagnostics;

/// The folder for the files where the user at the terminal gives no other.
pub const FOLDER_DEFAULT: &str = "my_train";

/// Describe your train and your CSV recordings as TOML files.
///
/// It writes train.toml, daemon.toml and dataset.toml, which states the assumed meaning of every column and the reason.
/// Nothing is overwritten. On a terminal, without a folder, it asks for all that is not given.
#[derive(Clone, Debug, Args)]
pub struct InitArguments {
    /// The folder for the files; it is made where there is none
    #[arg(required = nobody_is_there())]
    pub folder: Option<PathBuf>,
    /// Recorded runs of the train, laid out alike; of several the last one is held out
    #[arg(long, value_name = "FILE", num_args = 1..)]
    pub csv: Vec<PathBuf>,
    /// Which letters the files' bytes are, as windows-1251 or gbk [default: UTF-8, else guessed]
    #[arg(long, value_name = "NAME", requires = "csv", value_parser = encoding)]
    pub encoding: Option<&'static Encoding>,
    /// The mark between the cells of a row, as ';' or '\t' [default: guessed]
    #[arg(long, value_name = "MARK", requires = "csv", value_parser = delimiter)]
    pub delimiter: Option<u8>,
    /// The mark before a number's fraction: '.' or ',' [default: guessed]
    #[arg(long, value_name = "MARK", requires = "csv", value_parser = decimal)]
    pub decimal: Option<u8>,
    /// Take the rows of one train of files that hold several, by its cell in the column that names them
    #[arg(long = "train", value_name = "CELL", requires = "csv")]
    pub train_cell: Option<String>,
    /// State the quantity of a column, as speed=v_ist:km/h or time=Zeit:%d.%m.%Y %H:%M:%S; may be given several times
    #[arg(long, value_name = "QUANTITY=COLUMN[:UNIT]", value_parser = given_column)]
    pub column: Vec<GivenColumn>,
    #[command(flatten)]
    pub train: TrainArguments,
}

impl InitArguments {
    /// Returns the folder.
    pub fn folder(&self) -> &Path {
        self.folder.as_deref().unwrap_or(Path::new(FOLDER_DEFAULT))
    }

    /// Returns the marks of the recordings that are stated.
    ///
    /// # Errors
    ///
    /// Two marks of which one would be taken for the other, and any for files that are no text.
    pub fn marks(&self) -> Result<GivenMarks, Failure> {
        let marks = GivenMarks { delimiter: self.delimiter, decimal: self.decimal };
        if marks != GivenMarks::default() && self.csv.iter().any(|it| run_reader(it).is_some()) {
            let words = "--delimiter, --decimal: expected files of text with them";
            return Err(Failure::Input(words.into()));
        }
        match (marks.delimiter, marks.decimal) {
            (Some(delimiter), Some(decimal)) if is_ambiguous(delimiter, decimal) => {
                Err(Failure::Input(format!("--decimal: expected {OTHER_DECIMAL}")))
            }
            _ => Ok(marks),
        }
    }
}

/// Returns whether nobody can be asked.
fn nobody_is_there() -> bool {
    !(stdin().is_terminal() && stderr().is_terminal())
}

/// Returns an encoding by one of its names.
fn encoding(name: &str) -> Result<&'static Encoding, String> {
    let expected = "expected a name of the WHATWG's, as windows-1251, gbk, shift_jis or ibm866";
    by_name(name).ok_or_else(|| expected.into())
}

/// Returns a delimiter; shells leave `\t` as it is.
fn delimiter(text: &str) -> Result<u8, String> {
    let mark = if text == "\\t" { "\t" } else { text };
    delimiter_of(mark).ok_or_else(|| format!("expected {}", DELIMITER.rule.allowed))
}

/// Returns a decimal mark.
fn decimal(text: &str) -> Result<u8, String> {
    decimal_of(text).ok_or_else(|| format!("expected {}", DECIMAL.rule.allowed))
}

/// Parses the user's description of a column: `QUANTITY=COLUMN` or `QUANTITY=COLUMN:UNIT`.
fn given_column(text: &str) -> Result<GivenColumn, String> {
    let expected = "expected QUANTITY=COLUMN or QUANTITY=COLUMN:UNIT, as speed=v_ist:km/h";
    let (name, rest) = text.split_once('=').ok_or(expected)?;
    let names = || Quantity::ALL.map(Quantity::name).join(", ");
    let quantity = Quantity::from_name(name.trim())
        .ok_or_else(|| format!("'{name}' is no quantity; the quantities: {}", names()))?;
    // Names and formats may hold colons, too: the text after a colon counts where it is a unit or a format.
    let said = |at: usize| {
        let (column, said) = (rest[..at].trim().to_owned(), rest[at + 1..].trim());
        let unit = Unit::find(quantity.dimension(), said);
        let is_time = quantity == Quantity::Time && unit.is_none();
        // A pattern that begins with a letter begins with the end of the column's name.
        let is_pattern = !said.contains('%') || !said.starts_with(char::is_alphabetic);
        let format = TimeFormat::from_name(said).filter(|_| is_time && is_pattern);
        let is_said = unit.is_some() || format.is_some();
        is_said.then_some(GivenColumn { quantity, column, unit, format })
    };
    if let Some(given) = rest.match_indices(':').find_map(|(at, _)| said(at)) {
        return Ok(given);
    }
    if rest.trim().is_empty() {
        return Err(expected.into());
    }
    Ok(GivenColumn { quantity, column: rest.trim().into(), unit: None, format: None })
}

/// Returns the arguments, completed by questions at the terminal where not even the folder was given.
///
/// # Errors
///
/// When the terminal is gone, or the questions were broken off.
pub fn complete(given: &InitArguments) -> Result<InitArguments, Failure> {
    let mut arguments = given.clone();
    if arguments.folder.is_some() {
        return Ok(arguments);
    }
    arguments.folder = ask("Folder for the files", FOLDER_DEFAULT, |_| Ok(()))?.map(PathBuf::from);
    // Before all the questions, not after them.
    for name in [TRAIN_FILE, DAEMON_FILE] {
        require_new(&arguments.folder().join(name))?;
    }
    if arguments.csv.is_empty() {
        arguments.csv = recordings()?;
    }
    let train = &mut arguments.train;
    for Asked { key, question, .. } in ASKED.iter().filter(|it| !given.train.knows(it.key)) {
        let default = match *key == MASS.name && !arguments.csv.is_empty() {
            true => "by the recordings, else 200.0".into(),
            false => train.default_of(key)?,
        };
        let answer = ask(question, &default, |answer| train.with_answer(key, answer).map(|_| ()))?;
        if let Some(answer) = answer {
            *train = train.with_answer(key, &answer).map_err(Failure::Input)?;
        }
    }
    Ok(arguments)
}

/// Recorded runs, until there are no more.
fn recordings() -> Result<Vec<PathBuf>, Failure> {
    let mut csv = Vec::new();
    loop {
        let words = match csv.is_empty() {
            true => "Recorded run, a CSV file; none is needed",
            false => "Another one",
        };
        let is_file = |answer: &str| match std::path::Path::new(answer).is_file() {
            true => Ok(()),
            false => Err(format!("{answer}: expected a file")),
        };
        match ask(words, "none", is_file)? {
            Some(path) => csv.push(PathBuf::from(path)),
            None => return Ok(csv),
        }
    }
}

/// An answer that passes, `None` where the default is taken; a wrong one is reported and asked for again.
fn ask(
    words: &str,
    default: &str,
    passes: impl Fn(&str) -> Result<(), String>,
) -> Result<Option<String>, Failure> {
    let answer = Input::<String>::new()
        .with_prompt(format!("{words} [{default}]"))
        .allow_empty(true)
        .validate_with(|answer: &String| match answer.trim() {
            "" => Ok(()),
            answer => passes(answer),
        })
        .interact_text();
    let answer = answer.map_err(|error| Failure::Work(format!("the questions ended: {error}")))?;
    Ok(Some(answer.trim().to_owned()).filter(|answer| !answer.is_empty()))
}

/// Describes the written files, the understanding of the recordings, and the next steps.
pub fn summary(folder: &Path, train: &TrainText, described: Option<&Described>) -> String {
    let mut text = String::new();
    if let Some(described) = described {
        text += &understood(described);
    }
    if !train.defaults.is_empty() {
        text += &entry(
            "",
            &format!("defaults in {TRAIN_FILE}, nobody's figures: {}", train.defaults.join(", ")),
        );
    }
    let names = [Some(TRAIN_FILE), Some(DAEMON_FILE), described.map(|_| MANIFEST_FILE)];
    let written = names.into_iter().flatten();
    let written: Vec<String> =
        written.map(|name| folder.join(name).display().to_string()).collect();
    text += &format!("written: {}\n", written.join(", "));
    text + &next(folder, described)
}

fn understood(described: &Described) -> String {
    let (guess, layout) = (&described.guess, &described.guess.layout);
    let mut text = String::new();
    for (run, file) in guess.runs.iter().zip(&described.files) {
        let falls = if run.direction < 0 { ", the position falls" } else { "" };
        text += &format!("{file}: {} rows{falls}\n", run.rows);
    }
    let delimiter = shown_mark(layout.delimiter);
    text += &format!("cells end at {delimiter}, decimals at '{}'\n", char::from(layout.decimal));
    if layout.encoding != UTF_8 {
        let name = layout.encoding.name().to_lowercase();
        text += &format!("letters are {name}: the files are no UTF-8; --encoding says another\n");
    }
    if layout.skip_rows > 0 {
        text += &format!("the names stand in line {}\n", layout.skip_rows + 1);
    }
    if layout.units_row {
        text += "units stand in the line below the names\n";
    }
    text.push('\n');
    let mut table = TextTable::new(
        &["column", "taken for", "unit or format", "sure", "since"],
        &[0, 1, 2, 3, 4],
    );
    for column in &guess.columns {
        let scale = match column.scale {
            1.0 => String::new(),
            scale => format!("{scale} × "),
        };
        table.push(vec![
            std::iter::once(&column.name)
                .chain(&column.parts)
                .map(|name| format!("'{}'", name.shown()))
                .collect::<Vec<_>>()
                .join(" + "),
            column.quantity.to_string(),
            match &column.format {
                Some(format) => format.name().to_owned(),
                None => format!("{scale}{}", column.unit.name()),
            },
            if column.doubts.is_empty() { "yes".into() } else { "NO".into() },
            column.reasons.join("; "),
        ]);
    }
    text += &table.to_string();
    for column in &guess.unmapped {
        text += &entry("  ", &format!("not mapped: '{}': {}", column.name.shown(), column.reason));
    }
    text.push('\n');
    for column in &guess.columns {
        for doubt in &column.doubts {
            text += &entry("", &format!("doubtful: {}: {doubt}", column.quantity));
        }
    }
    text + &diagnostics(&described.diagnostics)
}

/// Returns the commands that come next.
fn next(folder: &Path, described: Option<&Described>) -> String {
    let at = |name: &str| for_shell(&folder.join(name).display().to_string());
    let mut commands = Vec::new();
    if described.is_some() {
        let folder = for_shell(&folder.display().to_string());
        commands.push((format!("dynocar check {}", at(MANIFEST_FILE)), "what was understood"));
        commands.push((format!("dynocar identify {folder}"), "resistance and mass from the runs"));
        let report = at("report.html");
        let explain = format!("dynocar explain {folder} --report {report}");
        commands.push((explain, "what the model lacks"));
    } else {
        commands.push((format!("dynocar check {}", at(TRAIN_FILE)), "what was understood"));
    }
    commands.push((format!("dynocar run --config {}", at(DAEMON_FILE)), "the daemon"));
    let mut text = String::from("\nnext, once the files say what is true of your train:\n");
    for (command, what) in commands {
        text += &format!("  {command}    # {what}\n");
    }
    text
}

/// Name of the daemon's configuration.
pub const DAEMON_FILE: &str = "daemon.toml";

/// Understanding of the recordings.
pub struct Described {
    /// The assumed meaning of the columns.
    pub guess: Guess,
    /// The runs' files, as the dataset names them.
    pub files: Vec<String>,
    /// Impossibilities of the runs as they were understood, the worst first.
    pub diagnostics: Vec<DatasetDiagnostic>,
    /// `dataset.toml`.
    pub text: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_is_reported_with_or_without_its_unit() {
        let kmh = Unit::find(Quantity::Speed.dimension(), "km/h");
        let speed = |column: &str, unit| GivenColumn {
            quantity: Quantity::Speed,
            column: column.into(),
            unit,
            format: None,
        };
        let clock = given_column("time=Zeit: UTC:%d.%m.%Y %H:%M:%S").unwrap();
        assert_eq!(clock.column, "Zeit: UTC");
        assert_eq!(clock.format.unwrap().name(), "%d.%m.%Y %H:%M:%S");
        let unnamed = given_column("time=:s").unwrap();
        assert_eq!((&unnamed.column[..], unnamed.unit.map(|it| it.name())), ("", Some("s")));
        assert_eq!(given_column("speed=v_ist:km/h"), Ok(speed("v_ist", kmh)));
        assert_eq!(given_column("speed=v_ist"), Ok(speed("v_ist", None)));
        assert_eq!(given_column("speed=MVB:v=1:km/h"), Ok(speed("MVB:v=1", kmh)));
        assert_eq!(given_column("speed=MVB:v"), Ok(speed("MVB:v", None)));
        assert!(given_column("speed").unwrap_err().starts_with("expected QUANTITY=COLUMN"));
        assert!(
            given_column("velocity=v")
                .unwrap_err()
                .contains("'velocity' is no quantity; the quant")
        );
        assert!(given_column("speed= ").is_err());
    }
}
