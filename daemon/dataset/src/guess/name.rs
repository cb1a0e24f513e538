//! A column's name in words, and the words that recorders use for quantities and units.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use dynocar_model::units::{Unit, is_unit};
use serde::Deserialize;

use crate::Quantity;

/// A column's name, divided into words and unit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Name {
    /// As in the header, without surrounding spaces.
    pub text: String,
    /// Its words in small letters, without the unit in brackets.
    pub words: Vec<String>,
    /// The unit that the name gives in brackets or after a slash, as written.
    pub unit: Option<String>,
}

impl Name {
    /// Divides a name: `F_trac [kN]` is f, trac and the unit kN.
    pub fn parse(text: &str) -> Self {
        let text = text.trim();
        // Recorders of buses write the source after a backslash: `speed\CAN1:1`.
        let is_source = |it: &str| it.contains(':') && it.ends_with(|it: char| it.is_ascii_digit());
        let own = text.rsplit_once('\\').filter(|it| is_source(it.1)).map_or(text, |it| it.0);
        let (rest, unit) = split_unit(own);
        Name { text: text.into(), words: words(&rest), unit }
    }

    /// Returns the name with a unit that stands elsewhere, unless it has its own.
    pub fn with_unit(self, unit: Option<String>) -> Self {
        Name { unit: self.unit.or(unit), ..self }
    }

    /// Returns the words without those that number a part of a whole; `None` where no word does, or all do.
    pub fn without_number(&self) -> Option<Vec<&str>> {
        let is_letter = |word: &str| matches!(word, "a" | "b" | "c" | "d");
        let is_number = |word: &&str| {
            word.chars().all(|it| it.is_ascii_digit())
                || is_letter(word)
                || listed(&VOCABULARY.words.parts).any(|part| part == *word)
        };
        let words = self.words.iter().map(String::as_str);
        let (numbers, rest): (Vec<&str>, Vec<&str>) = words.partition(is_number);
        (!numbers.is_empty() && !rest.is_empty()).then_some(rest)
    }

    /// Returns the name for messages: one line of at most 60 letters.
    pub fn shown(&self) -> String {
        let letters = self.text.chars().take(60);
        letters.map(|letter| if letter.is_control() { ' ' } else { letter }).collect()
    }
}

/// Returns the unit that a column's name gives for a quantity.
pub fn named_unit(name: &Name, quantity: Quantity) -> Option<Unit> {
    if let Some(text) = &name.unit {
        return Unit::spelled(quantity.dimension(), text);
    }
    readings(name, quantity).into_iter().rev().find_map(|(_, unit)| unit)
}

/// Returns the words of a name and, for each way to see a unit in its last words, the rest of them.
pub fn readings(name: &Name, quantity: Quantity) -> Vec<(&[String], Option<Unit>)> {
    let words = &name.words[..];
    let mut readings = vec![(words, None)];
    if name.unit.is_none() {
        // A number behind the unit is a part's.
        let is_number = |word: &String| word.chars().all(|it| it.is_ascii_digit());
        let end = words.len() - usize::from(words.last().is_some_and(is_number));
        let ends = [end, words.len()].into_iter().skip(usize::from(end == words.len()));
        for (end, count) in ends.flat_map(|end| (1..end.min(6)).map(move |count| (end, count))) {
            let (rest, unit) = words[..end].split_at(end - count);
            if let Some(unit) = Unit::spelled(quantity.dimension(), &unit.concat()) {
                readings.push((rest, Some(unit)));
            }
        }
    }
    readings
}

/// Returns the name without its unit, and the unit: in brackets, behind ` / ` as DIN 461 writes axes, or
/// behind `in`.
fn split_unit(text: &str) -> (String, Option<String>) {
    for (open, close) in [('[', ']'), ('(', ')'), ('{', '}'), ('<', '>')] {
        let Some(start) = text.rfind(open) else { continue };
        let Some(length) = text[start..].find(close) else { continue };
        let inside = &text[start + open.len_utf8()..start + length];
        if is_unit(inside) || looks_like_unit(inside, open) {
            let after = &text[start + length + close.len_utf8()..];
            let before = text[..start].trim_end().trim_end_matches('/');
            return (format!("{before} {after}"), Some(inside.trim().into()));
        }
    }
    for mark in [" / ", " in "] {
        if let Some((before, after)) = text.rsplit_once(mark)
            && is_unit(after)
            && !before.trim().is_empty()
        {
            return (before.into(), Some(after.trim().into()));
        }
    }
    (text.into(), None)
}

/// Returns true for text in brackets that looks like a unit, although it is not a known one: a word in square brackets,
/// and in others text with a unit's marks.
fn looks_like_unit(inside: &str, open: char) -> bool {
    let inside = inside.trim();
    let has_mark = inside.contains(['/', '·', '*', '^', '²', '³', '⁻']);
    let words = words(inside);
    let known = words.iter().any(|word| is_word(word));
    let has_letters = inside.chars().any(char::is_alphabetic);
    // Letters of quantities are units, too: of `dm/s` the last word is one.
    let is_share = has_letters && has_mark && words.last().is_some_and(|word| is_unit(word));
    is_share
        || inside.starts_with("1:")
        || !known && (has_mark || (open == '[' && has_letters && !inside.contains(' ')))
}

