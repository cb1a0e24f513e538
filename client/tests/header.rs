//! `dynocar.h` and the library agree on every size, offset, type and number.

use std::collections::BTreeSet;
use std::fmt::{Debug, Write};
use std::process::Command;

use dynocar_client::ffi::about::DaemonState;
use dynocar_client::ffi::{
    Code, EffortPlace, Rail, ReadingCopy, Resistance, StopRequest, Stopping,
};
use dynocar_shared::layout::FieldLayout;
use dynocar_shared::sample::FLAG_WHEEL_SLIDE;
use dynocar_shared::services::PIPELINES_MAX;
use dynocar_shared::snapshot::{COVARIANCE_ENTRIES, PARAMETERS_MAX, REJECTION_REASONS};
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{
    Manoeuvre, MassSource, Parameter, ParameterSnapshot, PipelineKind, Quantity, Reason,
    RejectionReason, SCHEMA_MAJOR, SampleField, Status, TrainSample,
};

mod support;
use support::{Link, client_directory, compiler, library_directory, must_succeed};

struct Struct {
    rust_name: &'static str,
    c_name: &'static str,
    size: usize,
    layout: &'static [FieldLayout],
}

const STRUCTS: [Struct; 7] = [
    Struct {
        rust_name: "TrainSample",
        c_name: "dynocar_train_sample",
        size: size_of::<TrainSample>(),
        layout: TrainSample::LAYOUT,
    },
    Struct {
        rust_name: "ParameterSnapshot",
        c_name: "dynocar_parameter_snapshot",
        size: size_of::<ParameterSnapshot>(),
        layout: ParameterSnapshot::LAYOUT,
    },
    Struct {
        rust_name: "ReadingCopy",
        c_name: "dynocar_reading",
        size: size_of::<ReadingCopy>(),
        layout: ReadingCopy::LAYOUT,
    },
    Struct {
        rust_name: "Resistance",
        c_name: "dynocar_resistance",
        size: size_of::<Resistance>(),
        layout: Resistance::LAYOUT,
    },
    Struct {
        rust_name: "StopRequest",
        c_name: "dynocar_stop",
        size: size_of::<StopRequest>(),
        layout: StopRequest::LAYOUT,
    },
    Struct {
        rust_name: "EffortPlace",
        c_name: "dynocar_effort_point",
        size: size_of::<EffortPlace>(),
        layout: EffortPlace::LAYOUT,
    },
    Struct {
        rust_name: "Stopping",
        c_name: "dynocar_stopping",
        size: size_of::<Stopping>(),
        layout: Stopping::LAYOUT,
    },
];

/// `WeakExcitation` as `WEAK_EXCITATION`.
fn upper_snake(member: impl Debug) -> String {
    let mut name = String::new();
    for (place, letter) in format!("{member:?}").char_indices() {
        if place > 0 && letter.is_uppercase() {
            name.push('_');
        }
        name.push(letter.to_ascii_uppercase());
    }
    name
}

/// Every member of every vocabulary, as (group, member, number).
fn vocabulary_members() -> Vec<(&'static str, String, i64)> {
    let mut members = Vec::new();
    let mut add = |group, member: &dyn Debug, number| {
        members.push((group, upper_snake(member), i64::from(number)));
    };
    Code::ALL.iter().for_each(|it| add("CODE", it, *it as u32));
    Rail::ALL.iter().for_each(|it| add("RAIL", it, *it as u32));
    DaemonState::ALL.iter().for_each(|it| add("DAEMON", it, *it as u32));
    Status::ALL.iter().for_each(|it| add("STATUS", it, *it as u32));
    Reason::ALL.iter().for_each(|it| add("REASON", it, *it as u32));
    PipelineKind::ALL.iter().for_each(|it| add("PIPELINE", it, *it as u32));
    Quantity::ALL.iter().for_each(|it| add("QUANTITY", it, *it as u32));
    MassSource::ALL.iter().for_each(|it| add("MASS_SOURCE", it, *it as u32));
    Parameter::ALL.iter().for_each(|it| add("PARAMETER", it, *it as u32));
    RejectionReason::ALL.iter().for_each(|it| add("REJECTED", it, *it as u32));
    Manoeuvre::ALL.iter().for_each(|it| add("MANOEUVRE", it, it.bit()));
    EffectKind::ALL.iter().for_each(|it| add("EFFECT", it, *it as u32));
    SampleField::ALL.iter().for_each(|it| add("HAS", it, u32::from(it.bit())));
    members
}

