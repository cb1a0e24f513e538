//! YAML as a tree in which every node knows its line. JSON is YAML too, so that both are read in the same way.

use granit_parser::{Event, Parser, ScalarStyle};

use crate::dataset::node::{Node, NodeContent};
use crate::dataset::{DatasetError, SourcePosition};

/// Greatest depth of nesting: no format is deeper, and a file that is would use up the stack.
const DEPTH_MAX: usize = 64;

/// Reads a file's only document; `label` names the file in messages.
pub(super) fn parse(label: &str, text: &str) -> Result<Node, DatasetError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let is_json = text.trim_start().starts_with(['{', '[']);
    // JSON may be indented by tabs, which it allows nowhere else.
    let spaced = if is_json { text.replace('\t', " ") } else { text.into() };
    let language = if is_json { "JSON" } else { "YAML" };
    let wrong = |line: usize, message: String| {
        SourcePosition::line(label, line).problem(format!("not valid {language}: {message}"))
    };
    let options = granit_parser::options! { emit_comments: false };
    let events = Parser::new_from_str_with_options(&spaced, options).map(|next| {
        let (event, span) =
            next.map_err(|error| wrong(error.marker().line(), error.info().replace('\n', ", ")))?;
        Ok((event, span.start.line()))
    });
    let mut reader = Reader { events, wrong: &wrong };
    let mut roots = Vec::new();
    while let Some(next) = reader.events.next() {
        roots.extend(reader.node(next?, 0)?);
    }
    let mut roots = roots.into_iter();
    match (roots.next(), roots.next()) {
        (Some(root), None) => Ok(root),
        (None, _) => Err(wrong(1, "the file is empty".into())),
        (_, Some(second)) => {
            Err(wrong(second.line.unwrap_or(1), "expected one document, found another".into()))
        }
    }
}

/// Makes a tree of a parser's events, each with its line.
struct Reader<'w, I> {
    events: I,
    wrong: &'w dyn Fn(usize, String) -> DatasetError,
}

impl<'e, I: Iterator<Item = Result<(Event<'e>, usize), DatasetError>>> Reader<'_, I> {
    fn next(&mut self, depth: usize) -> Result<Option<Node>, DatasetError> {
        self.events.next().map_or(Ok(None), |event| self.node(event?, depth))
    }

    /// Parses the value that begins with an event, within a number of others; `None` where no value begins.
    fn node(
        &mut self,
        (event, line): (Event<'e>, usize),
        depth: usize,
    ) -> Result<Option<Node>, DatasetError> {
        if depth > DEPTH_MAX {
            return Err((self.wrong)(line, format!("expected at most {DEPTH_MAX} levels")));
        }
        let content = match event {
            Event::Scalar(text, ScalarStyle::Plain, ..) => NodeContent::Plain(text.into_owned()),
            Event::Scalar(text, ..) => NodeContent::Text(text.into_owned()),
            Event::SequenceStart(..) => {
                let mut items = Vec::new();
                while let Some(item) = self.next(depth + 1)? {
                    items.push(item);
                }
                NodeContent::List(items)
            }
            Event::MappingStart(..) => NodeContent::Map(self.entries(depth + 1)?),
            Event::Alias(_) => {
                return Err((self.wrong)(line, "aliases (*name) are not taken".into()));
            }
            _ => return Ok(None),
        };
        Ok(Some(Node::new(Some(line), content)))
    }

    fn entries(&mut self, depth: usize) -> Result<Vec<(String, Node)>, DatasetError> {
        let mut entries = Vec::new();
        while let Some(key) = self.next(depth)? {
            let (NodeContent::Text(text) | NodeContent::Plain(text)) = key.content else {
                return Err((self.wrong)(key.line.unwrap_or(1), "expected a name as key".into()));
            };
            entries.extend(self.next(depth)?.map(|value| (text, value)));
        }
        let mut names: Vec<(&str, usize)> =
            entries.iter().map(|(name, value)| (name.as_str(), value.line.unwrap_or(1))).collect();
        names.sort_unstable();
        if let Some(&[_, (name, line)]) = names.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            return Err((self.wrong)(line, format!("the key '{name}' stands twice")));
        }
        Ok(entries)
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
            let NodeContent::Map(entries) = &root.content else { panic!("{root:?}") };
            let names: Vec<&str> = entries.iter().map(|(name, _)| name.as_str()).collect();
            assert_eq!(names, ["a", "b"]);
            let NodeContent::List(items) = &entries[0].1.content else { panic!("{root:?}") };
            assert_eq!(items[1].line, Some(4));
            assert!(matches!(&items[1].content, NodeContent::Plain(text) if text == "1.5"));
        }
    }

    #[test]
    fn json_on_one_long_line_is_read_with_its_escapes() {
        let pairs: Vec<String> = (0..2000).map(|it| format!("[{it},{it}]")).collect();
        let pairs = pairs.join(",");
        let text = format!("{{\"a\":{{\"values\":[{pairs}]}},\"b\":\"\\u00e9\\ud83d\\ude83\"}}");
        let root = parse("a", &text).unwrap_or_else(|error| panic!("{error}"));
        let NodeContent::Map(entries) = &root.content else { panic!("{root:?}") };
        assert!(matches!(&entries[1].1.content, NodeContent::Text(text) if text == "é🚃"));
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
