//! YAML as a tree whose every node knows its line. JSON is YAML too, so that both are read alike.

use granit_parser::{Event, Parser, ScalarStyle};

use super::error::ImportError;
use crate::dataset::{Problem, SourcePosition};

/// No format nests deeper; a file that does would cost stack.
const DEPTH_MAX: usize = 64;

/// A value with its place.
#[derive(Debug)]
pub(super) struct Node {
    /// Line, from 1.
    pub line: usize,
    pub content: Content,
}

#[derive(Debug)]
pub(super) enum Content {
    /// A text; plain ones, without quotes, may be numbers.
    Scalar {
        text: String,
        is_plain: bool,
    },
    List(Vec<Node>),
    /// In the order of the file, no key twice.
    Map(Vec<(String, Node)>),
}

/// Reads a file's only document; `label` names the file in messages.
pub(super) fn parse(label: &str, text: &str) -> Result<Node, ImportError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let is_json = text.trim_start().starts_with(['{', '[']);
    // JSON may be indented by tabs, which it allows nowhere else.
    let spaced = if is_json { text.replace('\t', " ") } else { text.into() };
    let language = if is_json { "JSON" } else { "YAML" };
    let mut builder = Builder { label, language, open: Vec::new(), roots: Vec::new() };
    let options = granit_parser::options! { emit_comments: false };
    for next in Parser::new_from_str_with_options(&spaced, options) {
        let (event, span) = next.map_err(|error| {
            builder.wrong(error.marker().line(), error.info().replace('\n', ", "))
        })?;
        builder.feed(event, span.start.line())?;
    }
    let mut roots = std::mem::take(&mut builder.roots).into_iter();
    match (roots.next(), roots.next()) {
        (Some(root), None) => Ok(root),
        (None, _) => Err(builder.wrong(1, "the file is empty".into())),
        (_, Some(second)) => {
            Err(builder.wrong(second.line, "expected one document, found another".into()))
        }
    }
}

/// A list or map that has not ended.
enum Open {
    List { line: usize, items: Vec<Node> },
    Map { line: usize, entries: Vec<(String, Node)>, key: Option<String> },
}

struct Builder<'l> {
    label: &'l str,
    language: &'static str,
    open: Vec<Open>,
    roots: Vec<Node>,
}

impl Builder<'_> {
    fn wrong(&self, line: usize, message: String) -> ImportError {
        let problem = Problem::Syntax { language: self.language, message };
        ImportError::new(SourcePosition::line(self.label, line), problem)
    }

    fn feed(&mut self, event: Event, line: usize) -> Result<(), ImportError> {
        if self.open.len() > DEPTH_MAX {
            return Err(self.wrong(line, format!("expected at most {DEPTH_MAX} levels")));
        }
        match event {
            Event::Scalar(text, style, ..) => {
                let is_plain = style == ScalarStyle::Plain;
                let content = Content::Scalar { text: text.into_owned(), is_plain };
                self.take(Node { line, content })
            }
            Event::SequenceStart(..) => {
                self.open.push(Open::List { line, items: Vec::new() });
                Ok(())
            }
            Event::MappingStart(..) => {
                self.open.push(Open::Map { line, entries: Vec::new(), key: None });
                Ok(())
            }
            Event::SequenceEnd | Event::MappingEnd => self.close(),
            Event::Alias(_) => Err(self.wrong(line, "aliases (*name) are not taken".into())),
            _ => Ok(()),
        }
    }

    fn close(&mut self) -> Result<(), ImportError> {
        let Some(ended) = self.open.pop() else { return Ok(()) };
        let node = match ended {
            Open::List { line, items } => Node { line, content: Content::List(items) },
            Open::Map { line, entries, .. } => {
                let mut names: Vec<(&str, usize)> =
                    entries.iter().map(|(name, value)| (name.as_str(), value.line)).collect();
                names.sort_unstable();
                let twice = names.windows(2).find(|pair| pair[0].0 == pair[1].0);
                if let Some(&[_, (name, line)]) = twice {
                    return Err(self.wrong(line, format!("the key '{name}' stands twice")));
                }
                Node { line, content: Content::Map(entries) }
            }
        };
        self.take(node)
    }

    /// Puts a value where it belongs.
    fn take(&mut self, node: Node) -> Result<(), ImportError> {
        match self.open.last_mut() {
            None => self.roots.push(node),
            Some(Open::List { items, .. }) => items.push(node),
            Some(Open::Map { entries, key, .. }) => match (key.take(), node.content) {
                (Some(name), content) => entries.push((name, Node { line: node.line, content })),
                (None, Content::Scalar { text, .. }) => *key = Some(text),
                (None, _) => {
                    return Err(self.wrong(node.line, "expected a name as key".into()));
                }
            },
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(text: &str) -> String {
        parse("a.yaml", text).unwrap_err().to_string()
    }

    #[test]
    fn yaml_and_json_give_one_tree_with_the_line_of_every_value() {
        for text in [
            "# c\na:\n  - x\n  - 1.5\nb: {c: 'd'}\n",
            "\u{feff}{\n\t\"a\": [\"x\",\n\n\t1.5],\n\t\"b\": {\"c\": \"d\"}}",
        ] {
            let root = parse("a", text).unwrap_or_else(|error| panic!("{error}"));
            let Content::Map(entries) = &root.content else { panic!("{root:?}") };
            let names: Vec<&str> = entries.iter().map(|(name, _)| name.as_str()).collect();
            assert_eq!(names, ["a", "b"]);
            let Content::List(items) = &entries[0].1.content else { panic!("{root:?}") };
            assert_eq!(items[1].line, 4);
            assert!(
                matches!(&items[1].content, Content::Scalar { text, is_plain: true } if text == "1.5")
            );
        }
    }

    #[test]
    fn json_on_one_long_line_is_read_with_its_escapes() {
        let pairs: Vec<String> = (0..2000).map(|it| format!("[{it},{it}]")).collect();
        let pairs = pairs.join(",");
        let text = format!("{{\"a\":{{\"values\":[{pairs}]}},\"b\":\"\\u00e9\\ud83d\\ude83\"}}");
        let root = parse("a", &text).unwrap_or_else(|error| panic!("{error}"));
        let Content::Map(entries) = &root.content else { panic!("{root:?}") };
        assert!(matches!(&entries[1].1.content, Content::Scalar { text, .. } if text == "é🚃"));
    }

    #[test]
    fn what_is_no_single_document_is_refused_with_its_line() {
        assert!(
            refusal("a:\n  - [1, 2\n").starts_with("a.yaml:"),
            "{}",
            refusal("a:\n  - [1, 2\n")
        );
        assert!(refusal("{\n\"a\": 1,\n\"b\": ").contains("not valid JSON"));
        assert_eq!(refusal(""), "a.yaml:1: not valid YAML: the file is empty");
        assert_eq!(
            refusal("a: 1\n---\nb: 2\n"),
            "a.yaml:3: not valid YAML: expected one document, found another"
        );
        assert_eq!(
            refusal("a: 1\nb: 2\na: 3\n"),
            "a.yaml:3: not valid YAML: the key 'a' stands twice"
        );
        assert!(refusal("a: &x 1\nb: *x\n").contains("a.yaml:2: not valid YAML: aliases"));
        assert!(refusal("[1]: 2\n").contains("expected a name as key"));
        assert!(refusal(&"- ".repeat(5000)).contains("levels"), "{}", refusal(&"- ".repeat(200)));
    }
}
