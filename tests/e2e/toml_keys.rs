//! The keys of `train.toml`, `track.toml` and `dataset.toml` are written only in the table of keys.

use dynocar_analysis::dataset::keys;
use dynocar_tests::sources::{FOLDERS, is_of_tests, rust_files, without_tests, workspace};

/// Files that hold the table: the keys, the numbers of a train, and the lists of a line next to their laws.
const TABLE: [&str; 4] = [
    "daemon/dataset/src/keys.rs",
    "daemon/model/src/terms/gradient.rs",
    "daemon/model/src/track/mod.rs",
    "daemon/model/src/train/numbers.rs",
];

/// Files in which the same word is not a key of these files, with its meaning there.
const OTHERS: [(&str, &str); 11] = [
    ("daemon/analysis/src/explain/", "a parameter of the answer, or advice in it"),
    ("daemon/core/src/plausibility/input_fault.rs", "a fault"),
    ("daemon/dataset/src/position_faults.rs", "a figure of a note"),
    ("daemon/model/src/terms/", "a parameter of the answer"),
    ("daemon/model/src/words.rs", "a parameter of the answer"),
    ("daemon/src/config/apart.rs", "a key of daemon.toml"),
    ("daemon/src/text_file.rs", "advice that is a constant"),
    ("daemon/workshop/src/cli/", "an argument, a result or daemon.toml"),
    ("shared/src/stopping.rs", "an argument"),
    ("shared/src/vocabulary.rs", "a parameter of a snapshot"),
    ("shared/src/vocabulary/effects.rs", "an effect"),
];

/// Returns the texts in quotes in a line of source.
fn texts(line: &str) -> Vec<String> {
    let (mut texts, mut open, mut letters) = (Vec::new(), None::<String>, line.chars());
    while let Some(letter) = letters.next() {
        match (&mut open, letter) {
            (Some(text), '\\') => {
                text.extend(letters.next().map(|it| if it == 'n' { '\n' } else { it }));
            }
            (Some(_), '"') => texts.extend(open.take()),
            (Some(text), letter) => text.push(letter),
            (None, '"') => open = Some(String::new()),
            (None, _) => {}
        }
    }
    texts
}

/// True for a text that is a key of several words, or assigns a value to a key.
fn spells_key(text: &str, names: &[&str]) -> bool {
    let assigns = |name: &str| {
        text.match_indices(&format!("{name} = ")).any(|(at, _)| {
            !text[..at].ends_with(|before: char| before.is_alphanumeric() || before == '_')
        })
    };
    names.iter().any(|name| *name == text && name.contains('_') || assigns(name))
}

#[test]
fn no_source_spells_a_key_beside_the_table() {
    let names: Vec<&str> = keys::all().map(|key| key.name).collect();
    let folders = FOLDERS.iter().filter(|it| !it.starts_with("bench") && !it.starts_with("tests"));
    let mut found = Vec::new();
    for path in folders.flat_map(|folder| rust_files(folder)) {
        let source = std::fs::read_to_string(&path).expect("a source");
        let name = path.strip_prefix(workspace()).expect("a file of the workspace");
        let name = name.to_string_lossy();
        if is_of_tests(&path)
            || name.contains("/tests/")
            || TABLE.contains(&&*name)
            || OTHERS.iter().any(|(other, _)| name.starts_with(other))
        {
            continue;
        }
        let lines = without_tests(&source).into_iter();
        for line in lines.filter(|line| !line.trim_start().starts_with("//")) {
            let spelled = texts(line).into_iter().filter(|text| spells_key(text, &names));
            found.extend(spelled.map(|text| format!("{name}: {text:?}")));
        }
    }
    assert!(found.is_empty(), "keys beside {}: {found:#?}", TABLE[0]);
}

#[test]
fn a_key_is_found_as_a_word_and_in_an_assignment() {
    let names = ["mass_t", "unit", "role"];
    let spells = |line: &str| texts(line).iter().any(|text| spells_key(text, &names));
    assert!(spells(r#"section.need("mass_t", "a mass")"#));
    assert!(spells(r#"text += "\nrole = \"fit\"";"#));
    assert!(!spells(r#"let unit = "the unit of mass_t"; // "mass_t"#));
    assert!(!spells(r#"format!("a_role = {}", 1)"#));
}

#[test]
fn what_is_excepted_is_there_and_spells_a_key() {
    let names: Vec<&str> = keys::all().map(|key| key.name).collect();
    for (name, what) in OTHERS {
        let path = workspace().join(name);
        let files = if path.is_dir() { rust_files(name) } else { vec![path] };
        let spells = |path: &std::path::PathBuf| {
            let source = std::fs::read_to_string(path).expect("a source");
            source.lines().flat_map(texts).any(|text| spells_key(&text, &names))
        };
        assert!(files.iter().any(spells), "{name} holds no {what} any more");
    }
}
