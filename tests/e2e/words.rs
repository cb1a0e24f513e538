//! Comments and signatures that read at first sight.

use std::collections::BTreeMap;
use std::path::PathBuf;

use dynocar_tests::sources::{FOLDERS, is_of_tests, rust_files, without_tests, workspace};

/// Words, as parts of a comment in lower case, that a reader would have to decipher.
const RIDDLES: [&str; 6] = ["reckon", "astray", " told", "it is none", "so many", " beside "];
/// Whole words in lower case that stand in the place of a noun.
const PRONOUNS: [&str; 2] = ["what", "whatever"];
/// Comments that may hold such a word: file, part of the comment, and the reason.
const ALLOWED: [(&str, &str, &str); 0] = [];
/// Folders with tests, whose comments are read like those of the sources.
const TEST_FOLDERS: [&str; 5] =
    ["tests/e2e", "tests/simulator", "client/tests", "bench/tests", "client/examples"];

/// Returns the paragraphs of comment lines, each with the number of its first line, from 1 on.
fn paragraphs(text: &str) -> Vec<(usize, String)> {
    let (mut found, mut is_open): (Vec<(usize, String)>, bool) = (Vec::new(), false);
    for (at, line) in text.lines().enumerate() {
        let comment = line.trim_start().strip_prefix("//");
        let words = comment.map(|rest| rest.trim_start_matches(['/', '!']).trim());
        match (words, found.last_mut()) {
            (Some(""), _) | (None, _) => is_open = false,
            (Some(words), Some((_, open))) if is_open => *open += &format!(" {words}"),
            (Some(words), _) => {
                found.push((at + 1, words.to_owned()));
                is_open = true;
            }
        }
    }
    found
}

/// Describes the first fault of a paragraph.
fn fault(paragraph: &str) -> Option<String> {
    let text = paragraph.to_lowercase();
    let mut words = text.split(|it: char| !it.is_alphanumeric());
    if let Some(word) = words.find(|word| PRONOUNS.contains(word)) {
        return Some(format!("holds \"{word}\" in the place of a noun"));
    }
    RIDDLES.iter().find(|word| text.contains(**word)).map(|word| format!("holds \"{word}\""))
}

/// Returns the place after the bracket that closes the round or angular one at `open`.
fn closed(code: &str, open: usize) -> usize {
    let (one, other) = if code[open..].starts_with('<') { ('<', '>') } else { ('(', ')') };
    let (mut depth, mut before) = (0, ' ');
    let end = code[open..].find(|it| {
        depth += i32::from(it == one) - i32::from(it == other && !"-=".contains(before));
        before = it;
        depth == 0
    });
    end.map_or(code.len(), |end| open + end + 1)
}

/// Returns the parameters of each function, and of each closure whose parameters have types.
fn parameters(code: &str) -> impl Iterator<Item = &str> {
    let of_functions = code.match_indices("fn ").filter_map(|(at, _)| {
        let bracket = |from: usize| Some(from + code[from..].find(['(', '<'])?);
        let first = bracket(at)?;
        let is_generic = code[first..].starts_with('<');
        let open = if is_generic { bracket(closed(code, first))? } else { first };
        Some(&code[open + 1..closed(code, open) - 1])
    });
    let is_typed = |it: &&str| it.contains(": ") && !it.contains([';', '\n', '"', '{']);
    of_functions.chain(code.split('|').filter(is_typed))
}

/// Returns the number of elements of the largest tuple in parameters, in their patterns and their types.
fn largest_tuple(parameters: &str) -> usize {
    let opens = parameters.match_indices('(').map(|(open, _)| open);
    let tuples = opens.filter(|open| !parameters[..*open].ends_with(char::is_alphanumeric));
    let elements = tuples.map(|open| {
        let tuple = &parameters[open + 1..closed(parameters, open)];
        let tuple = tuple.trim_end_matches(|it: char| it.is_whitespace() || it == ',' || it == ')');
        let mut depth = 0;
        let commas = tuple.chars().filter(|it| {
            depth += i32::from("([<".contains(*it)) - i32::from(")]>".contains(*it));
            *it == ',' && depth == 0
        });
        1 + commas.count()
    });
    elements.max().unwrap_or(0)
}

/// Verbs: a paragraph below the head of a file that holds one is a sentence, and not a second head.
const VERBS: &str = "is are has have was does do can cannot may must says say holds knows take takes gives keeps hold judge runs come publishes goes lies lie \
                     belongs measures counts shows comes makes follows carries touches panics stays needs differs";
/// Words that begin a clause without a sentence.
const CLAUSES: [&str; 7] = ["How ", "When ", "Where ", "Whether ", "Which ", "Who ", "Why "];

