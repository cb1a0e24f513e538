//! Values of a document, checked against the expectations of their readers.

use std::ops::{Bound, RangeBounds};

use dynocar_model::train::NumberRule;
use dynocar_model::units::Unit;
use toml::value::Datetime;

use super::error::{DatasetError, SourcePosition, unknown};
use super::node::{Node, NodeContent};

/// Returns the names of the tables and keys at the top of a TOML file, in the order of the file.
///
/// # Errors
///
/// When the text is not TOML.
pub fn top_keys(label: &str, text: &str) -> Result<Vec<String>, DatasetError> {
    let root = Node::of_toml(label, text)?;
    Ok(Item::root(label, &root).keys().map(Into::into).collect())
}

/// Returns the range above 0 up to a bound.
pub fn above_zero(most: f64) -> (Bound<f64>, Bound<f64>) {
    (Bound::Excluded(0.0), Bound::Included(most))
}

/// A value with file and path, for messages.
#[derive(Clone, Debug)]
pub struct Item<'t> {
    label: &'t str,
    /// The keys that lead to it, as `vehicles[2].mass`.
    pub path: String,
    node: &'t Node,
}

/// A list of N-tuples of numbers, each with its place.
pub type Entries<'t, const N: usize> = Vec<([f64; N], Item<'t>)>;

/// A value that is not as expected gives an error with file, line, the path to the value and the expectation.
impl<'t> Item<'t> {
    /// Returns a file as a whole.
    pub fn root(label: &'t str, node: &'t Node) -> Self {
        Item { label, path: String::new(), node }
    }

    /// File and line.
    pub fn place(&self) -> SourcePosition {
        SourcePosition { file: self.label.into(), line: self.node.line }
    }

    /// Returns a problem with this value.
    pub fn wrong(&self, words: impl std::fmt::Display) -> DatasetError {
        self.place().problem(words)
    }

    /// Returns the error of a name that may not stand here; the message lists those that may.
    pub fn unknown<T: Into<String>>(
        &self,
        what: &str,
        name: &str,
        names: impl IntoIterator<Item = T>,
    ) -> DatasetError {
        self.wrong(unknown(what, name, &format!(" in {}", self.path), names))
    }

    /// Returns the error of a value outside its range.
    pub fn out_of_range(&self, value: &str, allowed: &str) -> DatasetError {
        self.wrong(format!("{} = {value}: expected {allowed}", self.name()))
    }

    /// Returns the error of a value outside its range under a key of this map, be it there or not.
    pub fn key_out_of_range(&self, key: &str, value: &str, allowed: &str) -> DatasetError {
        self.place_of(key).problem(format!("{} = {value}: expected {allowed}", self.full(key)))
    }

    /// Returns the error of a value of another kind than is expected.
    pub fn wrong_type(&self, expected: &str) -> DatasetError {
        self.wrong(format!("{}: expected {expected}, got {}", self.name(), self.node.shown()))
    }

    /// Returns the error of two keys of this map that exclude each other.
    pub fn exclusive(&self, key: &str, other: &str) -> DatasetError {
        let (full, other) = (self.full(key), self.full(other));
        let words = format!("{full} and {other} exclude each other: give one of them");
        self.place_of(key).problem(words)
    }

    /// Returns a path to a key of this map.
    pub fn full(&self, key: &str) -> String {
        if self.path.is_empty() { key.into() } else { format!("{}.{key}", self.path) }
    }

    fn name(&self) -> &str {
        if self.path.is_empty() { "the file" } else { &self.path }
    }

