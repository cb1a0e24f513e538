//! `dynocar.h` is clean C and C++, and the libraries hold the functions that it declares; its constants and structs
//! are generated from the library (`bindings.rs`), and the compiler checks the offset of each field.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::process::Command;

use crate::support::{self, Link, client_directory, compiler, library_directory, must_succeed};

fn header_text() -> String {
    std::fs::read_to_string(client_directory().join("include/dynocar.h")).unwrap()
}

/// The words of the header, comments left out.
fn header_words() -> Vec<String> {
    let text = header_text();
    let mut code = String::new();
    for (index, part) in text.split("/*").enumerate() {
        code += if index == 0 { part } else { part.split_once("*/").unwrap().1 };
    }
    let is_word = |letter: char| letter.is_ascii_alphanumeric() || letter == '_';
    // A word keeps the character after it, so that functions and enumerators can be distinguished.
    let mut words = Vec::new();
    let mut rest = code.as_str();
    while let Some(start) = rest.find(is_word) {
        rest = &rest[start..];
        let end = rest.find(|letter| !is_word(letter)).unwrap_or(rest.len());
        let next = rest[end..].trim_start().chars().next().unwrap_or(' ');
        words.push(format!("{}{next}", &rest[..end]));
        rest = &rest[end..];
    }
    words
}

fn header_functions() -> BTreeSet<String> {
    let inline = inline_functions();
    header_words()
        .iter()
        .filter_map(|word| word.strip_suffix('('))
        .filter(|name| name.starts_with("dynocar_") && !inline.contains(*name))
        .map(str::to_owned)
        .collect()
}

/// The helpers that the header itself holds: `static inline`, a type, a name.
fn inline_functions() -> BTreeSet<String> {
    let text = header_text();
    let name = |part: &str| Some(part.split_once('(')?.0.rsplit([' ', '*']).next()?.to_owned());
    text.split("static inline ").skip(1).filter_map(name).collect()
}

#[test]
fn the_header_is_clean_c99_c11_c17_and_cpp17() {
    let directory = tempfile::tempdir().unwrap();
    let source = directory.path().join("include.c");
    std::fs::write(&source, "#include \"dynocar.h\"\n#include \"dynocar.h\"\n").unwrap();
    for standard in ["c99", "c11", "c17"] {
        must_succeed(compiler("CC", "cc", standard).arg("-fsyntax-only").arg(&source));
    }
    let mut command = support::cpp_compiler("c++17");
    must_succeed(command.args(["-fsyntax-only", "-x", "c++"]).arg(&source));
}

#[test]
fn the_wrapper_is_clean_cpp17_and_cpp20_also_without_exceptions_and_in_two_parts_of_a_program() {
    let directory = tempfile::tempdir().unwrap();
    let part = |name: &str, text: &str| {
        let source = directory.path().join(name);
        std::fs::write(&source, format!("#include \"dynocar.hpp\"\n{text}")).unwrap();
        source
    };
    let parts = [
        part(
            "main.cpp",
            "#include \"dynocar.hpp\"\nint other();\nint main() { return other(); }\n",
        ),
        part("other.cpp", "int other();\nint other() { return dynocar::daemon_state(1).state; }\n"),
    ];
    for standard in ["c++17", "c++20"] {
        for options in [&[][..], &["-fno-exceptions", "-fno-rtti"]] {
            let mut command = support::cpp_compiler(standard);
            command.args(["-Wshadow", "-Weffc++"]).args(options).args(&parts).arg("-o");
            command.arg(directory.path().join("program"));
            command.arg(library_directory().join("libdynocar_client.a"));
            must_succeed(command.args(["-lpthread", "-ldl", "-lm"]));
        }
    }
}

#[test]
fn both_libraries_hold_every_function_of_the_header() {
    let functions = header_functions();
    assert!(functions.contains("dynocar_reader_poll"), "{functions:?}");
    let mut text = String::from("#include \"dynocar.h\"\nint main(void)\n{\nint count = 0;\n");
    for function in &functions {
        writeln!(text, "count += (void (*)(void)){function} != NULL;").unwrap();
    }
    writeln!(text, "return count == {} ? 0 : 1;\n}}", functions.len()).unwrap();
    let directory = tempfile::tempdir().unwrap();
    let source = directory.path().join("functions.c");
    std::fs::write(&source, text).unwrap();
    for link in [Link::Static, Link::Shared] {
        let program = directory.path().join(format!("{link:?}"));
        // Comparing a function with NULL is the point here; GCC finds it always true.
        support::build_c_with(&source, "c99", link, &program, &["-Wno-address"]);
        must_succeed(&mut Command::new(&program));
    }
}

#[test]
fn the_shared_library_exports_the_functions_of_the_header_and_no_other_of_ours() {
    support::require("nm", "binutils");
    let library = library_directory().join("libdynocar_client.so");
    let table = must_succeed(Command::new("nm").args(["-D", "--defined-only"]).arg(&library));
    // The transport exports a symbol of its own.
    let exported: BTreeSet<String> = table
        .lines()
        .filter_map(|line| line.split_whitespace().last())
        .filter(|name| name.starts_with("dynocar"))
        .map(str::to_owned)
        .collect();
    assert_eq!(exported, header_functions());
}
