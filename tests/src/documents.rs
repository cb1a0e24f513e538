//! The pages of the documentation as text: their links, their headings, and the commands that they show.

use std::path::PathBuf;

use clap::error::ErrorKind;

use crate::sources::workspace;

/// A page with its path from the workspace's folder.
#[derive(Debug)]
pub struct Page {
    /// The path, as `docs/index.md`
    pub path: PathBuf,
    /// The text
    pub text: String,
}

/// A command that a page shows.
#[derive(Debug)]
pub struct Shown {
    /// The page and the line of the command
    pub place: String,
    /// The words after the program's name
    pub words: Vec<String>,
    /// True if the command stands in a sentence or as a pattern, where it may be incomplete
    pub is_mention: bool,
}

/// Returns all pages: those in the workspace's folder, in `docs` and the client's.
///
/// # Panics
///
/// When a folder or page cannot be read.
pub fn pages() -> Vec<Page> {
    let (mut found, mut open) = (Vec::new(), vec![PathBuf::from("docs")]);
    let is_page = |path: &PathBuf| path.extension().is_some_and(|it| it == "md");
    let entries = |folder: &PathBuf| {
        let entries = std::fs::read_dir(workspace().join(folder)).expect("a folder");
        entries.map(|it| folder.join(it.expect("an entry").file_name())).collect::<Vec<_>>()
    };
    found.extend(entries(&PathBuf::new()).into_iter().filter(is_page));
    found.push(PathBuf::from("client/README.md"));
    while let Some(folder) = open.pop() {
        for path in entries(&folder) {
            if workspace().join(&path).is_dir() { open.push(path) } else { found.push(path) }
        }
    }
    found.retain(is_page);
    found.sort();
    let text = |path: &PathBuf| std::fs::read_to_string(workspace().join(path)).expect("a page");
    found.into_iter().map(|path| Page { text: text(&path), path }).collect()
}

impl Page {
    /// Returns the page's lines outside blocks of code, and those in them with the block's language.
    fn lines(&self) -> impl Iterator<Item = (Option<&str>, &str)> {
        let mut language = None;
        self.text.lines().filter_map(move |line| {
            match (line.trim_start().strip_prefix("```"), language) {
                (Some(_), Some(_)) => {
                    language = None;
                    None
                }
                (Some(name), None) => {
                    language = Some(name);
                    None
                }
                (None, language) => Some((language, line)),
            }
        })
    }

    /// Returns the text outside blocks of code, line by line.
    pub fn prose(&self) -> impl Iterator<Item = &str> {
        self.lines().filter(|(language, _)| language.is_none()).map(|(_, line)| line)
    }

    /// Returns where the page's links lead, outside code.
    pub fn links(&self) -> Vec<&str> {
        let mut found = Vec::new();
        for line in self.prose() {
            for part in line.split("](").skip(1) {
                found.extend(part.split_once(')').map(|(target, _)| target));
            }
        }
        found
    }

    /// Returns the anchors of the page's headings, as GitHub makes them.
    pub fn anchors(&self) -> Vec<String> {
        let headings = self.prose().filter(|line| line.starts_with('#'));
        headings.map(|line| anchor(line.trim_start_matches('#').trim())).collect()
    }

    /// Returns the paragraphs of running text: no tables, lists, headings or code.
    pub fn paragraphs(&self) -> Vec<String> {
        let mut found = vec![String::new()];
        for (language, line) in self.lines() {
            let begins = line.trim_start();
            let is_text = language.is_none()
                && !begins.is_empty()
                && !begins.starts_with(['|', '#', '<', '!']);
            let is_numbered =
                begins.split_once(". ").is_some_and(|(it, _)| it.parse::<u32>().is_ok());
            if !is_text || begins.starts_with("- ") || is_numbered {
                found.push(String::new());
            }
            if is_text {
                let last = found.last_mut().expect("a paragraph");
                last.push(' ');
                last.push_str(line.trim());
            }
        }
        found.retain(|it| !it.is_empty());
        found
    }