/// Names and numbers that the header declares beside the vocabularies.
fn constants() -> [(&'static str, u64); 6] {
    [
        ("SCHEMA", u64::from(SCHEMA_MAJOR)),
        ("SAMPLE_LAYOUT", TrainSample::LAYOUT_HASH),
        ("SNAPSHOT_LAYOUT", ParameterSnapshot::LAYOUT_HASH),
        ("PARAMETERS_MAX", PARAMETERS_MAX as u64),
        ("COVARIANCE_ENTRIES", COVARIANCE_ENTRIES as u64),
        ("REJECTION_REASONS", REJECTION_REASONS as u64),
    ]
}

/// What the C program must print, one line for each fact.
fn expected_lines() -> BTreeSet<String> {
    let mut lines = BTreeSet::new();
    for it in &STRUCTS {
        lines.insert(format!("{} size {}", it.rust_name, it.size));
        for field in it.layout {
            let element = field.type_name.trim_start_matches('[').split(';').next().unwrap();
            let place = format!("{element} {} {}", field.offset, field.size);
            lines.insert(format!("{}.{} {place}", it.rust_name, field.name));
        }
    }
    for (group, member, number) in vocabulary_members() {
        lines.insert(format!("{group}_{member} {number}"));
    }
    lines.extend(constants().map(|(name, number)| format!("{name} {number:#x}")));
    lines
}

fn c_constant(group: &str, member: &str) -> String {
    match (group, member) {
        ("CODE", "OK") => "DYNOCAR_OK".into(),
        ("CODE", _) => format!("DYNOCAR_ERROR_{member}"),
        _ => format!("DYNOCAR_{group}_{member}"),
    }
}

/// A C11 program that prints what the header declares.
fn layout_program() -> String {
    let mut text = String::from(
        "#include <stdio.h>\n#include \"dynocar.h\"\n\
         #define TYPE(value) _Generic((value), int8_t: \"i8\", uint8_t: \"u8\", uint16_t: \"u16\", \
         uint32_t: \"u32\", int64_t: \"i64\", uint64_t: \"u64\", double: \"f64\", \
         uint32_t *: \"u32\", double *: \"f64\", \
         dynocar_parameter_snapshot: \"ParameterSnapshot\")\n\
         #define FIELD(name, type, field) printf(name \".\" #field \" %s %zu %zu\\n\", \
         TYPE(((type *)0)->field), offsetof(type, field), sizeof(((type *)0)->field))\n\
         int main(void)\n{\n",
    );
    for Struct { rust_name, c_name, layout, .. } in &STRUCTS {
        writeln!(text, "printf(\"{rust_name} size %zu\\n\", sizeof({c_name}));").unwrap();
        for field in *layout {
            writeln!(text, "FIELD(\"{rust_name}\", {c_name}, {});", field.name).unwrap();
        }
    }
    for (group, member, _) in vocabulary_members() {
        let name = c_constant(group, &member);
        writeln!(text, "printf(\"{group}_{member} %lld\\n\", (long long){name});").unwrap();
    }
    for (name, _) in constants() {
        let value = format!("(unsigned long long)DYNOCAR_{name}");
        writeln!(text, "printf(\"{name} %#llx\\n\", {value});").unwrap();
    }
    text + "return 0;\n}\n"
}

fn assert_same(printed: &str) {
    let printed: BTreeSet<String> = printed.lines().map(str::to_owned).collect();
    let expected = expected_lines();
    let missing: Vec<_> = expected.difference(&printed).collect();
    let surplus: Vec<_> = printed.difference(&expected).collect();
    assert!(
        missing.is_empty() && surplus.is_empty(),
        "dynocar.h lacks {missing:#?} and has instead {surplus:#?}"
    );
}

fn header_text() -> String {
    std::fs::read_to_string(client_directory().join("include/dynocar.h")).unwrap()
}

/// The words of the header, comments left out.
fn header_words() -> Vec<String> {
    let text = header_text();
    let mut code = String::new();
    for (place, part) in text.split("/*").enumerate() {
        code += if place == 0 { part } else { part.split_once("*/").unwrap().1 };
    }
    let is_word = |letter: char| letter.is_ascii_alphanumeric() || letter == '_';
    // A word keeps what follows it, so that functions and enumerators can be told apart.
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
            command.arg("-Wshadow").args(options).args(&parts).arg("-o");
            command.arg(directory.path().join("program"));
            command.arg(library_directory().join("libdynocar_client.a"));
            must_succeed(command.args(["-lpthread", "-ldl", "-lm"]));
        }
    }
}

#[test]
fn header_and_library_agree_on_every_field_and_number() {
    let directory = tempfile::tempdir().unwrap();
    let source = directory.path().join("layout.c");
    let program = directory.path().join("layout");
    std::fs::write(&source, layout_program()).unwrap();
    support::build_c(&source, "c11", Link::Static, &program);
    assert_same(&must_succeed(&mut Command::new(&program)));
}

#[test]
fn the_header_declares_no_number_that_the_library_does_not_know() {
    let members = vocabulary_members();
    let known: BTreeSet<String> =
        members.iter().map(|(group, member, _)| c_constant(group, member)).collect();
    let declared: BTreeSet<String> = header_words()
        .iter()
        .filter_map(|word| word.strip_suffix('='))
        .filter(|name| name.starts_with("DYNOCAR_"))
        .map(str::to_owned)
        .collect();
    assert_eq!(declared, known);
    let text = header_text();
    assert!(text.contains(&format!("#define DYNOCAR_PIPELINES_MAX {PIPELINES_MAX} ")));
    assert!(text.contains(&format!("#define DYNOCAR_FLAG_WHEEL_SLIDE {FLAG_WHEEL_SLIDE} ")));
}

/// One name for one thing: who reads `ls` in a configuration finds `DYNOCAR_PIPELINE_LS`.
#[test]
fn names_in_the_header_are_those_of_the_configuration_and_of_results() {
    fn assert_named<T: Debug>(members: &[T], name: fn(&T) -> &'static str) {
        for member in members {
            assert_eq!(upper_snake(member), name(member).to_uppercase());
        }
    }
    assert_named(PipelineKind::ALL, |it| it.name());
    assert_named(Quantity::ALL, |it| it.name());
    assert_named(Status::ALL, |it| it.name());
    assert_named(Reason::ALL, |it| it.name());
    assert_named(RejectionReason::ALL, |it| it.name());
    assert_named(Manoeuvre::ALL, |it| it.name());
    assert_named(EffectKind::ALL, |it| it.name());
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
