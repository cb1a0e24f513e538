//! The promises of the documents are kept: every named test exists, every `unsafe` is counted and justified, every
//! licence is allowed, every dependency of a controller is reviewed.

use std::collections::BTreeMap;
use std::process::Command;

use dynocar_tests::sources::{rust_files, workspace};

fn read(path: &str) -> String {
    std::fs::read_to_string(workspace().join(path))
        .unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// Returns the pairs (file, test) in a document: `` `path/file.rs::name` ``, or a file of Python.
fn named_tests(document: &str) -> Vec<(String, String)> {
    document
        .split('`')
        .skip(1)
        .step_by(2)
        .filter_map(|code| code.split_once("::"))
        .filter(|(file, _)| file.ends_with(".rs") || file.ends_with(".py"))
        .map(|(file, name)| (file.to_owned(), name.to_owned()))
        .collect()
}

#[test]
fn every_test_that_the_promises_name_exists() {
    let named = named_tests(&read("docs/trust.md"));
    assert!(named.len() > 40, "the table is found: {} tests", named.len());
    for (file, name) in named {
        let text = read(&file);
        if file.ends_with(".py") {
            assert!(text.contains(&format!("\ndef {name}(")), "{file}: no {name}");
            assert!(name.starts_with("test_"), "{file}: {name} is no test");
            assert!(!text.contains("skip") && !text.contains("xfail"), "{file}: it is passed over");
            continue;
        }
        let place = text.find(&format!("fn {name}("));
        let place = place.unwrap_or_else(|| panic!("{file}: no {name}"));
        // `#[test]`, or the macro `proptest!`, which lends its functions the same attribute.
        let before = text[..place].trim_end();
        assert!(before.ends_with("#[test]"), "{file}: {name} is no test");
        let is_ignored = text.lines().any(|line| line.trim_start().starts_with("#[ignore"));
        assert!(!is_ignored, "{file}: an ignored test holds nothing");
    }
}

/// Returns the text between backticks that names a Rust file by its path, with the name in it, if any.
fn named_places(document: &str) -> impl Iterator<Item = (&str, Option<&str>)> {
    let codes = document.split('`').skip(1).step_by(2).filter(|code| code.contains('/'));
    codes.filter_map(|code| match code.split_once(".rs::") {
        Some((file, name)) => Some((&code[..file.len() + 3], Some(name))),
        None => code.ends_with(".rs").then_some((code, None)),
    })
}

#[test]
fn every_place_that_the_walks_through_the_source_name_is_there() {
    let defines = |line: &str, name: &str| {
        let mut words = line.split(|it: char| !it.is_alphanumeric() && it != '_');
        let is_kind = |word| matches!(word, "fn" | "const" | "struct" | "trait" | "enum");
        words.by_ref().any(is_kind) && words.next() == Some(name)
    };
    for page in ["docs/walkthrough.md", "ARCHITECTURE.md"] {
        let text = read(page);
        assert!(named_places(&text).count() >= 4, "{page}: the places are found");
        for (file, name) in named_places(&text) {
            let source = read(file);
            let is_there = |name| source.lines().any(|line| defines(line, name));
            assert!(name.is_none_or(is_there), "{page}: {file} has no {name:?}");
        }
    }
}

#[test]
fn the_reading_guide_has_a_line_for_every_member_of_the_vocabularies() {
    use dynocar_shared::{PipelineKind, Quantity, Reason, RejectionReason, Status};
    let guide = read("docs/guides/reading.md");
    let sections: Vec<&str> = guide.split("\n## ").collect();
    let names_in = |title: &str| -> Vec<&str> {
        let is_wanted = |it: &&&str| it.starts_with(title);
        let section = sections.iter().find(is_wanted).unwrap_or_else(|| panic!("no {title}"));
        section
            .lines()
            .filter_map(|line| line.strip_prefix("| `")?.split_once('`'))
            .map(|(name, _)| name)
            .collect()
    };
    fn assert_all(names: &[&str], members: impl Iterator<Item = &'static str>) {
        let members: Vec<&str> = members.collect();
        for name in &members {
            assert!(names.contains(name), "the page has no line for {name}");
        }
        for name in names {
            assert!(members.contains(name), "the page names {name}, which is not there");
        }
    }
    assert_all(&names_in("Every pipeline"), PipelineKind::ALL.iter().map(|it| it.name()));
    assert_all(&names_in("Status"), Status::ALL.iter().map(|it| it.name()));
    assert_all(&names_in("Reason"), Reason::ALL.iter().map(|it| it.name()));
    let refusals = RejectionReason::ALL.iter().map(|it| it.name());
    assert_all(&names_in("Why samples"), refusals);
    for quantity in Quantity::ALL {
        assert!(guide.contains(&format!("\n| `{quantity}` |")), "no line for {quantity}");
    }
}

/// The page, the order in the code and the shipped configuration recommend the same.
#[test]
fn what_the_reading_guide_recommends_is_the_default_and_what_is_shipped() {
    use dynocar_core::pipeline::output::candidates;
    use dynocar_shared::Quantity;
    let guide = read("docs/guides/reading.md");
    let config = read("config/daemon.toml");
    for &quantity in Quantity::ALL {
        let best = candidates(quantity)[0].name();
        let row = guide.lines().find(|line| line.starts_with(&format!("| `{quantity}` |")));
        assert!(row.expect("a row").contains(&format!("| `{best}`")), "{quantity}: {row:?}");
        assert!(guide.contains(&format!("| `{best}` | **recommended** for")), "{best}");
        assert!(config.contains(&format!("kind = \"{best}\"")), "{best} is not in the default");
    }
    let recommended = guide.matches("**recommended**").count();
    assert_eq!(
        recommended, 4,
        "one for each quantity, those of the train and of the brake alike, and the monitor"
    );
}

#[test]
fn every_unsafe_block_is_counted_and_justified() {
    let folders = [
        "shared/src",
        "shared/transport/src",
        "client/src",
        "client/python/src",
        "daemon/src",
        "daemon/workshop/src",
        "daemon/dataset/src",
        "daemon/model/src",
        "daemon/core/src",
        "daemon/estimators/src",
        "daemon/analysis/src",
        "daemon/fmu/src",
    ];
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for file in folders.into_iter().flat_map(rust_files) {
        let text = std::fs::read_to_string(&file).expect("a source file");
        let lines: Vec<&str> = text.lines().collect();
        for (index, line) in lines.iter().enumerate() {
            let code = line.split("//").next().unwrap_or_default();
            if !(code.contains("unsafe {") || code.contains("unsafe impl")) {
                continue;
            }
            let folder = file.parent().and_then(|it| it.strip_prefix(workspace()).ok());
            let folder = folder.expect("a folder of the workspace").display().to_string();
            *counts.entry(folder).or_default() += 1;
            // The comment stands right above the statement that holds the block.
            let above = lines[index.saturating_sub(6)..=index].join("\n");
            let place = file.display();
            assert!(above.contains("// SAFETY:"), "{place}:{}: not justified", index + 1);
        }
    }
    let counted: Vec<(String, usize)> = counts.into_iter().collect();
    let document = read("docs/dependencies.md");
    for (folder, count) in &counted {
        let said = format!("| `{folder}` | {count} |");
        assert!(document.contains(&said), "docs/dependencies.md should say {said:?}");
    }
    let expected = [
        "client/src/ffi",
        "daemon/fmu/src/ffi",
        "daemon/src/runtime",
        "shared/transport/src/channel",
    ];
    assert!(counted.iter().map(|(folder, _)| folder.as_str()).eq(expected), "{counted:?}");
}

/// The platform that this compiler builds for.
fn host() -> String {
    let output = Command::new("rustc").arg("-vV").output().expect("rustc");
    let said = String::from_utf8(output.stdout).expect("UTF-8");
    let line = said.lines().find_map(|line| line.strip_prefix("host: "));
    line.expect("the compiler names its host").to_owned()
}

/// Names, versions and licences of all packages, as `cargo metadata` lists them.
fn packages() -> Vec<(String, String, String)> {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--offline", "--locked", "--format-version", "1"])
        // Packages of other platforms are not fetched by a build.
        .args(["--filter-platform", &host()])
        .current_dir(workspace())
        .output()
        .expect("cargo metadata");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let text = |it: &serde_json::Value| it.as_str().unwrap_or_default().to_owned();
    metadata["packages"]
        .as_array()
        .expect("packages")
        .iter()
        .map(|it| (text(&it["name"]), text(&it["version"]), text(&it["license"])))
        .collect()
}

/// True when a licence expression is met by these licences.
fn is_allowed(expression: &str, allowed: &[String]) -> bool {
    let all = expression.replace(['(', ')'], "").replace('/', " OR ");
    all.split(" AND ")
        .all(|part| part.split(" OR ").any(|licence| allowed.iter().any(|it| it == licence.trim())))
}

#[test]
fn every_dependency_has_a_licence_that_is_allowed() {
    let deny: toml::Table = read("deny.toml").parse().expect("TOML");
    let allowed: Vec<String> = deny["licenses"]["allow"]
        .as_array()
        .expect("a list")
        .iter()
        .filter_map(|it| it.as_str().map(str::to_owned))
        .collect();
    let packages = packages();
    assert!(packages.len() > 100, "the packages are found");
    for (name, version, licence) in &packages {
        assert!(is_allowed(licence, &allowed), "{name} {version}: {licence:?}");
    }
    assert!(!is_allowed("GPL-3.0", &allowed) && !is_allowed("", &allowed));
    assert!(!is_allowed("MIT AND GPL-3.0", &allowed));
}

#[test]
fn every_dependency_of_a_controller_is_reviewed() {
    let document = read("docs/dependencies.md");
    let output = Command::new(env!("CARGO"))
        .args(["tree", "--offline", "--edges", "normal", "--prefix", "none", "--format", "{p}"])
        .args(["--package", "dynocar-client"])
        .current_dir(workspace())
        .output()
        .expect("cargo tree");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let names: Vec<&str> = text.lines().filter_map(|line| line.split(' ').next()).collect();
    assert!(names.len() > 30, "the tree is found");
    for name in names {
        // The transport's own crates are one review.
        let name = if name.starts_with("iceoryx2-") { "iceoryx2" } else { name };
        assert!(document.contains(&format!("`{name}`")), "{name} is not in docs/dependencies.md");
    }
}
