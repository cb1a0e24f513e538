//! Functions and files that are short enough to read, and files that are long enough to be worth opening.

use dynocar_tests::sources::{
    FOLDERS, is_of_tests, item_lines, rust_files, without_tests, workspace,
};

/// Greatest number of lines of a function, with its head and the comments within it.
const FUNCTION_LINES_MAX: usize = 70;
/// Greatest number of lines of a file, with its tests.
const FILE_LINES_MAX: usize = 400;
/// Least number of lines of a file.
const FILE_LINES_MIN: usize = 40;
/// Folders whose files may be shorter: each holds one physical law.
const LAWS: &str = "daemon/model/src/terms";
/// Names of the files at the heads of crates, modules and programs of tests, which may be shorter; so may the programs
/// under test.
const HEADS: [&str; 6] = ["mod", "lib", "main", "serving", "offline", "hot_path"];

/// Returns the name of the function that a line begins.
fn function_name(line: &str) -> Option<&str> {
    const BEFORE: [&str; 6] = ["pub", "const", "async", "unsafe", "extern", "\"C\""];
    let is_before = |word: &&str| BEFORE.contains(word) || word.starts_with("pub(");
    let mut words = line.split_whitespace().skip_while(is_before);
    words.next().filter(|word| *word == "fn")?;
    words.next()?.split(['(', '<']).next()
}

/// Returns the functions of a source that are longer than allowed, with their lengths.
fn long_functions(text: &str) -> Vec<(&str, usize)> {
    let lines = without_tests(text);
    let lengths = lines.iter().enumerate().filter_map(|(at, line)| {
        let length = item_lines(&lines[at..]);
        Some((function_name(line)?, length)).filter(|_| length > FUNCTION_LINES_MAX)
    });
    lengths.collect()
}

#[test]
fn functions_and_files_are_short_enough_to_be_read_at_once() {
    let mut found = Vec::new();
    for path in FOLDERS.into_iter().flat_map(rust_files) {
        let text = std::fs::read_to_string(&path).expect("a source file");
        let name = path.strip_prefix(workspace()).expect("of the workspace").display();
        let lines = text.lines().count();
        if lines > FILE_LINES_MAX {
            found.push(format!("{name}: {lines} lines"));
        }
        let long = if is_of_tests(&path) { Vec::new() } else { long_functions(&text) };
        found.extend(
            long.iter().map(|(function, lines)| format!("{name}: {function}: {lines} lines")),
        );
    }
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn no_file_holds_less_than_a_subject() {
    let mut found = Vec::new();
    for path in ["shared", "client", "daemon", "bench", "tests"].into_iter().flat_map(rust_files) {
        let lines = std::fs::read_to_string(&path).expect("a source file").lines().count();
        let name = path.strip_prefix(workspace()).expect("of the workspace");
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let is_head = HEADS.contains(&&*stem) || stem.ends_with("_under_test");
        if lines < FILE_LINES_MIN && !is_head && !name.starts_with(LAWS) {
            found.push(format!("{}: {lines} lines", name.display()));
        }
    }
    assert!(found.is_empty(), "merge into the file of their subject: {found:#?}");
}

#[test]
fn a_long_function_is_found_wherever_it_stands() {
    let body = |lines: usize| "        let _ = 1;\n".repeat(lines);
    let source = |lines: usize| {
        format!(
            "impl A {{\n    pub(crate) const fn long<T>(\n        self,\n    ) {{\n{}    }}\n}}\n",
            body(lines)
        )
    };
    assert_eq!(long_functions(&source(66)), []);
    assert_eq!(long_functions(&source(67)), [("long", 71)]);
    let in_tests =
        format!("#[cfg(test)]\nmod tests {{\n    fn long() {{\n{}    }}\n}}\n", body(80));
    assert_eq!(long_functions(&in_tests), []);
    assert_eq!(long_functions("fn one() {}\nstruct A;\n"), []);
}