/// Returns the text in a name's brackets where that is a multiple of a unit of the quantity, as `0.1 kN` or `x1000
/// lbs`.
pub fn scaled_unit(name: &Name, quantity: Quantity) -> Option<&str> {
    let spelled = |text: &str| Unit::spelled(quantity.dimension(), text).is_some();
    let (_, inside) = name.text.rsplit_once(['[', '('])?;
    let inside = inside.split([']', ')']).next()?;
    let (numbers, units): (Vec<String>, Vec<String>) = words(inside)
        .into_iter()
        .partition(|it| it == "x" || it.chars().all(|it| it.is_ascii_digit()));
    let is_scaled = !numbers.is_empty() && spelled(&units.concat()) && !spelled(inside);
    is_scaled.then_some(inside)
}

/// Returns the words of a name: separated by marks, by capitals and by digits.
fn words(text: &str) -> Vec<String> {
    let letters: Vec<char> = text.chars().collect();
    let mut words: Vec<String> = Vec::new();
    let mut word = String::new();
    for (at, &letter) in letters.iter().enumerate() {
        let next = letters.get(at + 1).copied();
        let before = at.checked_sub(1).map(|at| letters[at]);
        if !word.is_empty() && before.is_some_and(|it| begins_word(it, letter, next, &word)) {
            words.push(std::mem::take(&mut word));
        }
        if letter.is_alphanumeric() || "%‰°".contains(letter) {
            fold_into(&mut word, letter);
        } else if !word.is_empty() {
            words.push(std::mem::take(&mut word));
        }
    }
    if !word.is_empty() {
        words.push(word);
    }
    words
}

/// Returns whether a new word begins without a mark: `tractionForce`, `FTrac`, `vIst`, `speed2`; but kN
/// is one word.
fn begins_word(before: char, letter: char, next: Option<char>, word: &str) -> bool {
    let is_small_next = next.is_some_and(char::is_lowercase);
    if letter.is_uppercase() && before.is_lowercase() {
        return word.chars().count() > 1 || is_small_next;
    }
    if letter.is_uppercase() && before.is_uppercase() {
        return is_small_next;
    }
    letter.is_ascii_digit() != before.is_ascii_digit()
        && letter.is_alphanumeric()
        && before.is_alphanumeric()
}

/// Adds a letter in the spelling that the vocabulary has.
fn fold_into(word: &mut String, letter: char) {
    for letter in letter.to_lowercase() {
        match letter {
            'ä' | 'æ' => word.push_str("ae"),
            'ö' | 'ø' => word.push_str("oe"),
            'ü' => word.push_str("ue"),
            'ß' => word.push_str("ss"),
            'é' | 'è' | 'ê' | 'ë' | 'ě' | 'ę' | 'ė' => word.push('e'),
            'à' | 'á' | 'â' | 'ã' | 'å' | 'ą' | 'ă' => word.push('a'),
            'ó' | 'ò' | 'ô' | 'õ' | 'ő' => word.push('o'),
            'í' | 'ì' | 'î' | 'ï' | 'ı' => word.push('i'),
            'ú' | 'ù' | 'û' | 'ů' | 'ű' => word.push('u'),
            'ç' | 'č' | 'ć' => word.push('c'),
            'ğ' => word.push('g'),
            'đ' => word.push('d'),
            'ț' | 'ţ' => word.push('t'),
            'ñ' | 'ň' | 'ń' => word.push('n'),
            'š' | 'ś' | 'ş' | 'ș' => word.push('s'),
            'ž' | 'ź' | 'ż' => word.push('z'),
            'ł' => word.push('l'),
            'ř' => word.push('r'),
            'ý' => word.push('y'),
            '²' => word.push('2'),
            letter => word.push(letter),
        }
    }
}

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
    /// Words for a mass that is not the whole train's.
    pub parts_of_mass: String,
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
    fn names_of_any_style_fall_into_words_and_unit() {
        let cases: [(&str, &[&str], Option<&str>); 17] = [
            ("speed_kmh", &["speed", "kmh"], None),
            ("v [m/s]", &["v"], Some("m/s")),
            ("v / (km/h)", &["v"], Some("km/h")),
            ("Geschwindigkeit / km/h", &["geschwindigkeit"], Some("km/h")),
            ("Geschwindigkeit in km/h", &["geschwindigkeit"], Some("km/h")),
            ("F_trac [kN]", &["f", "trac"], Some("kN")),
            ("F_kN", &["f", "kn"], None),
            ("tractionForce", &["traction", "force"], None),
            ("FTrac", &["f", "trac"], None),
            ("vIst", &["v", "ist"], None),
            ("BCPressure (bar)", &["bc", "pressure"], Some("bar")),
            ("Speed (GPS)", &["speed", "gps"], None),
            ("Außentemperatur [°C]", &["aussentemperatur"], Some("°C")),
            ("speed2", &["speed", "2"], None),
            ("Neigung[‰]", &["neigung"], Some("‰")),
            ("TIME", &["time"], None),
            ("", &[], None),
        ];
        for (text, words, unit) in cases {
            let name = Name::parse(text);
            assert_eq!(name.words, words, "{text}");
            assert_eq!(name.unit.as_deref(), unit, "{text}");
        }
    }

    #[test]
    fn a_name_is_shown_in_one_line() {
        assert_eq!(Name::parse("a\nb").shown(), "a b");
        assert_eq!(Name::parse(&"x".repeat(99)).shown().len(), 60);
    }

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
