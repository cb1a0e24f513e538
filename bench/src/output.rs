//! Results for people and for machines, and how a command of this program fails.

use std::collections::BTreeMap;
use std::error::Error;
use std::fmt::Display;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::{Serialize, Serializer};
use serde_json::Value;

/// Cause of a command's failure, in words; exit status 1, or 2 for [`Usage`].
pub type BenchError = Box<dyn Error + Send + Sync>;

/// A mistake on the command line, with the expected form: exit status 2.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Usage(pub String);

/// Refuses the command line unless a condition holds.
///
/// # Errors
///
/// When it does not hold.
pub fn expect(holds: bool, words: impl FnOnce() -> String) -> Result<(), BenchError> {
    if holds { Ok(()) } else { Err(Usage(words()).into()) }
}

/// Returns a parser of whole numbers from `least` on.
pub fn at_least(least: usize) -> impl Fn(&str) -> Result<usize, String> + Clone {
    move |text| {
        let number = text.parse().ok().filter(|number| *number >= least);
        number.ok_or_else(|| format!("expected a whole number, {least} or more"))
    }
}

/// Returns the value for which a name on the command line stands.
///
/// # Errors
///
/// If no entry has this name; the message lists the names.
pub fn named<T: Copy>(option: &str, name: &str, all: &[(&str, T)]) -> Result<T, BenchError> {
    let found = all.iter().find(|(own, _)| *own == name).map(|(_, it)| *it);
    found.ok_or_else(|| {
        let known: Vec<&str> = all.iter().map(|(own, _)| *own).collect();
        Usage(format!("{option} {name}: expected one of {}", known.join(", "))).into()
    })
}

/// Returns those of all whose name contains a text.
///
/// # Errors
///
/// When none does.
pub fn containing<T>(
    option: &str,
    text: &str,
    mut all: Vec<T>,
    name: impl Fn(&T) -> String,
) -> Result<Vec<T>, BenchError> {
    all.retain(|it| name(it).contains(text));
    let what = option.trim_start_matches('-');
    expect(!all.is_empty(), || format!("{option} {text}: expected a part of a {what}'s name"))?;
    Ok(all)
}

/// Returns a function that puts the work during which an error happened before its message.
pub fn during<E: Display>(what: impl Display) -> impl FnOnce(E) -> BenchError {
    move |error| format!("{what}: {error}").into()
}

/// Where a result goes.
#[derive(Debug, Args)]
pub struct OutputArguments {
    /// Write the result for machines; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

impl OutputArguments {
    /// Gives a result to machines where they want it, and to people unless standard output is taken.
    ///
    /// # Errors
    ///
    /// When it cannot be written.
    pub fn give(
        &self,
        result: &impl Serialize,
        for_people: impl FnOnce() -> String,
    ) -> Result<(), BenchError> {
        Ok(dynocar::output::give(self.json.as_deref(), result, for_people)?)
    }
}

/// Fails with these lines under a heading, if there are any.
///
/// # Errors
///
/// When there is a line.
pub fn expect_none(what: &str, lines: Vec<String>) -> Result<(), BenchError> {
    match lines.is_empty() {
        true => Ok(()),
        false => Err(format!("{what}:\n{}", lines.join("\n")).into()),
    }
}

/// A cell of a table: its column, its text where people see it, and its value for machines.
#[derive(Clone, Debug)]
struct Cell {
    name: String,
    text: Option<String>,
    value: Value,
}

/// A row of a table of figures, for people, as CSV, and as JSON with the names of the columns.
#[derive(Clone, Debug, Default)]
pub struct Record(Vec<Cell>);

impl Record {
    /// With one more cell that people read otherwise than machines.
    #[must_use]
    pub fn shown(mut self, name: impl Into<String>, text: String, value: impl Into<Value>) -> Self {
        self.0.push(Cell { name: name.into(), text: Some(text), value: value.into() });
        self
    }

    /// With one more cell that people do not see.
    #[must_use]
    pub fn for_machines(mut self, name: &str, value: impl Into<Value>) -> Self {
        self.0.push(Cell { name: name.into(), text: None, value: value.into() });
        self
    }

    /// With one more cell.
    #[must_use]
    pub fn with(self, name: impl Into<String>, cell: impl Display) -> Self {
        let text = cell.to_string();
        let value = text.parse::<u64>().map_or(Value::from(&*text), Value::from);
        self.shown(name, text, value)
    }

    /// Adds a number with `decimals` decimals; empty where there is no number.
    #[must_use]
    pub fn number(
        self,
        name: impl Into<String>,
        value: impl Into<Option<f64>>,
        decimals: usize,
    ) -> Self {
        let known = value.into().filter(|it| it.is_finite());
        self.shown(name, known.map_or(String::new(), |it| format!("{it:.decimals$}")), known)
    }

