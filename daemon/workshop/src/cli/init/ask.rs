//! What nobody has said on the command line, asked of whoever sits at a terminal.

use std::path::PathBuf;

use dialoguer::Input;

use super::arguments::{FOLDER_DEFAULT, InitArguments};
use super::described::DAEMON_FILE;
use crate::cli::train_text::{QUESTIONS, TRAIN_FILE};
use dynocar::cli::Failure;
use dynocar::output::require_new;

/// The arguments with what is asked for: everything that was not said, where not even the folder was.
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
    for (key, words) in QUESTIONS.into_iter().filter(|(key, _)| !given.train.knows(key)) {
        let default = match key {
            "mass_t" if !arguments.csv.is_empty() => "by the recordings, else 200.0".into(),
            _ => train.default_of(key)?,
        };
        let answer = ask(words, &default, |answer| train.with_answer(key, answer).map(|_| ()))?;
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
