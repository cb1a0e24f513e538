//! Comments and signatures that read at first sight.

use std::collections::BTreeMap;
use std::path::PathBuf;

use dynocar_tests::sources::{FOLDERS, is_of_tests, rust_files, without_tests, workspace};

/// Words, as parts of a comment in lower case, that a reader would have to decipher.
const RIDDLES: [&str; 5] = ["reckon", "astray", " told", "it is none", "so many"];
/// Folders with tests, whose comments are read like those of the sources.
const TEST_FOLDERS: [&str; 5] =
    ["tests/e2e", "tests/simulator", "client/tests", "bench/tests", "client/examples"];

/// A paragraph of comment lines with its first line's number, from 1 on.
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

/// Describes the faults of a paragraph.
fn fault(paragraph: &str) -> Option<String> {
    if paragraph.starts_with("What ") {
        return Some("begins with a clause in the place of a noun or a verb".into());
    }
    let text = paragraph.to_lowercase();
    RIDDLES.iter().find(|word| text.contains(**word)).map(|word| format!("holds \"{word}\""))
}

/// Returns the number of values of a parameter that is a tuple pattern, such as `(a, b, c): (f64, f64, f64)`.
fn tuple_parameter(line: &str) -> Option<usize> {
    let (pattern, _) = line.split_once("): ")?;
    let names = pattern.rsplit_once('(')?.1;
    let is_name = |name: &str| name.chars().all(|it| it.is_ascii_lowercase() || it == '_');
    let names: Vec<&str> = names.split(", ").map(|it| it.trim_start_matches("mut ")).collect();
    let is_code = !line.contains("let ") && !line.trim_start().starts_with("//");
    let is_parameter = is_code && names.iter().all(|name| is_name(name));
    is_parameter.then_some(names.len())
}

fn sources() -> impl Iterator<Item = (PathBuf, String)> {
    let folders = FOLDERS.into_iter().chain(TEST_FOLDERS);
    folders.flat_map(rust_files).filter(|path| !path.ends_with("e2e/words.rs")).map(|path| {
        let text = std::fs::read_to_string(&path).expect("a source file");
        (path.strip_prefix(workspace()).expect("of the workspace").to_owned(), text)
    })
}

#[test]
fn comments_say_what_they_mean_with_a_noun_or_a_verb() {
    let mut found = Vec::new();
    for (path, text) in sources() {
        for (line, paragraph) in paragraphs(&text) {
            found.extend(fault(&paragraph).map(|it| format!("{}:{line}: {it}", path.display())));
        }
    }
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn three_values_that_go_together_have_a_name() {
    let mut found = Vec::new();
    for (path, text) in sources() {
        for line in without_tests(&text) {
            if tuple_parameter(line).is_some_and(|count| count > 2) {
                found.push(format!("{}: {}", path.display(), line.trim()));
            }
        }
    }
    assert!(found.is_empty(), "{found:#?}");
}

/// Returns the name of the public type that a line declares.
fn public_type(line: &str) -> Option<&str> {
    let kinds = ["struct ", "enum ", "trait ", "type "];
    let item = line.trim_start().strip_prefix("pub ")?;
    let name = kinds.iter().find_map(|kind| item.strip_prefix(kind))?;
    name.split(|it: char| !it.is_alphanumeric()).next()
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

#[test]
fn riddles_and_tuples_are_found_wherever_they_stand() {
    assert_eq!(
        paragraphs("/// One\n/// two.\n\n// Three\nlet a;\n"),
        [(1, "One two.".to_owned()), (4, "Three".to_owned())]
    );
    assert!(fault("What it does.").is_some() && fault("Values beyond so many m.").is_some());
    assert!(fault("Returns the speed in m/s.").is_none());
    assert_eq!(tuple_parameter("    (a, b, c): (f64, f64, f64),"), Some(3));
    assert_eq!(tuple_parameter("fn f(x: u8, (a, mut b): (u8, u8)) {"), Some(2));
    assert_eq!(public_type("pub struct Row<'a> {"), Some("Row"));
    assert_eq!(public_type("    pub type Row = [f64; 2];"), Some("Row"));
    assert_eq!(public_type("struct Row;"), None);
    assert_eq!(tuple_parameter("    let (a, b, c): (u8, u8, u8) = f();"), None);
}
