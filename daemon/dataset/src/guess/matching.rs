//! Which quantity a column's name and values speak for.

use super::facts::Facts;
use super::name::Name;
use super::plausible::{UnitChoice, choose_unit};
use super::spelling::{self, Spelled};
use super::vocabulary::{TermWeight, VOCABULARY, listed, terms};
use crate::{Choices, Quantity};

/// What a name is worth that says the quantity and nothing else.
const SAID: i32 = 100;
/// A name below this is no sign of the quantity.
const ENOUGH: i32 = 45;
/// A name below this is a doubtful sign.
const SURE: i32 = 65;
/// Terms of so many letters are found within a longer word, too.
const WITHIN_MIN: usize = 6;

/// A column that may hold a quantity.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// Index of the column.
    pub column: usize,
    /// The quantity.
    pub quantity: Quantity,
    /// The greater the likelier.
    pub score: i32,
    /// What in the name speaks for it.
    pub reason: String,
    /// The unit.
    pub unit: UnitChoice,
    /// What makes the quantity doubtful.
    pub doubt: Option<String>,
}

/// What a name says of a quantity.
struct Match {
    score: i32,
    reason: String,
    unit: Option<Spelled>,
}

/// Whether a column may hold a quantity: `None` where nothing speaks for it, an error where the
/// name does but something else speaks against it.
pub fn consider(
    column: usize,
    name: &Name,
    facts: &Facts,
    quantity: Quantity,
) -> Option<Result<Candidate, String>> {
    let by_name = match quantity {
        // What stands in brackets behind the name may be the times' form.
        Quantity::Time if !facts.formats().is_empty() => {
            by_name(name, quantity).filter(Result::is_ok).or_else(|| Some(Ok(by_cells())))
        }
        _ => by_name(name, quantity),
    };
    let matched = match by_name? {
        Ok(matched) => matched,
        Err(reason) => return Some(Err(reason)),
    };
    if let Err(reason) = can_hold(facts, quantity) {
        return Some(Err(reason));
    }
    let Match { score, reason, unit } = matched;
    let unit = choose_unit(quantity, facts, unit);
    let doubt = (score < SURE).then(|| format!("little speaks for it but {reason}"));
    Some(Ok(Candidate { column, quantity, score, reason, unit, doubt }))
}

/// Whether a column's values can be the quantity's.
///
/// # Errors
///
/// What speaks against it.
pub fn can_hold(facts: &Facts, quantity: Quantity) -> Result<(), String> {
    if let Some(text) = &facts.text {
        return Err(format!("it holds text in line {}: '{}'", text.line, text.cell));
    }
    let (Some(top), min, max) = (facts.top(), facts.min, facts.max) else {
        return Err("it holds no value".into());
    };
    if quantity != Quantity::Time && !facts.formats().is_empty() {
        return Err("it holds times".into());
    }
    let refuse_beyond = |low: f64, high: f64| match min < low || max > high {
        true => Err(format!("its values, {min} to {max}, leave {low} to {high}")),
        false => Ok(()),
    };
    match quantity {
        Quantity::Time if !facts.grows() => Err("its values do not grow from row to row".into()),
        Quantity::WheelSlide | Quantity::DoorOpen => refuse_beyond(0.0, 1.0),
        Quantity::Latitude => refuse_beyond(-90.0, 90.0),
        Quantity::Longitude => refuse_beyond(-180.0, 180.0),
        Quantity::Course => refuse_beyond(-360.0, 360.0),
        Quantity::Speed if facts.signs().1 > 0.5 => {
            Err("its values are negative: speed counts in the direction of travel".into())
        }
        Quantity::Curvature if top > 0.2 => Err("its values are no curvature in 1/m".into()),
        _ => Ok(()),
    }
}

/// A column of times, whatever its name.
fn by_cells() -> Match {
    Match { score: SURE, reason: "what it holds".into(), unit: None }
}

/// The unit that a column's name gives for a quantity.
pub fn named_unit(name: &Name, quantity: Quantity) -> Option<Spelled> {
    if let Some(text) = &name.unit {
        return spelling::find(quantity.dimension(), text);
    }
    readings(name, quantity).into_iter().rev().find_map(|(_, unit)| unit)
}

/// The best that a name says of a quantity, or what in it speaks against it.
fn by_name(name: &Name, quantity: Quantity) -> Option<Result<Match, String>> {
    let best = readings(name, quantity)
        .into_iter()
        .filter_map(|(words, unit)| {
            let (score, reason) = by_words(words, quantity)?;
            let score = score + if unit.is_some() { 5 } else { 0 };
            Some((Match { score, reason, unit }, words))
        })
        .max_by_key(|(it, _)| it.score);
    let Some((mut best, words)) = best else { return by_unit_alone(name, quantity).map(Ok) };
    if let Some(text) = &name.unit {
        let Some(unit) = spelling::find(quantity.dimension(), text) else {
            return Some(Err(format!("its unit '{text}' is none of {quantity}")));
        };
        best.unit = Some(unit);
        best.score += 5;
    }
    if let Some(against) = contradiction(words, quantity) {
        return Some(Err(against));
    }
    (best.score >= ENOUGH).then_some(Ok(best))
}

/// The words of a name and, for each way to see a unit in its last words, what is left of them.
fn readings(name: &Name, quantity: Quantity) -> Vec<(&[String], Option<Spelled>)> {
    let words = &name.words[..];
    let mut readings = vec![(words, None)];
    if name.unit.is_none() {
        for count in 1..words.len().min(4) {
            let (rest, unit) = words.split_at(words.len() - count);
            if let Some(unit) = spelling::find(quantity.dimension(), &unit.concat()) {
                readings.push((rest, Some(unit)));
            }
        }
    }
    readings
}