    /// Returns the commands of a program, in blocks and in sentences.
    pub fn commands(&self, program: &str) -> Vec<Shown> {
        let mut found = Vec::new();
        let mut begun = String::new();
        for (language, line) in self.lines() {
            let place = || format!("{}: {}", self.path.display(), line.trim());
            match language {
                Some("sh") => {
                    begun.push_str(line.trim());
                    if begun.ends_with('\\') {
                        begun.pop();
                        continue;
                    }
                    let is_mention = begun.contains('[');
                    found.extend(shown(place(), &std::mem::take(&mut begun), program, is_mention));
                }
                // A session as in a terminal.
                Some(_) => {
                    let typed = line.strip_prefix("$ ");
                    found.extend(typed.and_then(|it| shown(place(), it, program, false)));
                }
                None => {
                    let codes = line.split('`').skip(1).step_by(2);
                    found.extend(codes.filter_map(|it| shown(place(), it, program, true)));
                }
            }
        }
        found
    }
}

/// Returns the anchor of a heading: lower case, punctuation left out, a hyphen for each space.
fn anchor(heading: &str) -> String {
    let kept = heading.chars().filter(|it| it.is_alphanumeric() || matches!(it, ' ' | '-' | '_'));
    kept.flat_map(char::to_lowercase).map(|it| if it == ' ' { '-' } else { it }).collect()
}

/// Returns a line as a command of a program, if it is one.
fn shown(place: String, line: &str, program: &str, is_mention: bool) -> Option<Shown> {
    let line = if is_mention {
        line.replace(" [", " ").replace("] ", " ").trim_end_matches(']').to_owned()
    } else {
        line.to_owned()
    };
    let mut words = words(&line);
    if words.first()? == "cargo" && program != "cargo" {
        // `cargo run … -p PROGRAM -- …`; without a package it is `dynocar`.
        let named = words.iter().position(|it| it == "-p" || it == "--bin").map(|at| at + 1);
        let binary = words.iter().position(|it| it == "--bin").map(|at| at + 1).or(named);
        let name = binary.and_then(|at| words.get(at)).map_or("dynocar", String::as_str).to_owned();
        let start = words.iter().position(|it| it == "--")?;
        if words[1] != "run" || name != program {
            return None;
        }
        return Some(Shown { place, words: words.split_off(start + 1), is_mention });
    }
    let first = words.remove(0);
    let is_it = first == program || first.ends_with(&format!("/{program}"));
    // A name alone is no command.
    (is_it && !words.is_empty()).then_some(Shown { place, words, is_mention })
}

/// Returns the words of a line as a shell takes them, up to a comment, a pipe, a redirection or `&`.
fn words(line: &str) -> Vec<String> {
    let (mut words, mut word, mut quote) = (Vec::new(), None::<String>, None);
    for char in line.chars() {
        match (quote, char) {
            (Some(open), _) if open == char => quote = None,
            (Some(_), _) => word.get_or_insert_default().push(char),
            (None, '"' | '\'') => {
                quote = Some(char);
                word.get_or_insert_default();
            }
            (None, '#' | '|' | '>' | '&' | ';') if word.is_none() => break,
            (None, ' ') => words.extend(word.take()),
            (None, _) => word.get_or_insert_default().push(char),
        }
    }
    words.extend(word);
    words
}

impl Shown {
    /// Returns the error of a command line for these words; a mention may leave out required words.
    pub fn refusal(&self, command: clap::Command) -> Option<String> {
        use ErrorKind::{
            DisplayHelp, DisplayHelpOnMissingArgumentOrSubcommand, DisplayVersion,
            MissingRequiredArgument, MissingSubcommand,
        };
        let name = command.get_name().to_owned();
        let words = std::iter::once(&name).chain(&self.words);
        let error = command.try_get_matches_from(words).err()?;
        match error.kind() {
            DisplayHelp | DisplayVersion => None,
            MissingRequiredArgument
            | MissingSubcommand
            | DisplayHelpOnMissingArgumentOrSubcommand
                if self.is_mention =>
            {
                None
            }
            // A name in capitals stands for a reader's value: `--train ID`, `help COMMAND`.
            ErrorKind::InvalidValue | ErrorKind::ValueValidation | ErrorKind::InvalidSubcommand
                if self.is_mention && self.words.iter().any(|it| is_placeholder(it)) =>
            {
                None
            }
            _ => Some(format!("{}\n    {error}", self.place)),
        }
    }
}

fn is_placeholder(word: &str) -> bool {
    word.len() > 1 && word.chars().all(|it| it.is_ascii_uppercase() || "_:.|".contains(it))
        || word.contains('…')
}
