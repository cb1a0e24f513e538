//! The page of troubles has a line for each message that names no remedy, and no line for other messages.

use std::collections::BTreeMap;

use dynocar_tests::sources::workspace;

/// Folders of the sources that raise messages.
const FOLDERS: [&str; 18] = [
    "daemon/src",
    "daemon/workshop/src",
    "daemon/model/src",
    "daemon/core/src",
    "daemon/estimators/src",
    "daemon/dataset/src",
    "daemon/analysis/src",
    "daemon/fmu/src",
    "shared/src",
    "shared/transport/src",
    "client/src",
    "client/python/dynocar/fleet",
    "client/python/src",
    "daemon/mcap/src",
    "daemon/recording/src",
    "daemon/parquet/src",
    "daemon/watch/src",
    "daemon/live/src",
];
/// A call whose first literal is a message, and the folder in which it is one.
const CALLS: [(&str, &str); 17] = [
    ("#[error(", ""),
    (".problem(", "daemon"),
    ("wrong(", "daemon"),
    ("let words = format!(", "daemon/dataset/src"),
    ("let text = format!(", "daemon/dataset/src"),
    ("let words = format!(", "daemon/analysis/src/import"),
    ("Failure::Input(", "daemon/src/cli"),
    ("Failure::Work(", "daemon/src/cli"),
    ("Failure::Input(", "daemon/workshop/src/cli"),
    ("Failure::Work(", "daemon/workshop/src/cli"),
    ("Failure::Work(", "daemon/recording/src/cli"),
    ("Error::new_err(", "client/python/src"),
    ("InputError(", "client/python/dynocar/fleet"),
    ("WorkError(", "client/python/dynocar/fleet"),
    ("warn!(", "daemon/src"),
    ("error!(", "daemon/src"),
    ("OutputError::Name {", "daemon/src"),
];
/// Whole files whose sentences are messages: of impossible data and declarations, of stops.
const SENTENCES: [&str; 3] = [
    "daemon/core/src/plausibility/input_fault.rs",
    "daemon/dataset/src/dataset_diagnostic.rs",
    "shared/src/stopping.rs",
];
/// Messages that name the remedy themselves, as the page would show them.
const PLAIN: &str = include_str!("plain_messages.txt");
/// Stands for the variable parts of a message.
const GAP: char = '\0';

/// A file of source: its code, each literal of text as a lone `"`, and those literals in order.
struct Source {
    path: String,
    code: String,
    literals: Vec<String>,
}

fn sources_in(folder: &str, sources: &mut Vec<Source>) {
    let root = workspace();
    for entry in std::fs::read_dir(root.join(folder)).expect("a source folder") {
        let path = entry.expect("a folder entry").path();
        let name = path.strip_prefix(&root).expect("of the workspace").display().to_string();
        if path.is_dir() && !name.ends_with("/tests") {
            sources_in(&name, sources);
        } else if name.ends_with(".py") || name.ends_with(".rs") && !name.ends_with("tests.rs") {
            let text = std::fs::read_to_string(&path).expect("a source file");
            sources.push(Source::of(name, &text));
        }
    }
}

impl Source {
    fn of(path: String, text: &str) -> Self {
        let mut source = Source { path, code: String::new(), literals: Vec::new() };
        let mut rest = text;
        while let Some(first) = rest.chars().next() {
            let length = if rest.starts_with("//") {
                rest.find('\n').unwrap_or(rest.len())
            } else if rest.starts_with("/*") {
                rest.find("*/").map_or(rest.len(), |end| end + 2)
            } else if first == '"' {
                source.take_literal(rest)
            } else if first == '\'' {
                let after = rest[1..].chars().next().map_or(1, |it| 1 + it.len_utf8());
                match rest[1..].starts_with('\\') {
                    true => 3 + rest[3..].find('\'').expect("a character's end") + 1,
                    // Else it is a lifetime.
                    false => {
                        if rest[after..].starts_with('\'') {
                            after + 1
                        } else {
                            1
                        }
                    }
                }
            } else {
                source.code.push(first);
                first.len_utf8()
            };
            rest = &rest[length..];
        }
        source.drop_tests();
        source
    }