/// What the words say of a quantity.
fn by_words(words: &[String], quantity: Quantity) -> Option<(i32, String)> {
    let own = quantity.name().replace('_', " ");
    let is_listed = terms(quantity).any(|(_, term)| term == own);
    let score = |(strength, term): (TermWeight, &str)| {
        let score = by_term(words, strength, term)?;
        Some((score, format!("'{term}' in the name")))
    };
    let by_own = Some((TermWeight::Named, own.as_str())).filter(|_| !is_listed).and_then(score);
    let matches = by_own.into_iter().chain(terms(quantity).filter_map(score));
    let best = matches.max_by_key(|(score, _)| *score);
    best.or_else(|| by_likeness(words, quantity))
}

/// What a name is worth that holds a term.
fn by_term(words: &[String], strength: TermWeight, term: &str) -> Option<i32> {
    let wanted: Vec<&str> = term.split(' ').collect();
    let is_wanted = |word: &String| wanted.contains(&word.as_str());
    let joined = wanted.concat();
    let extras: Vec<&String> = if wanted.iter().all(|it| words.iter().any(|word| word == it)) {
        words.iter().filter(|word| !is_wanted(word)).collect()
    } else if words.len() > 1 && words.concat() == joined {
        Vec::new()
    } else if let Some(at) = words.iter().position(|word| *word == joined) {
        words.iter().enumerate().filter(|(other, _)| *other != at).map(|(_, word)| word).collect()
    } else {
        return within(words, strength, &joined);
    };
    // What was wanted instead of measured is the same quantity, and refused as that later.
    let is_neutral = |word: &&String| {
        let words = &VOCABULARY.words;
        let lists = [&words.neutral, &words.not_measured, &words.about];
        lists.into_iter().flat_map(|list| listed(list)).any(|neutral| neutral == *word)
            || word.chars().all(|letter| letter.is_ascii_digit())
    };
    let neutral = extras.iter().filter(|word| is_neutral(word)).count() as i32;
    let unknown = extras.len() as i32 - neutral;
    let base = match strength {
        TermWeight::Named => SAID - 20 * unknown,
        TermWeight::Alone if unknown == 0 => 80,
        TermWeight::Symbol if unknown == 0 => 60,
        TermWeight::Weak if unknown == 0 => 50,
        _ => return None,
    };
    Some(base + wanted.len() as i32 - 2 * neutral)
}

/// A term within a longer word, as words are joined in German.
fn within(words: &[String], strength: TermWeight, joined: &str) -> Option<i32> {
    let is_long = strength == TermWeight::Named && joined.len() >= WITHIN_MIN;
    let holds = |word: &String| word.len() > joined.len() && word.contains(joined);
    (is_long && words.iter().any(holds)).then(|| 70 - 10 * (words.len() as i32 - 1))
}

/// A name that was mistyped.
fn by_likeness(words: &[String], quantity: Quantity) -> Option<(i32, String)> {
    let joined = words.concat();
    let is_known = |it: &Quantity| {
        let listed = terms(*it).map(|(_, term)| term);
        listed.chain([it.name()]).any(|term| joined == term.replace([' ', '_'], ""))
    };
    if joined.chars().count() < WITHIN_MIN || Quantity::ALL.iter().any(is_known) {
        return None;
    }
    let named = |it: Quantity| {
        let listed = terms(it).filter(|(strength, _)| *strength == TermWeight::Named);
        let listed = listed.map(|(_, term)| term);
        let own = std::iter::once(it.name());
        own.chain(listed)
            .filter(|term| term.len() >= WITHIN_MIN - 1)
            .map(move |term| (it, term.replace([' ', '_'], "")))
    };
    let names: Vec<(Quantity, String)> = Quantity::ALL.into_iter().flat_map(named).collect();
    let choices = Choices::new(&joined, names.iter().map(|(_, term)| term.clone()));
    let nearest = choices.nearest()?;
    let is_meant = names.iter().any(|(of, term)| *of == quantity && term == nearest);
    // Likeness of single letters only: a name's beginning says too little here.
    let is_alike = joined.len().abs_diff(nearest.len()) <= 2;
    (is_meant && is_alike).then(|| (50, format!("that the name is like '{nearest}'")))
}

/// A column of which only the unit speaks: of what trains record in km/h it is the speed; and T is
/// a temperature beside the unit of one.
fn by_unit_alone(name: &Name, quantity: Quantity) -> Option<Match> {
    let unit = spelling::find(quantity.dimension(), name.unit.as_ref()?)?;
    let is_known = match quantity {
        Quantity::Speed => contradiction(&name.words, quantity).is_none(),
        Quantity::AmbientTemperature => name.words == ["t"],
        _ => false,
    };
    if !is_known {
        return None;
    }
    Some(Match { score: ENOUGH + 1, reason: "its unit".into(), unit: Some(unit) })
}

/// What in a name speaks against what was measured of the train.
fn contradiction(words: &[String], quantity: Quantity) -> Option<String> {
    let own: Vec<&str> = terms(quantity)
        .flat_map(|(_, term)| term.split(' '))
        .chain(quantity.name().split('_'))
        .collect();
    let known = &VOCABULARY.words;
    let lists = [
        (&known.not_measured, "what was wanted or allowed"),
        (&known.about, "something about a measurement"),
        (&known.other_things, "another thing"),
    ];
    for (list, what) in lists {
        let is_known = |word: &&String| {
            let is_in = |it: &str| *word == it || (it.len() >= 4 && word.contains(it));
            !own.contains(&word.as_str()) && listed(list).any(is_in)
        };
        if let Some(word) = words.iter().find(is_known) {
            return Some(format!("'{word}' names {what}"));
        }
    }
    None
}
