//! Reading TOML with the line of every key, and refusing keys that mean nothing.

use toml::Spanned;
use toml::de::{DeTable, DeValue};
use toml::value::Datetime;

use super::error::{DatasetError, Problem, SourcePosition};
use super::names::Choices;

/// The names of the tables and keys at the top of a TOML file, in the order of the file.
///
/// # Errors
///
/// When the text is not TOML.
pub fn top_keys(label: &str, text: &str) -> Result<Vec<String>, DatasetError> {
    let document = Document::parse(label, text)?;
    Ok(document.root().keys().into_iter().map(|(name, _)| name.into()).collect())
}

/// A TOML file with its name, for messages.
pub(super) struct Document<'t> {
    label: &'t str,
    /// Byte offsets at which the lines start.
    line_starts: Vec<usize>,
    root: Spanned<DeTable<'t>>,
}

impl<'t> Document<'t> {
    /// Parses a file's text; a byte-order mark is skipped.
    pub fn parse(label: &'t str, text: &'t str) -> Result<Self, DatasetError> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let line_starts: Vec<usize> =
            std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect();
        let root = DeTable::parse(text).map_err(|error| {
            let line = error.span().map(|span| line_of(&line_starts, span.start));
            let place = SourcePosition { file: label.into(), line };
            let message = error.message().trim_end().replace('\n', ", ");
            place.problem(Problem::Syntax { language: "TOML", message })
        })?;
        Ok(Document { label, line_starts, root })
    }

    /// The tables and keys at the top.
    pub fn root(&self) -> Section<'_> {
        Section { document: self, path: String::new(), at: None, table: self.root.get_ref() }
    }

    fn place(&self, offset: usize) -> SourcePosition {
        SourcePosition::line(self.label, line_of(&self.line_starts, offset))
    }
}

fn line_of(line_starts: &[usize], offset: usize) -> usize {
    line_starts.partition_point(|&start| start <= offset).max(1)
}

/// A table of a document; keys are named with the path to it.
pub(super) struct Section<'d> {
    document: &'d Document<'d>,
    path: String,
    /// Byte offset of the table; `None` for the whole file.
    at: Option<usize>,
    table: &'d DeTable<'d>,
}

/// A list of N-tuples of numbers, with the place of each.
pub(super) type Entries<const N: usize> = Vec<([f64; N], SourcePosition)>;

impl<'d> Section<'d> {
    /// Refuses keys other than these.
    pub fn allow(&self, keys: &[&str]) -> Result<(), DatasetError> {
        // The map is ordered by name; the user meets the first in the file first.
        let unknown = self.table.keys().filter(|key| !keys.contains(&key.get_ref().as_ref()));
        let Some(first) = unknown.min_by_key(|key| key.span().start) else { return Ok(()) };
        let name = first.get_ref().to_string();
        let context = match self.path.as_str() {
            "" => String::new(),
            path => format!(" in [{path}]"),
        };
        let choices = Choices::new(&name, keys.iter().copied());
        let problem = Problem::UnknownName { what: "key", name, context, choices };
        Err(self.document.place(first.span().start).problem(problem))
    }

    /// The error of a word under a key that is none of the choices.
    pub fn unknown(
        &self,
        key: &str,
        what: &'static str,
        name: &str,
        choices: &[&str],
    ) -> DatasetError {
        let choices = Choices::new(name, choices.iter().copied());
        let (name, context) = (name.into(), format!(" in {}", self.full(key)));
        self.place_of(key).problem(Problem::UnknownName { what, name, context, choices })
    }

    /// Where the table stands.
    pub fn place(&self) -> SourcePosition {
        match self.at {
            Some(offset) => self.document.place(offset),
            None => SourcePosition::whole(self.document.label),
        }
    }

    /// Where a key's value stands; the table when there is none.
    pub fn place_of(&self, key: &str) -> SourcePosition {
        match self.table.get(key) {
            Some(value) => self.document.place(value.span().start),
            None => self.place(),
        }
    }

    /// A key with the path to it.
    pub fn full(&self, key: &str) -> String {
        if self.path.is_empty() { key.into() } else { format!("{}.{key}", self.path) }
    }

    /// The names of the keys, with their place, in the order of the file.
    pub fn keys(&self) -> Vec<(&'d str, SourcePosition)> {
        let mut keys: Vec<_> = self.table.keys().collect();
        keys.sort_by_key(|key| key.span().start);
        keys.into_iter()
            .map(|key| (key.get_ref().as_ref(), self.document.place(key.span().start)))
            .collect()
    }