    /// Returns the number in a column, as machines get it.
    pub fn value(&self, name: &str) -> Option<f64> {
        self.0.iter().find(|it| it.name == name)?.value.as_f64()
    }

    /// The cell of a column, as people read it.
    #[cfg(test)]
    pub fn cell(&self, name: &str) -> Option<&str> {
        self.0.iter().find(|it| it.name == name)?.text.as_deref()
    }

    /// Names and texts of the cells that people see.
    fn seen(&self) -> Vec<(&str, &str)> {
        self.0.iter().filter_map(|it| Some((it.name.as_str(), it.text.as_deref()?))).collect()
    }

    /// As people read it: units in words, and an interval in the cell of its figure; a time says its unit itself.
    fn for_people(&self) -> Vec<(String, String)> {
        let seen = self.seen();
        let (mut cells, mut rest) = (Vec::with_capacity(seen.len()), seen.iter());
        while let Some((name, text)) = rest.next() {
            let is_figure = rest.as_slice().first().is_some_and(|it| it.0 == format!("{name}_low"));
            let mut text = text.to_string();
            if is_figure
                && let (Some(low), Some(high)) = (rest.next(), rest.next())
                && !low.1.is_empty()
            {
                text += &format!(" ({}–{})", low.1, high.1);
            }
            let name = name.trim_end_matches("_ns").replace('_', " ").replace("percent", "%");
            cells.push((name, text));
        }
        cells
    }
}

impl Serialize for Record {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|it| (&it.name, &it.value)))
    }
}

/// Returns how often things came, in words.
pub fn counts<K: Display>(of: &BTreeMap<K, usize>) -> String {
    of.iter().map(|(it, count)| format!("{it} {count}")).collect::<Vec<_>>().join(", ")
}

/// Returns the rows with the same columns as a table of Markdown that reads in a terminal too: words to the left,
/// numbers to the right.
pub fn table(records: &[Record]) -> String {
    let rows: Vec<_> = records.iter().map(Record::for_people).collect();
    let Some(first) = rows.first() else { return String::new() };
    let columns: Vec<(usize, bool)> = (0..first.len())
        .map(|column| {
            let cells = || rows.iter().map(|row| &row[column].1).filter(|it| !it.is_empty());
            let longest = cells().chain([&first[column].0]).map(|it| it.chars().count()).max();
            let words = cells().filter(|it| it.starts_with(|one: char| one.is_alphabetic()));
            (longest.unwrap_or(0).max(3), 2 * words.count() > cells().count())
        })
        .collect();
    let line = |cells: &mut dyn Iterator<Item = &String>| {
        let cells = cells.zip(&columns).map(|(cell, &(width, is_words))| match is_words {
            true => format!(" {cell:<width$} |"),
            false => format!(" {cell:>width$} |"),
        });
        cells.fold(String::from("|"), |line, cell| line + &cell) + "\n"
    };
    let rule = columns.iter().map(|&(width, is_words)| match is_words {
        true => "-".repeat(width),
        false => "-".repeat(width - 1) + ":",
    });
    let rule: Vec<String> = rule.collect();
    let head = line(&mut first.iter().map(|it| &it.0)) + &line(&mut rule.iter());
    rows.iter().fold(head, |text, row| text + &line(&mut row.iter().map(|it| &it.1)))
}

/// Writes rows with the same columns as CSV under a line of their names.
///
/// # Errors
///
/// When the file cannot be written.
pub fn write_csv(file: &Path, records: &[Record]) -> Result<(), BenchError> {
    let write = || -> Result<(), csv::Error> {
        let mut writer = csv::Writer::from_path(file)?;
        if let Some(first) = records.first() {
            writer.write_record(first.seen().iter().map(|it| it.0))?;
        }
        for record in records {
            writer.write_record(record.seen().iter().map(|it| it.1))?;
        }
        Ok(writer.flush()?)
    };
    write().map_err(during(file.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_that_is_too_small_or_none_is_refused_with_the_least() {
        assert_eq!(at_least(2)("2"), Ok(2));
        for text in ["1", "-3", "x", "", "1e3"] {
            assert_eq!(at_least(2)(text), Err("expected a whole number, 2 or more".into()));
        }
    }

    #[test]
    fn words_stand_left_and_numbers_right_with_their_intervals() {
        let row = |name: &str, value: Option<f64>| {
            let row = Record::default().with("driver", name).number("late_s", value, 1);
            row.number("late_s_low", value.map(|it| it - 1.0), 1).number("late_s_high", value, 1)
        };
        let text = table(&[row("declared", Some(11.25)), row("true", None)]);
        let expected = "| driver   |           late s |\n| -------- | ---------------: |\n\
                        | declared | 11.2 (10.2–11.2) |\n| true     |                  |\n";
        assert_eq!(text, expected);
        assert_eq!(table(&[]), "");
    }
}
