//! Keys and values that people and programs write, as a tree in which every value knows its line. TOML is read here;
//! other languages make the same tree.

use std::cell::Cell;

use toml::de::{DeTable, DeValue};

use super::error::{DatasetError, SourcePosition};

/// A value with its place.
#[derive(Debug)]
pub struct Node {
    /// Line, from 1; `None` for a file as a whole.
    pub line: Option<usize>,
    /// Content of the value.
    pub content: NodeContent,
    /// True once somebody has asked for it.
    pub(super) is_read: Cell<bool>,
}

/// Content of a value.
#[derive(Debug)]
pub enum NodeContent {
    /// A text in quotes.
    Text(String),
    /// Unquoted text, as it is written: a number, a date, a word of YAML.
    Plain(String),
    /// Values, one after the other.
    List(Vec<Node>),
    /// Keys and values in the order of the file, no key twice.
    Map(Vec<(String, Node)>),
}

impl Node {
    /// Returns a value that nobody has asked for yet.
    pub fn new(line: Option<usize>, content: NodeContent) -> Self {
        Node { line, content, is_read: Cell::new(false) }
    }

    /// Reads TOML; a byte-order mark is skipped.
    ///
    /// # Errors
    ///
    /// When the text is not TOML, with the line.
    pub fn of_toml(label: &str, text: &str) -> Result<Self, DatasetError> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let starts: Vec<usize> =
            std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect();
        let line = |offset: usize| starts.partition_point(|&start| start <= offset).max(1);
        let root = DeTable::parse(text).map_err(|error| {
            let line = error.span().map(|span| line(span.start));
            let message = error.message().trim_end().replace('\n', ", ");
            let place = SourcePosition { file: label.into(), line };
            place.problem(format!("not valid TOML: {message}"))
        })?;
        Ok(Node::new(None, map_of(root.get_ref(), &line)))
    }

    pub(super) fn is_null(&self) -> bool {
        let NodeContent::Plain(text) = &self.content else { return false };
        matches!(text.as_str(), "" | "~" | "null" | "Null" | "NULL")
    }

    /// Returns this number, be it finite or not; `None` for anything else.
    pub(super) fn number(&self) -> Option<f64> {
        let NodeContent::Plain(text) = &self.content else { return None };
        match text.trim_start_matches(['+', '-']) {
            // As YAML, TOML, and programs that write invalid JSON write them.
            ".nan" | ".NaN" | ".NAN" => Some(f64::NAN),
            ".inf" | ".Inf" | ".INF" => Some(f64::INFINITY),
            "nan" | "NaN" | "inf" | "Infinity" => text.parse().ok(),
            digits if digits.starts_with(|it: char| it.is_ascii_digit() || it == '.') => {
                text.parse().ok()
            }
            _ => None,
        }
    }

    /// Returns a value in few words.
    pub(super) fn shown(&self) -> String {
        match &self.content {
            NodeContent::Plain(_) if self.is_null() => "nothing".into(),
            NodeContent::Text(text) | NodeContent::Plain(text) if text.chars().count() > 40 => {
                "a long text".into()
            }
            NodeContent::Text(text) => format!("the text \"{text}\""),
            NodeContent::Plain(text)
                if self.number().is_some() || matches!(&text[..], "true" | "false") =>
            {
                text.clone()
            }
            NodeContent::Plain(word) => format!("'{word}'"),
            NodeContent::List(items) if items.len() <= 4 => {
                let items: Vec<String> = items.iter().map(Node::shown).collect();
                format!("[{}]", items.join(", "))
            }
            NodeContent::List(items) => format!("a list of {} items", items.len()),
            NodeContent::Map(_) => "keys and values".into(),
        }
    }
}

/// The order of a parsed table is that of the names; a user meets the first in the file first.
fn map_of(table: &DeTable, line: &dyn Fn(usize) -> usize) -> NodeContent {
    let mut entries: Vec<_> = table.iter().collect();
    entries.sort_by_key(|(key, _)| key.span().start);
    // A table's own span may cover the first key only; its name is where the eye looks.
    let entry = |(key, value): (&toml::Spanned<_>, &toml::Spanned<DeValue>)| {
        let name: &std::borrow::Cow<str> = key.get_ref();
        (name.to_string(), node_of(value.get_ref(), key.span().start, line))
    };
    NodeContent::Map(entries.into_iter().map(entry).collect())
}

fn node_of(value: &DeValue, at: usize, line: &dyn Fn(usize) -> usize) -> Node {
    let content = match value {
        DeValue::String(text) => NodeContent::Text(text.to_string()),
        DeValue::Integer(integer) => {
            let decimal = i64::from_str_radix(integer.as_str(), integer.radix());
            NodeContent::Plain(decimal.map_or_else(|_| integer.to_string(), |it| it.to_string()))
        }
        DeValue::Float(float) => NodeContent::Plain(float.as_str().into()),
        DeValue::Boolean(truth) => NodeContent::Plain(truth.to_string()),
        DeValue::Datetime(datetime) => NodeContent::Plain(datetime.to_string()),
        DeValue::Array(items) => {
            let item = |it: &toml::Spanned<DeValue>| node_of(it.get_ref(), it.span().start, line);
            NodeContent::List(items.iter().map(item).collect())
        }
        DeValue::Table(table) => map_of(table, line),
    };
    Node::new(Some(line(at)), content)
}