    /// The table under a key.
    pub fn table(&self, key: &str) -> Result<Option<Section<'d>>, DatasetError> {
        let Some((name, value)) = self.table.get_key_value(key) else { return Ok(None) };
        let DeValue::Table(table) = value.get_ref() else {
            return Err(self.wrong_type(key, "a table", value));
        };
        // A table's own span may cover the first key only; its name is where the eye looks.
        let at = Some(name.span().start);
        Ok(Some(Section { document: self.document, path: self.full(key), at, table }))
    }

    /// The table under a key that must be there.
    pub fn required_table(&self, key: &str) -> Result<Section<'d>, DatasetError> {
        self.table(key)?.ok_or_else(|| self.missing(key, "a table"))
    }

    /// The tables of an array of tables.
    pub fn tables(&self, key: &str) -> Result<Vec<Section<'d>>, DatasetError> {
        let Some(value) = self.table.get(key) else { return Ok(Vec::new()) };
        let DeValue::Array(items) = value.get_ref() else {
            return Err(self.wrong_type(key, "a list of tables", value));
        };
        let mut tables = Vec::with_capacity(items.len());
        for (index, item) in items.iter().enumerate() {
            let path = format!("{}[{}]", self.full(key), index + 1);
            let DeValue::Table(table) = item.get_ref() else {
                return Err(self.wrong_type(key, "a list of tables", item));
            };
            let at = Some(item.span().start);
            tables.push(Section { document: self.document, path, at, table });
        }
        Ok(tables)
    }

    /// The text under a key.
    pub fn text(&self, key: &str) -> Result<Option<&'d str>, DatasetError> {
        let Some(value) = self.table.get(key) else { return Ok(None) };
        match value.get_ref() {
            DeValue::String(text) => Ok(Some(text)),
            _ => Err(self.wrong_type(key, "a text in quotes", value)),
        }
    }

    /// True where the key is there.
    pub fn has(&self, key: &str) -> bool {
        self.table.contains_key(key)
    }

    /// The truth under a key.
    pub fn truth(&self, key: &str) -> Result<Option<bool>, DatasetError> {
        let Some(value) = self.table.get(key) else { return Ok(None) };
        match value.get_ref() {
            DeValue::Boolean(truth) => Ok(Some(*truth)),
            _ => Err(self.wrong_type(key, "true or false", value)),
        }
    }

    /// The date or time under a key, as TOML writes it, in quotes or without.
    pub fn datetime(&self, key: &str) -> Result<Option<Datetime>, DatasetError> {
        let Some(value) = self.table.get(key) else { return Ok(None) };
        let datetime = match value.get_ref() {
            DeValue::Datetime(datetime) => Some(*datetime),
            DeValue::String(text) => text.trim().parse().ok(),
            _ => None,
        };
        let wrong = || self.wrong_type(key, "a date, as 2026-03-18", value);
        datetime.map(Some).ok_or_else(wrong)
    }

    /// The text under a key that must be there and not be empty.
    pub fn required_text(&self, key: &str, expected: &str) -> Result<&'d str, DatasetError> {
        let text = self.text(key)?.ok_or_else(|| self.missing(key, expected))?;
        if text.trim().is_empty() {
            return Err(self.out_of_range(key, "\"\"", expected));
        }
        Ok(text)
    }

    /// The number under a key, when it satisfies `is_allowed`; `allowed` says so in words.
    pub fn number(
        &self,
        key: &str,
        allowed: &str,
        is_allowed: impl Fn(f64) -> bool,
    ) -> Result<Option<f64>, DatasetError> {
        let Some(value) = self.table.get(key) else { return Ok(None) };
        let number = number(value.get_ref());
        let number = number.ok_or_else(|| self.wrong_type(key, "a number", value))?;
        if !(number.is_finite() && is_allowed(number)) {
            return Err(self.out_of_range(key, &number.to_string(), allowed));
        }
        Ok(Some(number))
    }

    /// The number under a key that must be there.
    pub fn required_number(
        &self,
        key: &str,
        allowed: &str,
        is_allowed: impl Fn(f64) -> bool,
    ) -> Result<f64, DatasetError> {
        self.number(key, allowed, is_allowed)?.ok_or_else(|| self.missing(key, allowed))
    }

    /// The list of N-tuples of finite numbers under a key; `form` shows one entry.
    pub fn entries<const N: usize>(
        &self,
        key: &str,
        form: &str,
    ) -> Result<Option<Entries<N>>, DatasetError> {
        let Some(value) = self.table.get(key) else { return Ok(None) };
        let DeValue::Array(items) = value.get_ref() else {
            return Err(self.wrong_type(key, &format!("a list of {form}"), value));
        };
        let mut entries = Vec::with_capacity(items.len());
        for (index, item) in items.iter().enumerate() {
            let entry = tuple::<N>(item.get_ref()).ok_or_else(|| {
                let place = self.document.place(item.span().start);
                let key = format!("{} entry {}", self.full(key), index + 1);
                let expected = format!("{form}, finite numbers");
                let found = shown(item.get_ref());
                place.problem(Problem::WrongType { key, expected, found })
            })?;
            entries.push((entry, self.document.place(item.span().start)));
        }
        Ok(Some(entries))
    }

    /// The list of [chainage_m, "name"] under a key, empty when absent.
    pub fn named_chainages(&self, key: &str) -> Result<Vec<(f64, String)>, DatasetError> {
        const FORM: &str = "[chainage_m, \"name\"]";
        let Some(value) = self.table.get(key) else { return Ok(Vec::new()) };
        let DeValue::Array(items) = value.get_ref() else {
            return Err(self.wrong_type(key, &format!("a list of {FORM}"), value));
        };
        let entry = |(index, item): (usize, &Spanned<DeValue>)| {
            let pair = match item.get_ref() {
                DeValue::Array(pair) if pair.len() == 2 => {
                    let at_m = number(pair[0].get_ref()).filter(|at_m| at_m.is_finite());
                    at_m.zip(pair[1].get_ref().as_str()).map(|(at_m, name)| (at_m, name.into()))
                }
                _ => None,
            };
            pair.ok_or_else(|| {
                let place = self.document.place(item.span().start);
                let key = format!("{} entry {}", self.full(key), index + 1);
                let (expected, found) = (FORM.into(), shown(item.get_ref()));
                place.problem(Problem::WrongType { key, expected, found })
            })
        };
        items.iter().enumerate().map(entry).collect()
    }

    /// The error of a key that is not there.
    pub fn missing(&self, key: &str, expected: &str) -> DatasetError {
        let (key, expected) = (self.full(key), expected.into());
        self.place().problem(Problem::MissingKey { key, expected })
    }

    /// The error of a value outside its range.
    pub fn out_of_range(&self, key: &str, value: &str, allowed: &str) -> DatasetError {
        let (value, allowed) = (value.into(), allowed.into());
        self.place_of(key).problem(Problem::OutOfRange { key: self.full(key), value, allowed })
    }

    /// The error of two keys that exclude each other.
    pub fn exclusive(&self, key: &str, other: &str) -> DatasetError {
        let (full, other) = (self.full(key), self.full(other));
        self.place_of(key).problem(Problem::Exclusive { key: full, other })
    }

    fn wrong_type(&self, key: &str, expected: &str, found: &Spanned<DeValue>) -> DatasetError {
        let place = self.document.place(found.span().start);
        let (expected, found) = (expected.into(), shown(found.get_ref()));
        place.problem(Problem::WrongType { key: self.full(key), expected, found })
    }
}