    /// Takes the literal at the start of a text up; gives its length there.
    fn take_literal(&mut self, text: &str) -> usize {
        let marks = self.code.len() - self.code.trim_end_matches('#').len();
        let is_raw = self.code[..self.code.len() - marks].ends_with('r');
        self.code.push('"');
        if is_raw {
            let end = format!("\"{}", "#".repeat(marks));
            let length = text[1..].find(&end).expect("a raw literal's end");
            self.literals.push(text[1..1 + length].to_owned());
            return 1 + length + end.len();
        }
        let mut literal = String::new();
        let mut chars = text.char_indices().skip(1).peekable();
        while let Some((at, char)) = chars.next() {
            match char {
                '"' => {
                    self.literals.push(literal);
                    return at + 1;
                }
                '\\' => match chars.next().expect("an escape").1 {
                    '\n' => while chars.next_if(|(_, it)| it.is_whitespace()).is_some() {},
                    'n' | 't' => literal.push(' '),
                    other => literal.push(other),
                },
                other => literal.push(other),
            }
        }
        panic!("{}: a literal without an end", self.path)
    }

    /// Removes the messages that only tests hold.
    fn drop_tests(&mut self) {
        while let Some(start) = self.code.find("#[cfg(test)]") {
            let item = start + self.code[start..].find(['{', ';']).expect("an item") + 1;
            let end = if self.code[..item].ends_with('{') { self.end_of(item) } else { item };
            let first = self.literals_before(start);
            self.literals.drain(first..self.literals_before(end));
            self.code.replace_range(start..end, "");
        }
    }

    /// Where the bracket closes that opens just before an index, and one further.
    fn end_of(&self, index: usize) -> usize {
        let mut depth = 1;
        for (at, char) in self.code[index..].char_indices() {
            depth += match char {
                '(' | '[' | '{' => 1,
                ')' | ']' | '}' => -1,
                _ => 0,
            };
            if depth == 0 {
                return index + at + 1;
            }
        }
        panic!("{}: a bracket without its end", self.path)
    }

    fn literals_before(&self, index: usize) -> usize {
        self.code[..index].matches('"').count()
    }

    /// The constant texts of the file by their names.
    fn constants(&self) -> impl Iterator<Item = (&str, &str)> {
        self.code.match_indices("const ").filter_map(|(at, word)| {
            let (name, value) = self.code[at + word.len()..].split_once(": &str =")?;
            let is_text = value.trim_start().starts_with('"') && !name.contains([';', '{']);
            is_text.then(|| (name, self.literals[self.literals_before(at)].as_str()))
        })
    }

    /// The messages that a call raises.
    fn messages(&self, call: &str) -> Vec<&str> {
        let mut found = Vec::new();
        for (at, _) in self.code.match_indices(call) {
            let start = at + call.len();
            let inside = self.code[start..self.end_of(start)].trim_start();
            let name = inside.split(|it: char| !it.is_alphanumeric() && it != '_').next();
            let constant = self.constants().find(|(it, _)| Some(*it) == name);
            let is_macro = call.ends_with("!(") || call.ends_with('{');
            let begins = ["\"", "format!(\"", "f\""].iter().any(|it| flat(inside).starts_with(it));
            match constant {
                Some((_, text)) => found.push(text),
                None if begins || is_macro && inside.contains('"') => {
                    found.push(&self.literals[self.literals_before(start)]);
                }
                None => {}
            }
        }
        found
    }
}

fn flat(code: &str) -> String {
    code.split_whitespace().collect()
}

/// A message's fixed words: spaces folded, each run of placeholders as one gap, without the name of a file in front and
/// the variable end.
fn fixed_words(message: &str) -> String {
    let mut words = message.split_whitespace().collect::<Vec<_>>().join(" ");
    while words.contains("\0\0") {
        words = words.replace("\0\0", "\0");
    }
    let words = words.strip_prefix("\0: ").unwrap_or(&words);
    words.trim_end_matches([GAP, ' ']).to_owned()
}

/// A literal of the source with its placeholders as gaps and its constants in full.
fn of_literal(literal: &str, constants: &BTreeMap<&str, &str>) -> String {
    let mut message = String::new();
    let mut rest = literal;
    while let Some(at) = rest.find(['{', '}']) {
        message += &rest[..at];
        let (is_doubled, bracket) = (rest[at + 1..].starts_with(&rest[at..=at]), &rest[at..=at]);
        let end = rest[at..].find('}').map_or(rest.len(), |length| at + length);
        match (is_doubled, constants.get(&rest[at + 1..end.max(at + 1)])) {
            (true, _) => message += bracket,
            (false, Some(text)) => message += text,
            (false, None) => message.push(GAP),
        }
        rest = &rest[if is_doubled { at + 2 } else { (end + 1).min(rest.len()) }..];
    }
    fixed_words(&(message + rest))
}

