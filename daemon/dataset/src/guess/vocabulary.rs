//! Names that recorders give to the quantities, in several languages, and their usual values: the tables of
//! `vocabulary.toml`.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use serde::Deserialize;

use crate::Quantity;

/// Weight of a term as evidence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TermWeight {
    /// It names the quantity among other words too.
    Named,
    /// It names the quantity unless another word has weight: `brake` may go on as `brake disc wear`.
    Alone,
    /// A letter of formulas or an abbreviation.
    Symbol,
    /// It may belong to another quantity: a train has several pressures.
    Weak,
}

/// The tables.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Vocabulary {
    /// Words that no quantity is called by.
    pub words: NonQuantityWords,
    quantities: BTreeMap<String, Entry>,
}

/// Words that no quantity is called by, separated by commas.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NonQuantityWords {
    /// Words that do not change the meaning of a column.
    pub neutral: String,
    /// They number the parts of a whole.
    pub parts: String,
    /// The parts of a train.
    pub vehicles: String,
    /// Words for wanted or allowed values instead of measured ones.
    pub not_measured: String,
    /// Words for a statement on a measurement instead of its value.
    pub about: String,
    /// Words for things that have a temperature, a pressure, a speed … of their own.
    pub other_things: String,
}

/// Names and usual values of a quantity.
#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Entry {
    named: String,
    alone: String,
    symbol: String,
    weak: String,
    usual: Option<Usual>,
}

/// Which figure of a column reveals its unit.
#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Measure {
    /// The greatest magnitude.
    Top,
    /// The middle value.
    Middle,
    /// The middle of the steps.
    Step,
    /// From the least to the greatest.
    Span,
}

/// Usual values of a train, and the units that recorders use, the likeliest first.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Usual {
    /// Which figure shows it.
    pub measure: Measure,
    /// The least that is usual, in the base unit.
    pub low: f64,
    /// The greatest.
    pub high: f64,
    /// The units.
    pub units: Vec<String>,
}

/// All that is known of names.
pub static VOCABULARY: LazyLock<Vocabulary> = LazyLock::new(|| {
    toml::from_str(include_str!("vocabulary.toml"))
        .expect("the vocabulary is as its readers take it")
});

/// Returns the entries of a list.
pub fn listed(list: &str) -> impl Iterator<Item = &str> {
    list.split(", ").filter(|term| !term.is_empty())
}

static TERMS: LazyLock<BTreeMap<Quantity, Vec<(TermWeight, String)>>> =
    LazyLock::new(|| Quantity::ALL.map(|quantity| (quantity, terms_of(quantity))).into());

fn terms_of(quantity: Quantity) -> Vec<(TermWeight, String)> {
    use TermWeight::{Alone, Named, Symbol, Weak};
    let own = quantity.name().replace('_', " ");
    let lists = VOCABULARY.quantities.get(quantity.name()).into_iter().flat_map(|it| {
        [(Named, &it.named), (Alone, &it.alone), (Symbol, &it.symbol), (Weak, &it.weak)]
    });
    let mut terms: Vec<(TermWeight, String)> = lists
        .flat_map(|(weight, list)| listed(list).map(move |term| (weight, term.to_string())))
        .collect();
    if terms.iter().all(|(_, term)| *term != own) {
        terms.insert(0, (Named, own));
    }
    terms
}

/// Returns the names of a quantity, and the weight of each term.
pub fn terms(quantity: Quantity) -> impl Iterator<Item = (TermWeight, &'static str)> {
    TERMS[&quantity].iter().map(|(weight, term)| (*weight, term.as_str()))
}

/// Returns true for a word that a name may hold besides its unit.
pub fn is_word(word: &str) -> bool {
    let words = &VOCABULARY.words;
    let lists = [&words.neutral, &words.parts, &words.vehicles, &words.not_measured, &words.about];
    let all_terms = || TERMS.values().flatten().flat_map(|(_, term)| term.split(' '));
    lists.into_iter().flat_map(|list| listed(list)).any(|it| it == word)
        || word.chars().all(|letter| letter.is_ascii_digit())
        || all_terms().any(|it| it == word)
}

/// Returns the usual values of a quantity; `None` where its values reveal no unit.
pub fn usual(quantity: Quantity) -> Option<&'static Usual> {
    VOCABULARY.quantities.get(quantity.name())?.usual.as_ref()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_term_belongs_to_one_quantity_and_is_written_as_names_are_folded() {
        let mut seen: Vec<(&str, Quantity)> = Vec::new();
        for quantity in Quantity::ALL {
            assert!(terms(quantity).next().is_some(), "{quantity}");
            for (_, term) in terms(quantity) {
                let is_folded = |letter: char| {
                    (letter.is_alphabetic() && !letter.is_uppercase()) || letter == ' '
                };
                assert!(!term.is_empty() && term.chars().all(is_folded), "{quantity}: {term:?}");
                let twin = seen.iter().find(|(other, _)| *other == term);
                assert_eq!(twin, None, "{quantity}: {term} again");
                seen.push((term, quantity));
            }
        }
        for quantity in Quantity::ALL {
            let twin = seen.iter().find(|(term, _)| *term == quantity.name().replace('_', " "));
            assert!(twin.is_none_or(|(_, of)| *of == quantity), "{quantity}");
        }
    }
}