fn number(value: &DeValue) -> Option<f64> {
    match value {
        DeValue::Float(float) => float.as_str().parse().ok(),
        DeValue::Integer(integer) if integer.radix() == 10 => integer.as_str().parse().ok(),
        DeValue::Integer(integer) => {
            i64::from_str_radix(integer.as_str(), integer.radix()).ok().map(|number| number as f64)
        }
        _ => None,
    }
}

fn tuple<const N: usize>(value: &DeValue) -> Option<[f64; N]> {
    let DeValue::Array(items) = value else { return None };
    if items.len() != N {
        return None;
    }
    let mut numbers = [0.0; N];
    for (slot, item) in numbers.iter_mut().zip(items.iter()) {
        *slot = number(item.get_ref()).filter(|number| number.is_finite())?;
    }
    Some(numbers)
}

/// A value in few words.
fn shown(value: &DeValue) -> String {
    match value {
        DeValue::String(text) if text.chars().count() <= 40 => format!("the text \"{text}\""),
        DeValue::String(_) => "a long text".into(),
        DeValue::Integer(integer) => integer.to_string(),
        DeValue::Float(float) => float.to_string(),
        DeValue::Boolean(truth) => truth.to_string(),
        DeValue::Datetime(_) => "a date or time".into(),
        DeValue::Array(items) if items.len() <= 4 => {
            let items: Vec<_> = items.iter().map(|item| shown(item.get_ref())).collect();
            format!("[{}]", items.join(", "))
        }
        DeValue::Array(items) => format!("a list of {} items", items.len()),
        DeValue::Table(_) => "a table".into(),
    }
}
