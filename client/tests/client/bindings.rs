//! C and Python repeat constants of the library. They are generated from it, and these tests check that they still
//! agree: `DYNOCAR_WRITE_BINDINGS=1 cargo test --release -p dynocar-client --test client bindings::` generates them
//! anew.

mod c;
mod python;
mod vocabularies;

use std::fmt::Debug;
use std::path::Path;

use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{Manoeuvre, PipelineKind, Quantity, Reason, RejectionReason, Status};
use vocabularies::upper_snake;

/// Compares a file with its expected text, or writes it.
fn hold(path: &str, text: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    if std::env::var_os("DYNOCAR_WRITE_BINDINGS").is_some() {
        std::fs::write(&path, text).unwrap();
    }
    let found = std::fs::read_to_string(&path).unwrap();
    let differing = found.lines().zip(text.lines()).position(|(found, text)| found != text);
    assert!(
        found == text,
        "{}: line {} is not as the library has it; DYNOCAR_WRITE_BINDINGS=1 with this test writes it",
        path.display(),
        differing.unwrap_or(found.lines().count().min(text.lines().count())) + 1
    );
}

/// A header with its generated parts put in between their marks.
fn with_parts(header: &str, parts: &[(&str, String)]) -> String {
    parts.iter().fold(header.to_owned(), |text, (name, part)| {
        let begin = format!("/* generated: {name} */\n");
        let (before, rest) = text.split_once(&begin).unwrap_or_else(|| panic!("no mark of {name}"));
        let (_, after) = rest.split_once("/* end of generated */\n").expect("an end of each part");
        format!("{before}{begin}{part}/* end of generated */\n{after}")
    })
}

#[test]
fn the_header_is_as_the_library_has_it() {
    let header = Path::new(env!("CARGO_MANIFEST_DIR")).join("include/dynocar.h");
    let header = std::fs::read_to_string(header).unwrap();
    hold("include/dynocar.h", &with_parts(&header, &c::parts()));
    let by_hand = with_parts(&header, &c::parts().map(|(name, _)| (name, String::new())));
    assert!(!by_hand.contains("enum {"), "no number stands beside the generated ones");
}

#[test]
fn pythons_vocabularies_are_as_the_library_has_them() {
    hold("python/dynocar/_vocabulary.py", &python::module());
}

#[test]
fn a_part_is_replaced_between_its_marks() {
    let header = "a\n/* generated: x */\nold\n/* end of generated */\nb\n";
    let text = with_parts(header, &[("x", "new\n".into())]);
    assert_eq!(text, "a\n/* generated: x */\nnew\n/* end of generated */\nb\n");
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
