//! The command line of `dynocar init`; it asks for missing facts at a terminal.

use std::io::{IsTerminal, stderr, stdin};
use std::path::{Path, PathBuf};

use clap::Args;
use dialoguer::Input;
use dynocar::cli::Failure;
use dynocar::output::require_new;
use dynocar_analysis::dataset::guess::GivenColumn;
use dynocar_analysis::dataset::text_layout::by_name;
use dynocar_analysis::dataset::{Quantity, TimeFormat};
use dynocar_model::train::numbers::MASS;
use dynocar_model::units::Unit;
use encoding_rs::Encoding;

use super::summary::DAEMON_FILE;
use crate::cli::train_text::{ASKED, Asked, TrainArguments};
use dynocar::models::text::TRAIN_FILE;

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
