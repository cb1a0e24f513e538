//! No test and no example stands where it is never run: no test in a target whose tests are switched off, no code in
//! the doc comments of a target whose doctests are switched off.

use std::path::{Path, PathBuf};

use dynocar_tests::sources::{rust_files, workspace};

/// Returns the sources of a program: its file, and the files next to a `main.rs` that has its own folder.
fn program_sources(package: &str, file: &str) -> Vec<PathBuf> {
    match file.strip_suffix("/main.rs") {
        Some(folder) if folder != "src" => rust_files(&format!("{package}/{folder}")),
        _ => vec![workspace().join(package).join(file)],
    }
}

/// Returns the first line with a test or with a code block in a doc comment, if the target does not run such; a block
/// marked `text` is not code.
fn unrun(text: &str, (has_tests, has_code): (bool, bool)) -> Option<&str> {
    let mut is_open = false;
    text.lines().find(|line| {
        let line = line.trim_start();
        let page = line.strip_prefix("///").or(line.strip_prefix("//!")).map(str::trim_start);
        let Some(fence) = page.and_then(|it| it.strip_prefix("```")) else {
            return !has_tests && (line.starts_with("#[test]") || line.starts_with("proptest!"));
        };
        is_open = !is_open;
        is_open && !has_code && fence != "text"
    })
}

/// Returns whether a target's tests and the code on its pages are run.
fn runs(target: &toml::Value) -> (bool, bool) {
    let is_run = |key| target.get(key).and_then(toml::Value::as_bool).unwrap_or(true);
    (is_run("test"), is_run("doctest"))
}

#[test]
fn what_is_not_run_holds_no_test_and_no_code_on_its_pages() {
    let parsed = |path: PathBuf| {
        let text = std::fs::read_to_string(path).expect("a manifest");
        text.parse::<toml::Table>().expect("a manifest")
    };
    let members = &parsed(workspace().join("Cargo.toml"))["workspace"]["members"];
    let (mut unrun_targets, mut found) = (0, Vec::new());
    for package in members.as_array().expect("packages").iter().filter_map(toml::Value::as_str) {
        let manifest = parsed(workspace().join(package).join("Cargo.toml"));
        let mut targets = Vec::new();
        if let Some(it) = manifest.get("lib") {
            let mut sources = rust_files(&format!("{package}/src"));
            sources.retain(|it| !it.iter().any(|part| part == "bin" || part == "main.rs"));
            targets.push((runs(it), sources));
        }
        for it in manifest.get("bin").and_then(toml::Value::as_array).into_iter().flatten() {
            let file = it["path"].as_str().expect("a program's file");
            targets.push(((runs(it).0, true), program_sources(package, file)));
        }
        for (runs, sources) in targets {
            unrun_targets += usize::from(runs != (true, true));
            for path in sources {
                let text = std::fs::read_to_string(&path).expect("a source");
                let line = unrun(&text, runs);
                found.extend(line.map(|it| format!("{}: {it}", name(&path))));
            }
        }
    }
    assert!(unrun_targets > 20, "the targets are found: {unrun_targets}");
    assert!(found.is_empty(), "never run: {found:#?}");
}

fn name(path: &Path) -> String {
    path.strip_prefix(workspace()).expect("of the workspace").display().to_string()
}

#[test]
fn tests_and_code_that_would_not_run_are_found() {
    let test = "mod tests {\n    #[test]\n    fn one() {}\n}\n";
    assert_eq!(unrun(test, (false, true)), Some("    #[test]"));
    assert_eq!(unrun(test, (true, false)), None);
    let page = |language: &str| {
        format!("//! ```text\n//! a\n//! ```\n/// ```{language}\n/// b\n/// ```\n")
    };
    assert_eq!(unrun(&page(""), (true, false)), Some("/// ```"));
    assert_eq!(unrun(&page("no_run"), (true, false)), Some("/// ```no_run"));
    assert_eq!(unrun(&page("text"), (true, false)), None);
    assert_eq!(unrun(&page(""), (false, true)), None);
}
