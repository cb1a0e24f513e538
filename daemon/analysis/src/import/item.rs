//! A value of a file with the way to it, and what may be expected of it.

use std::ops::{Bound, RangeBounds};

use dynocar_model::units::Unit;

use super::error::{ImportError, ImportProblem};
use super::tree::{Content, Node};
use crate::dataset::{Choices, Problem, SourcePosition};

/// Above 0, up to a bound.
pub(super) fn above_zero(most: f64) -> (Bound<f64>, Bound<f64>) {
    (Bound::Excluded(0.0), Bound::Included(most))
}

/// A value with file and path, for messages.
#[derive(Clone, Debug)]
pub(super) struct Item<'t> {
    label: &'t str,
    /// The keys that lead to it, as `vehicles[2].mass`.
    pub path: String,
    node: &'t Node,
}

impl<'t> Item<'t> {
    pub fn root(label: &'t str, node: &'t Node) -> Self {
        Item { label, path: String::new(), node }
    }

    /// File and line.
    pub fn place(&self) -> SourcePosition {
        SourcePosition::line(self.label, self.node.line)
    }

    /// A problem with this value.
    pub fn wrong(&self, problem: impl Into<ImportProblem>) -> ImportError {
        ImportError::new(self.place(), problem)
    }

    /// The error of a name that is none of those which can stand here.
    pub fn unknown<T: Into<String>>(
        &self,
        what: &'static str,
        name: &str,
        names: impl IntoIterator<Item = T>,
    ) -> ImportError {
        let (choices, context) = (Choices::new(name, names), format!(" in {}", self.path));
        self.wrong(Problem::UnknownName { what, name: name.into(), context, choices })
    }

    /// A path to a key of this map.
    pub fn full(&self, key: &str) -> String {
        if self.path.is_empty() { key.into() } else { format!("{}.{key}", self.path) }
    }

