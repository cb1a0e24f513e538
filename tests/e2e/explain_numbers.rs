//! Every number in the source of `explain` is on the page that states its origin.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Greatest number of numbers that decide an answer.
const DECIDING_MAX: usize = 30;

fn sources(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if entry.is_dir() {
            sources(&entry, files);
        } else if entry.extension().is_some_and(|it| it == "rs") {
            files.push(entry);
        }
    }
}

/// The names of the constants of some source that are numbers.
fn numbers(text: &str) -> impl Iterator<Item = &str> {
    let product = text.split("#[cfg(test)]").next().unwrap_or_default();
    product.lines().filter_map(|line| {
        let (_, rest) = line.split_once("const ")?;
        let (name, kind) = rest.split_once(" =")?.0.split_once(": ")?;
        let is_name =
            name.chars().all(|it| it.is_ascii_uppercase() || it.is_ascii_digit() || it == '_');
        let kinds = ["f64", "usize", "u64", "NullScore", "RunScatter", "ErrorScale"];
        let kind = kind.trim_start_matches('[');
        (is_name && kinds.iter().any(|it| kind.starts_with(it))).then_some(name)
    })
}

/// Names in code marks.
fn named(text: &str) -> BTreeSet<&str> {
    let marked = text.split('`').skip(1).step_by(2);
    marked
        .filter(|it| it.chars().all(|c| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_'))
        .collect()
}

#[test]
fn every_number_of_explain_is_on_its_page_and_few_decide() {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let page = std::fs::read_to_string(workspace.join("docs/explain_numbers.md")).unwrap();
    let (deciding, looking) = page.split_once("## How finely it looks").unwrap();
    let (deciding, looking) = (named(deciding), named(looking));
    let mut files = Vec::new();
    sources(&workspace.join("daemon/analysis/src/explain"), &mut files);
    // A report's sizes judge nothing.
    files.retain(|file| !file.components().any(|part| part.as_os_str() == "report"));
    let texts: Vec<String> =
        files.iter().map(|file| std::fs::read_to_string(file).unwrap()).collect();
    let found: BTreeSet<&str> = texts.iter().flat_map(|text| numbers(text)).collect();
    assert!(found.len() > 50, "the sources were found: {found:?}");
    let unlisted: Vec<_> =
        found.iter().filter(|name| !deciding.contains(*name) && !looking.contains(*name)).collect();
    assert!(unlisted.is_empty(), "on no list of docs/explain_numbers.md: {unlisted:?}");
    let gone: Vec<_> = deciding.union(&looking).filter(|name| !found.contains(*name)).collect();
    assert!(gone.is_empty(), "listed, and no longer in the source: {gone:?}");
    let both: Vec<_> = deciding.intersection(&looking).collect();
    assert!(both.is_empty(), "on both lists: {both:?}");
    assert!(deciding.len() <= DECIDING_MAX, "{} numbers decide", deciding.len());
}

#[test]
fn a_number_is_found_in_a_source_and_a_table_of_other_things_is_none() {
    let text = "pub const AT_S: f64 = 1.0;\nconst ALL: [&str; 2] = [];\n    const FEW: [f64; 2] = [0.1, 0.2];\n\
                #[cfg(test)]\nconst LATER: f64 = 2.0;";
    assert_eq!(numbers(text).collect::<Vec<_>>(), ["AT_S", "FEW"]);
}
