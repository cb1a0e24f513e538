//! Imports between the files of a package form no circles.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use dynocar_tests::sources::{FOLDERS, is_of_tests, rust_files, without_tests, workspace};

/// A module by its path from the crate's root.
type Module = Vec<String>;

/// The source without tests and comments.
fn product(text: &str) -> String {
    let lines = without_tests(text).into_iter();
    lines
        .filter(|line| !line.trim_start().starts_with("//"))
        .flat_map(|line| [line, "\n"])
        .collect()
}

/// The paths of a `use` tree: `a::{b, c::d}` is `a::b` and `a::c::d`.
fn paths(tree: &str) -> Vec<String> {
    let tree = tree.trim();
    let Some((head, rest)) = tree.split_once('{') else {
        return vec![tree.split(" as ").next().unwrap_or(tree).to_owned()];
    };
    let body = rest.rsplit_once('}').map_or(rest, |(body, _)| body);
    let (mut parts, mut depth) = (vec![String::new()], 0);
    for letter in body.chars() {
        depth += i32::from(letter == '{') - i32::from(letter == '}');
        match letter {
            ',' if depth == 0 => parts.push(String::new()),
            _ => parts.last_mut().expect("one part at least").push(letter),
        }
    }
    let parts = parts.iter().filter(|part| !part.trim().is_empty());
    parts.flat_map(|part| paths(part)).map(|path| format!("{}{path}", head.trim())).collect()
}

#[derive(Default)]
struct Package {
    /// Paths that each module takes names by.
    imports: BTreeMap<Module, Vec<Vec<String>>>,
    /// Names that a module hands on, with the path it has them by.
    handed_on: BTreeMap<(Module, String), Vec<String>>,
}

impl Package {
    /// The package of a source folder: its files of Rust alone, as a style or a script may bear a module's name.
    fn read(folder: &str) -> Self {
        let mut package = Package::default();
        let root = workspace().join(folder);
        for path in rust_files(folder) {
            let within = path.strip_prefix(&root).expect("a file of the folder").with_extension("");
            let mut module: Module =
                within.iter().map(|part| part.to_string_lossy().into_owned()).collect();
            let name = module.last().map_or("", String::as_str);
            if is_of_tests(&path) || name == "main" {
                continue;
            }
            if ["mod", "lib"].contains(&name) {
                module.pop();
            }
            package.read_file(&path, module);
        }
        package
    }

    fn read_file(&mut self, path: &Path, module: Module) {
        let text = product(&std::fs::read_to_string(path).expect("a source file"));
        let segments = |path: &str| path.split("::").map(str::to_owned).collect::<Vec<_>>();
        let mut imports = Vec::new();
        for statement in text.split(';') {
            let (code, tree) = statement.rsplit_once("use ").unwrap_or((statement, ""));
            let before = code.rsplit('\n').next().unwrap_or_default().trim();
            let is_handed_on = before.starts_with("pub");
            let is_use = !tree.is_empty() && (is_handed_on || before.is_empty());
            for path in paths(tree).iter().filter(|_| is_use).map(|path| segments(path)) {
                if is_handed_on {
                    if ["crate", "super"].contains(&path[0].as_str()) {
                        imports.push(path.clone());
                    }
                    let name = path.last().cloned().unwrap_or_default();
                    self.handed_on.insert((module.clone(), name), path);
                } else {
                    imports.push(path);
                }
            }
            let inline = if is_use { code } else { statement }.replace("::<", "<");
            let is_of_path = |letter: char| letter.is_alphanumeric() || "_:".contains(letter);
            let words = inline.split(|letter| !is_of_path(letter));
            imports.extend(words.filter(|word| word.contains("::")).map(segments));
        }
        self.imports.insert(module, imports);
    }

    /// The module that a path leads to from another, through the names that are handed on.
    fn resolve(&self, from: &Module, path: &[String], depth: usize) -> Option<Module> {
        let mut module = from.clone();
        let mut rest = path;
        let is_module = |module: &Module, next: &String| {
            self.imports.contains_key(&[module.as_slice(), std::slice::from_ref(next)].concat())
        };
        match rest.first().map(String::as_str) {
            Some("crate") => (module, rest) = (Vec::new(), &rest[1..]),
            Some("self") => rest = &rest[1..],
            Some("super") => {
                while rest.first().is_some_and(|segment| segment == "super") {
                    module.pop();
                    rest = &rest[1..];
                }
            }
            _ if rest.first().is_some_and(|next| is_module(&module, next)) => {}
            _ => return None,
        }
        while let Some(next) = rest.first().filter(|next| is_module(&module, next)) {
            module.push(next.clone());
            rest = &rest[1..];
        }
        let name = rest.first().map(|name| (module.clone(), name.clone()));
        match name.and_then(|name| self.handed_on.get(&name)) {
            Some(path) if depth < 5 => self.resolve(&module, path, depth + 1).or(Some(module)),
            _ => Some(module),
        }
    }

    /// Modules that reach each other, by groups.
    fn circles(&self) -> Vec<BTreeSet<String>> {
        let edges: BTreeMap<&Module, BTreeSet<Module>> = self
            .imports
            .iter()
            .map(|(from, paths)| {
                let to = paths.iter().filter_map(|path| self.resolve(from, path, 0));
                (from, to.filter(|to| to != from).collect())
            })
            .collect();
        let reached: BTreeMap<&Module, BTreeSet<&Module>> = edges
            .keys()
            .map(|&from| {
                let (mut seen, mut open) = (BTreeSet::new(), vec![from]);
                while let Some(module) = open.pop() {
                    for to in edges.get(module).into_iter().flatten() {
                        if seen.insert(to) {
                            open.push(to);
                        }
                    }
                }
                (from, seen)
            })
            .collect();
        let mut circles: Vec<BTreeSet<String>> = reached
            .iter()
            .filter(|(from, seen)| seen.contains(*from))
            .map(|(from, seen)| {
                let back = seen.iter().filter(|to| reached[**to].contains(*from));
                back.map(|module| module.join("::")).collect()
            })
            .collect();
        circles.sort();
        circles.dedup();
        circles
    }
}

#[test]
fn imports_between_files_run_one_way() {
    for folder in FOLDERS {
        let package = Package::read(folder);
        assert!(package.imports.len() > 3, "the sources of {folder} were found");
        let circles = package.circles();
        assert!(circles.is_empty(), "{folder}: circles of imports: {circles:?}");
    }
}

#[test]
fn a_circle_is_found_through_names_that_are_handed_on() {
    let module = |path: &str| path.split("::").map(str::to_owned).collect::<Module>();
    let mut package = Package::default();
    package.imports.insert(Vec::new(), vec![]);
    package
        .imports
        .insert(module("a"), paths("super::{b::Second, c}").iter().map(|p| module(p)).collect());
    package.imports.insert(module("b"), vec![]);
    package.imports.insert(module("b::deep"), vec![module("crate::a::First")]);
    package.imports.insert(module("c"), vec![]);
    assert!(package.circles().is_empty());
    package.handed_on.insert((module("b"), "Second".into()), module("deep::Second"));
    let circle: BTreeSet<String> = ["a".to_owned(), "b::deep".to_owned()].into();
    assert_eq!(package.circles(), [circle]);
}