/// Returns the heads of a file beyond its first: comments on the file after code, and later paragraphs that are one
/// clause or one noun with its attributes.
fn further_heads(text: &str) -> Vec<String> {
    let is_of_file = |line: &&str| line.starts_with("//!");
    let is_code = |line: &&str| !line.is_empty() && !is_of_file(line) && !line.starts_with("#![");
    let after_code = text.lines().skip_while(|line| !is_code(line)).filter(is_of_file);
    let head: Vec<&str> = text.lines().take_while(is_of_file).collect();
    let paragraphs = paragraphs(&head.join("\n")).into_iter().skip(1).map(|it| it.1);
    let is_head = |it: &String| {
        let is_one_sentence = it.ends_with('.') && it.matches(". ").count() == 0;
        let has_verb = it.split([' ', ',', ';']).any(|it| VERBS.split(' ').any(|verb| verb == it));
        let is_clause = it.len() < 80 && CLAUSES.iter().any(|clause| it.starts_with(clause));
        is_one_sentence && !it.starts_with(['#', '-']) && (is_clause || !has_verb)
    };
    after_code.map(str::to_owned).chain(paragraphs.filter(is_head)).collect()
}

#[test]
fn a_file_has_one_head() {
    let found = sources().flat_map(|(path, text)| {
        let heads = further_heads(&text).into_iter();
        heads.map(|head| format!("{}: {head}", path.display())).collect::<Vec<_>>()
    });
    let found: Vec<String> = found.collect();
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn a_second_head_is_found() {
    let beside = |second: &str| further_heads(&format!("//! One.\n//!\n//! {second}\n\nuse a;\n"));
    assert_eq!(beside("Channels of a train."), ["Channels of a train."]);
    assert_eq!(beside("Who takes what is read.").len(), 1);
    assert_eq!(beside("A page has no head. It is drawn."), [""; 0]);
    assert_eq!(beside("- [`a`]: channels of a train."), [""; 0]);
    assert_eq!(further_heads("//! One.\n\nuse a;\n//! Two has a verb.\n").len(), 1);
}

fn sources() -> impl Iterator<Item = (PathBuf, String)> {
    let folders = FOLDERS.into_iter().chain(TEST_FOLDERS);
    folders.flat_map(rust_files).filter(|path| !path.ends_with("e2e/words.rs")).map(|path| {
        let text = std::fs::read_to_string(&path).expect("a source file");
        (path.strip_prefix(workspace()).expect("of the workspace").to_owned(), text)
    })
}

#[test]
fn comments_name_each_thing_with_a_noun() {
    let mut found = Vec::new();
    for (path, text) in sources() {
        let path = path.display().to_string();
        let is_allowed = |paragraph: &str| {
            ALLOWED.iter().any(|(file, words, _)| *file == path && paragraph.contains(words))
        };
        for (line, paragraph) in paragraphs(&text).into_iter().filter(|it| !is_allowed(&it.1)) {
            found.extend(fault(&paragraph).map(|it| format!("{path}:{line}: {it}")));
        }
    }
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn three_values_that_go_together_have_a_name() {
    let mut found = Vec::new();
    for (path, text) in sources() {
        let lines = without_tests(&text).into_iter();
        let code: Vec<&str> = lines.filter(|line| !line.trim_start().starts_with("//")).collect();
        for it in parameters(&code.join("\n")).filter(|it| largest_tuple(it) > 2) {
            found.push(format!("{}: {}", path.display(), it.trim()));
        }
    }
    assert!(found.is_empty(), "{found:#?}");
}

/// Words of an answer, each with the one source that holds it.
const WORDINGS: [(&str, &str); 12] = [
    ("from km {", "daemon/model/src/words.rs"),
    ("places between km", "daemon/model/src/words.rs"),
    ("true over declared mass", "daemon/model/src/words.rs"),
    ("speeds read {} % too", "daemon/model/src/words.rs"),
    ("{unit} (95 % interval", "daemon/model/src/words.rs"),
    ("ends known to", "daemon/analysis/src/explain/report/effect.rs"),
    ("chance of as much", "daemon/analysis/src/explain/report/effect.rs"),
    ("kWh per 100 km", "daemon/analysis/src/explain/report/effect.rs"),
    ("Found: the declared model", "daemon/analysis/src/explain/report/effect.rs"),
    ("Nothing undeclared acts", "daemon/analysis/src/explain/report/effect.rs"),
    ("Something undeclared acts", "daemon/analysis/src/explain/report/effect.rs"),
    ("kind.replace(", "none: `kind_name` gives the words of a kind"),
];

#[test]
fn each_part_of_an_answer_is_put_into_words_in_one_place() {
    let python = workspace().join("client/python/dynocar");
    let scripts = [python.clone(), python.join("fleet")].into_iter().flat_map(|folder| {
        let entries = std::fs::read_dir(folder).expect("the Python package").flatten();
        entries.map(|it| it.path()).filter(|it| it.extension().is_some_and(|it| it == "py"))
    });
    let rust = FOLDERS.into_iter().filter(|it| !it.starts_with("tests")).flat_map(rust_files);
    let mut found = Vec::new();
    for path in rust.chain(scripts).filter(|path| !is_of_tests(path)) {
        let text = std::fs::read_to_string(&path).expect("a source file");
        let name = path.strip_prefix(workspace()).expect("of the workspace").display().to_string();
        let lines = without_tests(&text).into_iter();
        let code: Vec<&str> = lines.filter(|line| !line.trim_start().starts_with("//")).collect();
        let code = code.join("\n");
        let here = WORDINGS.iter().filter(|(words, _)| code.contains(words));
        found.extend(here.map(|&(words, place)| (words, place, name.clone())));
    }
    let elsewhere: Vec<_> = found.iter().filter(|(_, place, name)| name != place).collect();
    assert!(elsewhere.is_empty(), "{elsewhere:#?}");
    for (words, place) in WORDINGS.iter().filter(|(_, place)| place.ends_with(".rs")) {
        assert!(found.iter().any(|it| it.0 == *words), "{place} has \"{words}\" no more");
    }
}

/// Returns the name of the public type that a line declares.
fn public_type(line: &str) -> Option<&str> {
    let kinds = ["struct ", "enum ", "trait ", "type "];
    let item = line.trim_start().strip_prefix("pub ")?;
    let name = kinds.iter().find_map(|kind| item.strip_prefix(kind))?;
    name.split(|it: char| !it.is_alphanumeric()).next().filter(|name| !name.is_empty())
}

#[test]
fn a_public_type_has_a_name_of_its_own_in_the_workspace() {
    let mut found = Vec::new();
    let mut names: BTreeMap<String, PathBuf> = BTreeMap::new();
    for path in FOLDERS.into_iter().flat_map(rust_files).filter(|path| !is_of_tests(path)) {
        let text = std::fs::read_to_string(&path).expect("a source file");
        for name in without_tests(&text).into_iter().filter_map(public_type) {
            if let Some(other) = names.insert(name.to_owned(), path.clone()) {
                found.push(format!("{name}: {} and {}", other.display(), path.display()));
            }
        }
    }
    assert!(found.is_empty(), "{found:#?}");
}

/// Returns the sentences of a line of code that hold a name of the code: a literal of four words or more, without its
/// slots.
fn names_in_sentences(line: &str) -> Vec<&str> {
    let literals = line.split('"').skip(1).step_by(2);
    let holds_a_name = |literal: &&str| {
        let outside_slots = literal.split('{').map(|it| it.split_once('}').map_or(it, |it| it.1));
        literal.split_whitespace().count() > 3
            && outside_slots.into_iter().any(|it| it.contains('_'))
    };
    literals.filter(holds_a_name).collect()
}

#[test]
fn sentences_of_an_explanation_hold_no_name_of_the_code() {
    let mut found = Vec::new();
    for path in rust_files("daemon/analysis").into_iter().filter(|it| !is_of_tests(it)) {
        if path.components().any(|it| it.as_os_str() == "explain") {
            let text = std::fs::read_to_string(&path).expect("a source file");
            for line in without_tests(&text) {
                let is_comment = line.trim_start().starts_with("//");
                let names = if is_comment { Vec::new() } else { names_in_sentences(line) };
                found.extend(names.into_iter().map(|it| format!("{}: {it}", path.display())));
            }
        }
    }
    assert!(found.is_empty(), "{found:#?}");
    assert_eq!(names_in_sentences("format!(\"adds nothing given_found {found}\")").len(), 1);
    assert!(names_in_sentences("format!(\"adds nothing beside {found_kinds}, or {}\")").is_empty());
}

#[test]
fn riddles_and_tuples_are_found_wherever_they_stand() {
    assert_eq!(
        paragraphs("/// One\n/// two.\n\n// Three\nlet a;\n"),
        [(1, "One two.".to_owned()), (4, "Three".to_owned())]
    );
    for riddle in [
        "What it does.",
        "Returns what's left.",
        "Stops, whatever comes.",
        "So many m.",
        "Lies beside it.",
    ] {
        assert!(fault(riddle).is_some(), "{riddle}");
    }
    assert!(fault("Returns a somewhat lower speed in m/s.").is_none());
    let largest = |code| parameters(code).map(largest_tuple).max();
    assert_eq!(largest("fn f(a: f64, (b, c, d): (f64, f64, f64)) {"), Some(3));
    assert_eq!(largest("fn f<T: Fn(u8, u8, u8)>(a: &[(f64, Vec<(u8, u8)>, f64, f64)]) {"), Some(4));
    assert_eq!(largest("let f = |at: f64, all: &[(u8, u8, u8)]| 1;"), Some(3));
    assert_eq!(
        largest("fn f(x: u8, (a, mut b): (u8, u8)) {\n    g(|(a, b, c)| (a, b, c))"),
        Some(2)
    );
    assert_eq!(public_type("pub struct Row<'a> {"), Some("Row"));
    assert_eq!(public_type("    pub type Row = [f64; 2];"), Some("Row"));
    assert_eq!(public_type("struct Row;"), None);
}
