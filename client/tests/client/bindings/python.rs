//! The vocabularies as Python.

use std::fmt::Write as _;

use super::vocabularies::{self as vocabularies, Member, Vocabulary};

/// Text before the classes.
const HEAD: &str = r#""""The numbers on the channels and their names: written by client/tests/client/bindings.rs from the Rust types."""

from __future__ import annotations

from enum import IntEnum, IntFlag


class _Vocabulary(IntEnum):
    """Numbers on the wire; a number of a later release becomes a member ``NUMBER_<n>``."""

    @classmethod
    def _missing_(cls, value: object) -> _Vocabulary | None:
        if not isinstance(value, int):
            return None
        member = int.__new__(cls, value)
        member._name_ = f"NUMBER_{value}"
        member._value_ = value
        return member
"#;

/// The whole module.
pub fn module() -> String {
    let mut all = vec![vocabularies::code(), vocabularies::rail()];
    all.extend(vocabularies::of_answers());
    all.push(vocabularies::has());
    all.iter().fold(HEAD.to_owned(), |text, it| text + &class(it))
}

fn class(vocabulary: &Vocabulary) -> String {
    let base = if vocabulary.is_bits { "IntFlag" } else { "_Vocabulary" };
    let about = format!("{} {}", vocabulary.about, vocabulary.in_python);
    let about = if vocabulary.in_python.is_empty() { about.trim() } else { &about };
    let mut text = format!("\n\nclass {}({base}):\n    \"\"\"{about}\"\"\"\n\n", vocabulary.class);
    for Member { name, number, meaning } in &vocabulary.members {
        let value = if vocabulary.is_bits { format!("1 << {number}") } else { number.to_string() };
        let _ = writeln!(text, "    {name} = {value}  # {meaning}");
        for (_, then) in vocabulary.aliases.iter().filter(|(now, _)| now == name) {
            let _ = writeln!(text, "    {then} = {value}  # its name in earlier releases");
        }
    }
    text
}
