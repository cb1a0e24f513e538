//! Scores of a quantity for a column, by its name and its values.

use dynocar_model::units::{Dimension, Unit, is_unit};

use super::facts::{Facts, TextCell};
use super::guessed::GuessedColumn;
use super::name::{Name, TermWeight, VOCABULARY, listed, readings, scaled_unit, terms};
use crate::Quantity;
use crate::cell::{METRES_ALONE, is_of_km_and_m};
use crate::error::nearest;

/// Score of a name that states the quantity and nothing else.
const SAID: i32 = 100;
/// Score below which a name is no sign of the quantity.
const ENOUGH: i32 = 45;
/// Score below which a name is a doubtful sign.
const SURE: i32 = 65;
/// Number of numbers above which a single cell of text among them is a mistake in the file.
const TEXTS_RARE: usize = 50;
/// Least number of letters of a term that is found within a longer word, too.
const WITHIN_MIN: usize = 6;

/// Beginning of a reason that is an unknown unit.
pub const UNKNOWN_UNIT: &str = "there is no unit ";

/// Match of a name with a quantity.
struct Match {
    score: i32,
    reason: String,
    unit: Option<Unit>,
}

/// Returns whether a column may hold a quantity, and its score, the greater the likelier: `None` where nothing speaks
/// for it, an error where the name does but something else speaks against it.
pub fn consider(
    name: &Name,
    facts: &Facts,
    quantity: Quantity,
) -> Option<Result<(i32, GuessedColumn), String>> {
    if name.text.is_empty() && (quantity != Quantity::Time || facts.formats().is_empty()) {
        return None;
    }
    let by_name = match quantity {
        // Brackets behind the name may hold the form of the times.
        Quantity::Time if !facts.formats().is_empty() => {
            by_name(name, quantity).filter(Result::is_ok).or_else(|| Some(Ok(by_cells())))
        }
        _ => by_name(name, quantity),
    };
    let matched = by_name?.and_then(|matched| can_hold(facts, quantity).map(|()| matched));
    Some(matched.map(|Match { score, reason, unit }| {
        let doubt = (score < SURE).then(|| format!("little speaks for it but {reason}"));
        let mut guessed = GuessedColumn::new((name, facts), quantity, reason, (None, unit));
        guessed.doubts.splice(0..0, doubt);
        if quantity == Quantity::Time && !facts.grows() {
            guessed
                .doubts
                .push("its values fall from row to row: the newest row stands first".into());
        }
        (score, guessed)
    }))
}