    fn entries(&self) -> &'t [(String, Node)] {
        match &self.node.content {
            Content::Map(entries) => entries,
            _ => &[],
        }
    }

    /// The names of this map; none of another value.
    pub fn keys(&self) -> impl Iterator<Item = &'t str> + use<'t> {
        self.entries().iter().map(|(name, _)| name.as_str())
    }

    /// True for a key of this map whose value nobody has asked for.
    pub fn is_unread(&self, key: &str) -> bool {
        self.find(key).is_some_and(|item| !item.node.is_read.get())
    }

    fn find(&self, key: &str) -> Option<Item<'t>> {
        let (_, node) = self.entries().iter().find(|(name, _)| name == key)?;
        Some(Item { label: self.label, path: self.full(key), node })
    }

    /// True where a key of this map has a value, which is not counted as read.
    pub fn has(&self, key: &str) -> bool {
        self.find(key).is_some_and(|item| !item.is_null())
    }

    /// The value under a key of this map, unless it is null.
    pub fn get(&self, key: &str) -> Option<Item<'t>> {
        let item = self.find(key)?;
        item.node.is_read.set(true);
        (!item.is_null()).then_some(item)
    }

    /// The value under a key that must be there.
    pub fn need(&self, key: &str, expected: &str) -> Result<Item<'t>, ImportError> {
        if !matches!(self.node.content, Content::Map(_)) {
            return Err(self.wrong_type(&format!("keys and values, among them {key}")));
        }
        self.get(key).ok_or_else(|| {
            let (key, expected) = (self.full(key), expected.into());
            self.wrong(Problem::MissingKey { key, expected })
        })
    }

    /// The items of this list, `least` or more.
    pub fn list(&self, expected: &str, least: usize) -> Result<Vec<Item<'t>>, ImportError> {
        let Content::List(nodes) = &self.node.content else {
            return Err(self.wrong_type(expected));
        };
        if nodes.len() < least {
            let found = format!("a list of {}", nodes.len());
            return Err(self.out_of_range(&found, &format!("at least {least} {expected}")));
        }
        let item = |(index, node): (usize, &'t Node)| Item {
            label: self.label,
            path: format!("{}[{}]", self.path, index + 1),
            node,
        };
        Ok(nodes.iter().enumerate().map(item).collect())
    }

    /// The N items of this list.
    pub fn tuple<const N: usize>(&self, form: &str) -> Result<[Item<'t>; N], ImportError> {
        let items = self.list(form, 0)?;
        let found = format!("a list of {}", items.len());
        items.try_into().map_err(|_| self.out_of_range(&found, form))
    }

    /// True for a list.
    pub fn is_list(&self) -> bool {
        matches!(self.node.content, Content::List(_))
    }

    /// True for a map.
    pub fn is_map(&self) -> bool {
        matches!(self.node.content, Content::Map(_))
    }

    /// This text, or number as it is written.
    pub fn text(&self, expected: &str) -> Result<&'t str, ImportError> {
        match &self.node.content {
            Content::Scalar { text, .. } if !self.is_null() && !text.trim().is_empty() => Ok(text),
            _ => Err(self.wrong_type(expected)),
        }
    }

    /// The text under a key that must be there.
    pub fn need_text(&self, key: &str, expected: &str) -> Result<&'t str, ImportError> {
        self.need(key, expected)?.text(expected)
    }

    /// This number, when it satisfies `is_allowed`; `allowed` says so in words.
    pub fn checked(
        &self,
        allowed: &str,
        is_allowed: impl Fn(f64) -> bool,
    ) -> Result<f64, ImportError> {
        let number = self.as_number().ok_or_else(|| self.wrong_type(allowed))?;
        if !(number.is_finite() && is_allowed(number)) {
            return Err(self.out_of_range(&number.to_string(), allowed));
        }
        Ok(number)
    }

    /// This number, within a range.
    pub fn number(&self, allowed: &str, range: impl RangeBounds<f64>) -> Result<f64, ImportError> {
        self.checked(allowed, |number| range.contains(&number))
    }

    /// This number of a unit, in the base unit, within a range in that.
    pub fn in_unit(
        &self,
        unit: &Unit,
        allowed: &str,
        range: impl RangeBounds<f64>,
    ) -> Result<f64, ImportError> {
        let number = self.checked(allowed, |number| range.contains(&unit.to_base(number)))?;
        Ok(unit.to_base(number))
    }

    /// This number, be it finite or not; `None` for anything else.
    fn as_number(&self) -> Option<f64> {
        let Content::Scalar { text, is_plain: true } = &self.node.content else { return None };
        match text.trim_start_matches(['+', '-']) {
            // As YAML, and as programs write JSON that is none.
            ".nan" | ".NaN" | ".NAN" | "NaN" => Some(f64::NAN),
            ".inf" | ".Inf" | ".INF" | "Infinity" => Some(f64::INFINITY),
            digits if digits.starts_with(|it: char| it.is_ascii_digit() || it == '.') => {
                text.parse().ok()
            }
            _ => None,
        }
    }

    /// The number under a key, when there is one.
    pub fn optional(
        &self,
        key: &str,
        allowed: &str,
        range: impl RangeBounds<f64>,
    ) -> Result<Option<f64>, ImportError> {
        self.get(key).map(|item| item.number(allowed, range)).transpose()
    }

    /// The number under a key that must be there.
    pub fn required(
        &self,
        key: &str,
        allowed: &str,
        range: impl RangeBounds<f64>,
    ) -> Result<f64, ImportError> {
        self.need(key, allowed)?.number(allowed, range)
    }

    /// The error of a value outside its range.
    pub fn out_of_range(&self, value: &str, allowed: &str) -> ImportError {
        let (key, value, allowed) = (self.name(), value.into(), allowed.into());
        self.wrong(Problem::OutOfRange { key, value, allowed })
    }

    fn wrong_type(&self, expected: &str) -> ImportError {
        let found = match &self.node.content {
            Content::Scalar { .. } if self.is_null() => "nothing".into(),
            Content::Scalar { text, .. } if text.chars().count() > 40 => "a long text".into(),
            Content::Scalar { text, .. } => format!("'{text}'"),
            Content::List(items) => format!("a list of {}", items.len()),
            Content::Map(_) => "keys and values".into(),
        };
        self.wrong(Problem::WrongType { key: self.name(), expected: expected.into(), found })
    }

    fn name(&self) -> String {
        if self.path.is_empty() { "the file".into() } else { self.path.clone() }
    }

    fn is_null(&self) -> bool {
        match &self.node.content {
            Content::Scalar { text, is_plain: true } => {
                matches!(text.as_str(), "" | "~" | "null" | "Null" | "NULL")
            }
            _ => false,
        }
    }
}
