//! Every link of the documentation leads somewhere, its program accepts every command that it shows, and no paragraph
//! is too long.

use std::collections::BTreeSet;
use std::path::{Component, Path, PathBuf};
use std::process::Command;

use clap::CommandFactory;
use dynocar_tests::documents::{Page, Shown, pages};
use dynocar_tests::soak::arguments::Arguments;
use dynocar_tests::sources::workspace;

/// Greatest number of words in a paragraph.
const WORDS_MAX: usize = 120;

fn assert_none(wrong: &[String]) {
    assert!(wrong.is_empty(), "{} places:\n{}", wrong.len(), wrong.join("\n"));
}

/// Returns a path without `..` and `.`, by its text alone.
fn plain(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => assert!(plain.pop(), "{} leaves the project", path.display()),
            Component::CurDir => {}
            other => plain.push(other),
        }
    }
    plain
}

#[test]
fn every_link_leads_to_a_file_and_a_heading_in_it() {
    let pages = pages();
    let mut wrong = Vec::new();
    let mut count = 0;
    for page in &pages {
        let folder = page.path.parent().unwrap_or(Path::new(""));
        for link in page.links().into_iter().filter(|it| !it.starts_with("http")) {
            count += 1;
            let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target =
                if file.is_empty() { page.path.clone() } else { plain(&folder.join(file)) };
            let found: Option<&Page> = pages.iter().find(|it| it.path == target);
            let has_anchor = |it: &Page| it.anchors().iter().any(|name| name == anchor);
            if !workspace().join(&target).exists()
                || !anchor.is_empty() && !found.is_some_and(has_anchor)
            {
                wrong.push(format!("{}: {link}", page.path.display()));
            }
        }
    }
    assert!(count > 150, "the links are found: {count}");
    assert_none(&wrong);
}

#[test]
fn the_book_has_a_chapter_for_every_page() {
    let chapters = std::fs::read_to_string(workspace().join(".mkdocs.yml")).unwrap();
    let of_the_book = pages().into_iter().filter(|it| it.path.starts_with("docs"));
    let paths: Vec<String> = of_the_book.map(|it| it.path.display().to_string()).collect();
    assert!(paths.len() > 50, "the pages are found: {}", paths.len());
    let is_missing = |it: &&String| !chapters.contains(&format!(": {it}\n"));
    let missing: Vec<String> = paths.iter().filter(is_missing).cloned().collect();
    assert_none(&missing);
}

/// The command line that takes these words: `dynocar` hands some of its commands to other programs.
fn command_line(words: &[String]) -> (clap::Command, usize) {
    match words.first().map(String::as_str) {
        Some("record" | "flight-recorder" | "keep" | "recover") => {
            (dynocar_recording::cli::command(), 0)
        }
        Some("watch") => (dynocar_watch::cli::command(), 1),
        Some("live") => (dynocar_live::cli::command(), 1),
        Some(word) if dynocar_workshop::cli::commands().find_subcommand(word).is_some() => {
            (dynocar_workshop::cli::commands(), 0)
        }
        _ => (dynocar::cli::commands(), 0),
    }
}

#[test]
fn every_command_that_a_page_shows_is_one_that_dynocar_takes() {
    let shown: Vec<Shown> = pages().iter().flat_map(|page| page.commands("dynocar")).collect();
    assert!(shown.len() > 120, "the commands are found: {}", shown.len());
    let refusals = shown.into_iter().filter_map(|mut it| {
        let (command, taken) = command_line(&it.words);
        it.words.drain(..taken);
        it.refusal(command)
    });
    assert_none(&refusals.collect::<Vec<_>>());
}

#[test]
fn every_soak_that_a_page_shows_is_one_that_this_program_takes() {
    let shown: Vec<Shown> = pages().iter().flat_map(|it| it.commands("dynocar-soak")).collect();
    assert!(shown.len() > 5, "the commands are found: {}", shown.len());
    let refusals = shown.iter().filter_map(|it| it.refusal(Arguments::command()));
    assert_none(&refusals.collect::<Vec<_>>());
}

/// Packages of the workspace, and their programs, tests and benchmarks.
fn targets() -> BTreeSet<(String, String)> {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--offline", "--locked", "--no-deps", "--format-version", "1"])
        .current_dir(workspace())
        .output()
        .expect("cargo metadata");
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let text = |it: &serde_json::Value| it.as_str().unwrap_or_default().to_owned();
    let mut found = BTreeSet::new();
    for package in metadata["packages"].as_array().expect("packages") {
        found.insert(("-p".to_owned(), text(&package["name"])));
        for target in package["targets"].as_array().expect("targets") {
            let kind = text(&target["kind"][0]);
            found.insert((format!("--{kind}"), text(&target["name"])));
        }
    }
    found
}

#[test]
fn every_package_program_and_test_that_a_page_has_cargo_run_is_there() {
    let targets = targets();
    let mut wrong = Vec::new();
    let shown: Vec<Shown> = pages().iter().flat_map(|page| page.commands("cargo")).collect();
    assert!(shown.len() > 20, "the commands are found: {}", shown.len());
    for it in &shown {
        let own = it.words.split(|word| word == "--").next().unwrap_or_default();
        for pair in own
            .windows(2)
            .filter(|pair| ["-p", "--bin", "--test", "--bench"].contains(&pair[0].as_str()))
        {
            // `‹name›` stands for any of them.
            if !pair[1].starts_with('‹') && !targets.contains(&(pair[0].clone(), pair[1].clone()))
            {
                wrong.push(format!("{}: no {}", it.place, pair[1]));
            }
        }
    }
    assert_none(&wrong);
}

#[test]
fn no_paragraph_is_longer_than_a_reader_holds() {
    let mut wrong = Vec::new();
    for page in pages() {
        for text in page.paragraphs() {
            let count = text.split_whitespace().count();
            if count > WORDS_MAX {
                let start: String = text.chars().take(60).collect();
                wrong.push(format!("{}: {count} words:{start} …", page.path.display()));
            }
        }
    }
    assert_none(&wrong);
}