/// Whether a column's values can be the quantity's.
///
/// # Errors
///
/// Word that contradicts it.
pub fn can_hold(facts: &Facts, quantity: Quantity) -> Result<(), String> {
    if facts.truths > 0 && quantity.dimension() != Dimension::Count {
        return Err("it holds words of truth".into());
    }
    // One bad cell among many is an error in its line, and unmaps no force.
    let is_needed = matches!(
        quantity,
        Quantity::Time
            | Quantity::Speed
            | Quantity::TractionForce
            | Quantity::BrakeForce
            | Quantity::ControlForce
            | Quantity::TractionPower
    );
    let is_rare = facts.texts * TEXTS_RARE < facts.numbers;
    if let Some(text) = facts.text.as_ref().filter(|_| !(is_needed && is_rare)) {
        let TextCell { file, line, cell } = text;
        let remedy = match quantity == Quantity::Position && is_of_km_and_m(cell) {
            true => format!("; {METRES_ALONE}"),
            false => String::new(),
        };
        return Err(format!("it holds text in {file}line {line}: '{cell}'{remedy}"));
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
        Quantity::Time if !facts.grows() && !facts.falls() => {
            Err("its values do not grow from row to row".into())
        }
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

/// Returns the match of a column whose cells are times, with any name.
fn by_cells() -> Match {
    Match { score: SURE, reason: "what it holds".into(), unit: None }
}

/// Returns the best match of a name with a quantity, or the contradiction in the name.
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
    if let Some(text) = scaled_unit(name, quantity) {
        return Some(Err(
            contradiction(words, quantity).unwrap_or(format!("{UNKNOWN_UNIT}'{text}'"))
        ));
    }
    if let Some(text) = &name.unit {
        let Some(unit) = Unit::spelled(quantity.dimension(), text) else {
            let problem = match is_unit(text) {
                true => {
                    format!("its unit '{text}' is none of {quantity}{}", share_of(quantity, text))
                }
                false => format!("{UNKNOWN_UNIT}'{text}'"),
            };
            return Some(Err(contradiction(words, quantity).unwrap_or(problem)));
        };
        best.unit = Some(unit);
        best.score += 5;
    }
    if let Some(against) = contradiction(words, quantity) {
        return Some(Err(against));
    }
    (best.score >= ENOUGH).then_some(Ok(best))
}

/// Returns the remedy of a force in a unit of shares.
fn share_of(quantity: Quantity, unit: &str) -> String {
    let handle = match quantity {
        Quantity::TractionForce => Quantity::TractionHandle,
        Quantity::BrakeForce => Quantity::BrakeHandle,
        _ => return String::new(),
    };
    match Unit::spelled(Dimension::Ratio, unit) {
        Some(_) => {
            format!("; map a share of the effort as {handle}, and state the effort in train.toml")
        }
        None => String::new(),
    }
}

/// Returns the match of the words with a quantity.
fn by_words(words: &[String], quantity: Quantity) -> Option<(i32, String)> {
    let matches = terms(quantity).filter_map(|(strength, term)| {
        Some((by_term(words, strength, term)?, format!("'{term}' in the name")))
    });
    matches.max_by_key(|(score, _)| *score).or_else(|| by_likeness(words, quantity))
}

/// Returns the weight of a name that holds a term.
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
    // A requested value is the same quantity as the measured one, and refused as that later.
    let is_neutral = |word: &&String| {
        let words = &VOCABULARY.words;
        let lists =
            [&words.neutral, &words.parts, &words.vehicles, &words.not_measured, &words.about];
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

/// Returns a term within a longer word, as words are joined in German.
fn within(words: &[String], strength: TermWeight, joined: &str) -> Option<i32> {
    let is_long = strength == TermWeight::Named && joined.len() >= WITHIN_MIN;
    let holds = |word: &String| word.len() > joined.len() && word.contains(joined);
    (is_long && words.iter().any(holds)).then(|| 70 - 10 * (words.len() as i32 - 1))
}

/// Returns a name that was mistyped.
fn by_likeness(words: &[String], quantity: Quantity) -> Option<(i32, String)> {
    let joined = words.concat();
    let all = || {
        let terms_of = |it: Quantity| terms(it).map(move |(weight, term)| (it, weight, term));
        Quantity::ALL.into_iter().flat_map(terms_of)
    };
    let is_known = || all().any(|(.., term)| joined == term.replace(' ', ""));
    if joined.chars().count() < WITHIN_MIN || is_known() {
        return None;
    }
    let is_named = |it: Quantity, weight: TermWeight, term: &str| {
        let is_own = term == it.name().replace('_', " ");
        (weight == TermWeight::Named || is_own) && term.len() >= WITHIN_MIN - 1
    };
    let (of, names): (Vec<Quantity>, Vec<String>) = all()
        .filter(|&(it, weight, term)| is_named(it, weight, term))
        .map(|(it, _, term)| (it, term.replace(' ', "")))
        .unzip();
    let nearest = nearest(&joined, &names)?;
    let is_meant = of.iter().zip(&names).any(|(of, term)| *of == quantity && term == nearest);
    // Likeness of single letters only: a name's beginning says too little here.
    let is_alike = joined.len().abs_diff(nearest.len()) <= 2;
    (is_meant && is_alike).then(|| (50, format!("that the name is like '{nearest}'")))
}

/// Returns a match for which only the unit speaks: a column in km/h is the speed, and T in a unit of temperature is a
/// temperature.
fn by_unit_alone(name: &Name, quantity: Quantity) -> Option<Match> {
    let unit = Unit::spelled(quantity.dimension(), name.unit.as_ref()?)?;
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

/// Returns the word in a name that contradicts a measurement of the train.
fn contradiction(words: &[String], quantity: Quantity) -> Option<String> {
    let own: Vec<&str> = terms(quantity).flat_map(|(_, term)| term.split(' ')).collect();
    let known = &VOCABULARY.words;
    let lists = [
        (&known.not_measured, "what was wanted or allowed"),
        (&known.about, "something about a measurement"),
        (&known.other_things, "another thing"),
    ];
    let of_mass = (&known.parts_of_mass, "a part of the train's mass");
    for (list, what) in
        lists.into_iter().chain((quantity == Quantity::TrainMass).then_some(of_mass))
    {
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

/// Returns the greatest magnitude and mean of a column's values in the base unit, as it is taken.
pub fn figures(facts: &Facts, guessed: &GuessedColumn) -> [f64; 2] {
    let figures = [facts.top(), facts.mean()];
    figures.map(|it| guessed.unit.to_base(it.unwrap_or(f64::NAN) * guessed.scale))
}

/// True for the figures of columns that say the same, but for noise.
pub fn are_alike(one: [f64; 2], other: [f64; 2]) -> bool {
    one.iter().zip(other).all(|(one, other)| (one - other).abs() <= 0.02 * one.abs().max(1e-9))
}