    fn entries_of_map(&self) -> &'t [(String, Node)] {
        match &self.node.content {
            NodeContent::Map(entries) => entries,
            _ => &[],
        }
    }

    /// Returns the names of this map in the order of the file; none of another value.
    pub fn keys(&self) -> impl Iterator<Item = &'t str> + use<'t> {
        self.entries_of_map().iter().map(|(name, _)| name.as_str())
    }

    /// Refuses keys of this map other than these.
    pub fn allow(&self, keys: &[&str]) -> Result<(), DatasetError> {
        let Some(name) = self.keys().find(|name| !keys.contains(name)) else { return Ok(()) };
        let context = if self.path.is_empty() { "".into() } else { format!(" in [{}]", self.path) };
        Err(self.place_of(name).problem(unknown("key", name, &context, keys.iter().copied())))
    }

    /// Returns true for a key of this map whose value nobody has asked for.
    pub fn is_unread(&self, key: &str) -> bool {
        self.find(key).is_some_and(|item| !item.node.is_read.get())
    }

    fn find(&self, key: &str) -> Option<Item<'t>> {
        let (_, node) = self.entries_of_map().iter().find(|(name, _)| name == key)?;
        Some(Item { label: self.label, path: self.full(key), node })
    }

    /// Returns where a key of this map stands; this map where it has none.
    pub fn place_of(&self, key: &str) -> SourcePosition {
        self.find(key).map_or_else(|| self.place(), |item| item.place())
    }

    /// Returns whether a key of this map has a value, which is not counted as read.
    pub fn has(&self, key: &str) -> bool {
        self.find(key).is_some_and(|item| !item.node.is_null())
    }

    /// Returns the value under a key of this map, unless it is null.
    pub fn get(&self, key: &str) -> Option<Item<'t>> {
        let item = self.find(key)?;
        item.node.is_read.set(true);
        (!item.node.is_null()).then_some(item)
    }

    /// Returns the value under a key that must be there.
    pub fn need(&self, key: &str, expected: &str) -> Result<Item<'t>, DatasetError> {
        if !self.is_map() {
            return Err(self.wrong_type(&format!("keys and values, among them {key}")));
        }
        let missing = || format!("missing key {}: expected {expected}", self.full(key));
        self.get(key).ok_or_else(|| self.wrong(missing()))
    }

    /// Returns the table under a key.
    pub fn table(&self, key: &str) -> Result<Option<Item<'t>>, DatasetError> {
        match self.get(key) {
            Some(other) if !other.is_map() => Err(other.wrong_type("a table")),
            table => Ok(table),
        }
    }

    /// Returns the table under a key that must be there.
    pub fn need_table(&self, key: &str) -> Result<Item<'t>, DatasetError> {
        self.need(key, "a table")?;
        Ok(self.table(key)?.expect("a table that is needed"))
    }

    /// Returns the tables of an array of tables, none where the key is not there.
    pub fn tables(&self, key: &str) -> Result<Vec<Item<'t>>, DatasetError> {
        let Some(list) = self.get(key) else { return Ok(Vec::new()) };
        let tables = list.list("a list of tables", 0)?;
        match tables.iter().find(|item| !item.is_map()) {
            Some(other) => Err(other.wrong_type("a table")),
            None => Ok(tables),
        }
    }

    /// Returns the items of this list, `least` or more.
    pub fn list(&self, expected: &str, least: usize) -> Result<Vec<Item<'t>>, DatasetError> {
        let NodeContent::List(nodes) = &self.node.content else {
            return Err(self.wrong_type(expected));
        };
        if nodes.len() < least {
            let found = format!("a list of {}", nodes.len());
            return Err(self.out_of_range(&found, &format!("at least {least} {expected}")));
        }
        let path = |index: usize| format!("{}[{}]", self.path, index + 1);
        let items = nodes.iter().enumerate();
        Ok(items.map(|(index, node)| Item { path: path(index), node, ..*self }).collect())
    }

    /// Returns the N items of this list.
    pub fn tuple<const N: usize>(&self, form: &str) -> Result<[Item<'t>; N], DatasetError> {
        let items = self.list(form, 0)?;
        let found = format!("a list of {}", items.len());
        items.try_into().map_err(|_| self.out_of_range(&found, form))
    }

    /// Returns true for a list.
    pub fn is_list(&self) -> bool {
        matches!(self.node.content, NodeContent::List(_))
    }

    /// Returns true for a map.
    pub fn is_map(&self) -> bool {
        matches!(self.node.content, NodeContent::Map(_))
    }

    /// Returns this text, or number as it is written.
    pub fn text(&self, expected: &str) -> Result<&'t str, DatasetError> {
        match &self.node.content {
            NodeContent::Text(text) | NodeContent::Plain(text)
                if !self.node.is_null() && !text.trim().is_empty() =>
            {
                Ok(text)
            }
            _ => Err(self.wrong_type(expected)),
        }
    }

    /// Returns the text, or number as it is written, under a key that must be there.
    pub fn need_text(&self, key: &str, expected: &str) -> Result<&'t str, DatasetError> {
        self.need(key, expected)?.text(expected)
    }

    /// Returns the text in quotes under a key.
    pub fn quoted(&self, key: &str) -> Result<Option<&'t str>, DatasetError> {
        let Some(item) = self.get(key) else { return Ok(None) };
        item.as_quoted().map(Some).ok_or_else(|| item.wrong_type("a text in quotes"))
    }

    /// Returns this text, where it stands in quotes.
    pub fn as_quoted(&self) -> Option<&'t str> {
        match &self.node.content {
            NodeContent::Text(text) => Some(text),
            _ => None,
        }
    }

    /// Returns the text in quotes under a key that must be there and not be empty.
    pub fn need_quoted(&self, key: &str, expected: &str) -> Result<&'t str, DatasetError> {
        let item = self.need(key, expected)?;
        match self.quoted(key)?.unwrap_or_default() {
            text if text.trim().is_empty() => Err(item.out_of_range("\"\"", expected)),
            text => Ok(text),
        }
    }

    /// Returns the item named by the word in quotes under a required key: one of these names.
    pub fn need_named<T, N: Into<String>>(
        &self,
        key: &str,
        (what, expected): (&str, &str),
        find: impl Fn(&str) -> Option<T>,
        names: impl IntoIterator<Item = N>,
    ) -> Result<T, DatasetError> {
        let (item, word) = (self.need(key, expected)?, self.need_quoted(key, expected)?);
        find(word).ok_or_else(|| item.unknown(what, word, names))
    }

    /// Returns the same, when the key is there.
    pub fn named_under<T, N: Into<String>>(
        &self,
        key: &str,
        words: (&str, &str),
        find: impl Fn(&str) -> Option<T>,
        names: impl IntoIterator<Item = N>,
    ) -> Result<Option<T>, DatasetError> {
        self.has(key).then(|| self.need_named(key, words, find, names)).transpose()
    }

    /// Returns the truth under a key.
    pub fn truth(&self, key: &str) -> Result<Option<bool>, DatasetError> {
        let Some(item) = self.get(key) else { return Ok(None) };
        match &item.node.content {
            NodeContent::Plain(text) if text == "true" || text == "false" => {
                Ok(Some(text == "true"))
            }
            _ => Err(item.wrong_type("true or false")),
        }
    }

    /// Returns the date or time under a key, as TOML writes it, in quotes or without.
    pub fn datetime(&self, key: &str) -> Result<Option<Datetime>, DatasetError> {
        let Some(item) = self.get(key) else { return Ok(None) };
        let datetime = match &item.node.content {
            NodeContent::Text(text) | NodeContent::Plain(text) => text.trim().parse().ok(),
            _ => None,
        };
        datetime.map(Some).ok_or_else(|| item.wrong_type("a date, as 2026-03-18"))
    }

    /// Returns this number, when it satisfies `is_allowed`; `allowed` says so in words.
    pub fn checked(
        &self,
        allowed: &str,
        is_allowed: impl Fn(f64) -> bool,
    ) -> Result<f64, DatasetError> {
        let number = self.node.number().ok_or_else(|| self.wrong_type(allowed))?;
        if !(number.is_finite() && is_allowed(number)) {
            return Err(self.out_of_range(&number.to_string(), allowed));
        }
        Ok(number)
    }

    /// Returns a number that stands here, when its rule allows it.
    pub fn within(&self, number: f64, rule: &NumberRule) -> Result<f64, DatasetError> {
        let refused = || self.out_of_range(&number.to_string(), rule.allowed);
        Some(number).filter(|it| it.is_finite() && rule.allows(*it)).ok_or_else(refused)
    }

    /// Returns this number, within a range.
    pub fn number(&self, allowed: &str, range: impl RangeBounds<f64>) -> Result<f64, DatasetError> {
        self.checked(allowed, |number| range.contains(&number))
    }

    /// Returns this number of a unit, in the base unit, within a range in that.
    pub fn in_unit(
        &self,
        unit: &Unit,
        allowed: &str,
        range: impl RangeBounds<f64>,
    ) -> Result<f64, DatasetError> {
        let number = self.checked(allowed, |number| range.contains(&unit.to_base(number)))?;
        Ok(unit.to_base(number))
    }

    /// Returns the number under a key, when there is one and it satisfies `is_allowed`.
    pub fn checked_under(
        &self,
        key: &str,
        allowed: &str,
        is_allowed: impl Fn(f64) -> bool,
    ) -> Result<Option<f64>, DatasetError> {
        self.get(key).map(|item| item.checked(allowed, is_allowed)).transpose()
    }

    /// Returns the number under a key, when there is one.
    pub fn optional(
        &self,
        key: &str,
        allowed: &str,
        range: impl RangeBounds<f64>,
    ) -> Result<Option<f64>, DatasetError> {
        self.get(key).map(|item| item.number(allowed, range)).transpose()
    }

    /// Returns the number under a key that must be there.
    pub fn required(
        &self,
        key: &str,
        allowed: &str,
        range: impl RangeBounds<f64>,
    ) -> Result<f64, DatasetError> {
        self.need(key, allowed)?.number(allowed, range)
    }

    /// Returns the entries of the list under a key, each as `read` takes it; `form` shows one.
    pub fn entries_as<T>(
        &self,
        key: &str,
        form: &str,
        read: impl Fn(&[Item<'t>]) -> Option<T>,
    ) -> Result<Option<Vec<(T, Item<'t>)>>, DatasetError> {
        let Some(list) = self.get(key) else { return Ok(None) };
        let entry = |(index, item): (usize, Item<'t>)| {
            let entry = item.list("", 0).ok().and_then(|items| read(&items));
            let item = Item { path: format!("{} entry {}", list.path, index + 1), ..item };
            let entry = entry.ok_or_else(|| item.wrong_type(form))?;
            Ok((entry, item))
        };
        let items = list.list(&format!("a list of {form}"), 0)?;
        items.into_iter().enumerate().map(entry).collect::<Result<_, _>>().map(Some)
    }

    /// Returns the list of N-tuples of finite numbers under a key; `form` shows one entry.
    pub fn entries<const N: usize>(
        &self,
        key: &str,
        form: &str,
    ) -> Result<Option<Entries<'t, N>>, DatasetError> {
        self.entries_as(key, &format!("{form}, finite numbers"), |items| {
            let numbers = items.iter().map(|item| item.node.number().filter(|it| it.is_finite()));
            numbers.collect::<Option<Vec<f64>>>()?.try_into().ok()
        })
    }
}