/// The messages in the first column of the page's tables, with their variable parts as `‹…›`.
fn on_page(page: &str) -> Vec<String> {
    let mut found = Vec::new();
    for row in page.lines().filter_map(|line| line.strip_prefix("| ")) {
        let row = row.replace("\\|", "\u{1}");
        let cell = row.split(" | ").next().unwrap_or_default().replace('\u{1}', "|");
        let mut rest = cell.as_str();
        while let Some(start) = rest.find('`') {
            let marks = rest[start..].len() - rest[start..].trim_start_matches('`').len();
            let (inside, fence) = (&rest[start + marks..], "`".repeat(marks));
            let end = inside.find(&fence).unwrap_or_else(|| panic!("an open code: {cell}"));
            let mut message = String::new();
            for (index, part) in inside[..end].split(['‹', '›']).enumerate() {
                if index % 2 == 0 { message += part } else { message.push(GAP) }
            }
            found.push(fixed_words(&message));
            rest = &inside[end + marks..];
        }
    }
    found
}

fn words_in(message: &str) -> usize {
    let is_word = |word: &&str| word.chars().any(char::is_alphabetic);
    message.split([' ', GAP]).filter(is_word).count()
}

/// A message of which the page shows the beginning shows this many words at least.
const BEGINNING_MIN: usize = 6;

/// Whether an entry of the page is a message: all of it, or its beginning before a mark of omission.
fn says(entry: &str, message: &str) -> bool {
    match entry.strip_suffix(" …") {
        Some(start) => words_in(start) >= BEGINNING_MIN && message.starts_with(start),
        None => entry == message,
    }
}

/// Every message with its file, and the fixed words of every literal.
fn raised(sources: &[Source]) -> (Vec<(&str, String)>, Vec<String>) {
    let everywhere: BTreeMap<&str, &str> = sources.iter().flat_map(Source::constants).collect();
    let (mut messages, mut literals) = (Vec::new(), Vec::new());
    for source in sources {
        let mut constants = everywhere.clone();
        constants.extend(source.constants());
        let in_words = |literal: &str| of_literal(literal, &constants);
        literals.extend(source.literals.iter().map(|literal| in_words(literal)));
        for (call, _) in CALLS.iter().filter(|(_, folder)| source.path.starts_with(folder)) {
            let own = source.messages(call).into_iter().map(in_words);
            messages.extend(own.filter(|it| words_in(it) > 0).map(|it| (source.path.as_str(), it)));
        }
        let codes = source.code.find("codes! {").map_or(0..0, |at| {
            let end = source.end_of(at + "codes! {".len());
            source.literals_before(at)..source.literals_before(end)
        });
        let of_file =
            if SENTENCES.contains(&source.path.as_str()) { &source.literals[..] } else { &[] };
        let sentences = of_file.iter().filter(|literal| words_in(&in_words(literal)) > 2);
        let others = source.literals[codes].iter().chain(sentences);
        messages.extend(others.map(|literal| (source.path.as_str(), in_words(literal))));
    }
    (messages, literals)
}

#[test]
fn each_message_that_does_not_say_what_to_do_has_its_line_on_the_page_of_troubles() {
    let mut sources = Vec::new();
    for folder in FOLDERS {
        sources_in(folder, &mut sources);
    }
    let page = std::fs::read_to_string(workspace().join("docs/troubles.md")).expect("the page");
    let plain = PLAIN.lines().map(|entry| format!("| {entry} | |\n"));
    let on_page = on_page(&(page + &plain.collect::<String>()));
    let (messages, literals) = raised(&sources);
    assert!(messages.len() > 200, "the messages are found: {}", messages.len());
    let mut wrong: Vec<String> = Vec::new();
    let is_missing = |message: &String| !on_page.iter().any(|entry| says(entry, message));
    for (path, message) in messages.iter().filter(|(_, message)| is_missing(message)) {
        wrong.push(format!("{path}: no line for {:?}", message.replace(GAP, "‹…›")));
    }
    let is_said = |entry: &String| literals.iter().any(|literal| says(entry, literal));
    for entry in on_page.iter().filter(|entry| !is_said(entry)) {
        wrong.push(format!(
            "docs/troubles.md or plain_messages.txt: nothing says {:?}",
            entry.replace(GAP, "‹…›")
        ));
    }
    assert!(wrong.is_empty(), "{} lines:\n{}", wrong.len(), wrong.join("\n"));
}
