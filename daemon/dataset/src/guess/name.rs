//! A column's name in words, and units as headers spell them.

use dynocar_model::units::{Dimension, Unit};

use crate::Quantity;

/// A column's name, taken apart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Name {
    /// As in the header, without surrounding spaces.
    pub text: String,
    /// Its words in small letters, without the unit in brackets.
    pub words: Vec<String>,
    /// The unit that the name gives in brackets or behind a stroke, as written.
    pub unit: Option<String>,
}

impl Name {
    /// Takes a name apart: `F_trac [kN]` is f, trac and the unit kN.
    pub fn parse(text: &str) -> Self {
        let text = text.trim();
        let (rest, unit) = split_unit(text);
        Name { text: text.into(), words: words(&rest), unit }
    }

    /// The name with a unit that stands elsewhere, unless it has its own.
    pub fn with_unit(self, unit: Option<String>) -> Self {
        Name { unit: self.unit.or(unit), ..self }
    }

    /// The name for messages: one line of at most 60 letters.
    pub fn shown(&self) -> String {
        let letters = self.text.chars().take(60);
        letters.map(|letter| if letter.is_control() { ' ' } else { letter }).collect()
    }
}

/// The unit that a column's name gives for a quantity.
pub fn named_unit(name: &Name, quantity: Quantity) -> Option<Spelled> {
    if let Some(text) = &name.unit {
        return find(quantity.dimension(), text);
    }
    readings(name, quantity).into_iter().rev().find_map(|(_, unit)| unit)
}

/// The words of a name and, for each way to see a unit in its last words, what is left of them.
pub fn readings(name: &Name, quantity: Quantity) -> Vec<(&[String], Option<Spelled>)> {
    let words = &name.words[..];
    let mut readings = vec![(words, None)];
    if name.unit.is_none() {
        for count in 1..words.len().min(4) {
            let (rest, unit) = words.split_at(words.len() - count);
            if let Some(unit) = find(quantity.dimension(), &unit.concat()) {
                readings.push((rest, Some(unit)));
            }
        }
    }
    readings
}

/// The name without its unit, and the unit: in brackets, behind ` / ` as DIN 461 writes axes, or
/// behind `in`.
fn split_unit(text: &str) -> (String, Option<String>) {
    for (open, close) in [('[', ']'), ('(', ')'), ('{', '}'), ('<', '>')] {
        let Some(start) = text.rfind(open) else { continue };
        let Some(length) = text[start..].find(close) else { continue };
        let inside = &text[start + open.len_utf8()..start + length];
        if is_unit(inside) {
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

/// The words of a name: separated by marks, by capitals and by digits.
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

/// True where a new word begins without a mark: `tractionForce`, `FTrac`, `vIst`, `speed2`; but kN
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
            'é' | 'è' | 'ê' => word.push('e'),
            'à' | 'á' | 'å' => word.push('a'),
            'ó' | 'ò' => word.push('o'),
            'í' => word.push('i'),
            'ú' | 'ů' => word.push('u'),
            'ç' => word.push('c'),
            'ñ' => word.push('n'),
            '²' => word.push('2'),
            letter => word.push(letter),
        }
    }
}

/// A unit that a header names: one of the dataset's units, and the factor that leads to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spelled {
    /// The unit that a dataset takes.
    pub unit: Unit,
    /// Cells times this are in the unit; 1 for the unit itself.
    pub scale: f64,
}

impl From<Unit> for Spelled {
    fn from(unit: Unit) -> Self {
        Spelled { unit, scale: 1.0 }
    }
}

/// How headers spell a dataset's units besides their names, with or without the marks in them, and multiples of these
/// units: dimension, name, the factor that leads to it, spellings in small letters and digits.
const SPELLINGS: &[(Dimension, &str, f64, &str)] = {
    use Dimension::*;
    &[
        (Time, "s", 1.0, "sec secs second seconds sek sekunden sekunde"),
        (Time, "ms", 1.0, "msec millis millisec milliseconds millisekunden"),
        (Time, "us", 1.0, "usec micros microseconds mikrosekunden"),
        (Time, "ns", 1.0, "nsec nanos nanoseconds"),
        (Time, "min", 1.0, "mins minute minutes minuten"),
        (Time, "h", 1.0, "hr hour hours std stunden"),
        (Length, "m", 1.0, "meter meters metre metres mtr"),
        (Length, "km", 1.0, "kilometer kilometers kilometre kilometres"),
        (Length, "mm", 1.0, "millimeter millimetre millimeters"),
        (Speed, "m/s", 1.0, "mps mpers ms1 mpersec metrespersecond msec"),
        (Speed, "km/h", 1.0, "kph kmph kmperh kmh1 kmhr kmperhour kmstd"),
        (Speed, "mph", 1.0, "miph milesperhour mih"),
        (Acceleration, "m/s2", 1.0, "mps2 mss mpss mpers2 ms msec2"),
        (Force, "N", 1.0, "newton newtons"),
        (Force, "kN", 1.0, "kilonewton kilonewtons"),
        (Force, "MN", 1.0, "meganewton"),
        (Force, "lbf", 1.0, "lb lbs"),
        (Pressure, "Pa", 1.0, "pascal"),
        (Pressure, "kPa", 1.0, "kilopascal"),
        (Pressure, "bar", 1.0, "bars barg"),
        (Mass, "kg", 1.0, "kilogram kilograms kgs"),
        (Mass, "t", 1.0, "to ton tons tonne tonnes tonnen"),
        (Temperature, "degC", 1.0, "c celsius gradc grad cel"),
        (Temperature, "K", 1.0, "kelvin"),
        (Temperature, "degF", 1.0, "f fahrenheit"),
        (Ratio, "permille", 1.0, "promille permil mmm mperkm mkm"),
        (Ratio, "%", 1.0, "pct percent prozent perc pc"),
        (Ratio, "1", 1.0, "pu ratio rad mm"),
        (Angle, "deg", 1.0, "degree degrees grad"),
        (Angle, "rad", 1.0, "radian radians"),
        (Curvature, "1/m", 1.0, "perm m1"),
        (Power, "W", 1.0, "watt watts"),
        (Power, "kW", 1.0, "kilowatt"),
        (Count, "1", 1.0, "bool flag count pax persons"),
        (Length, "m", 0.01, "cm"),
        (Length, "m", 0.3048, "ft feet foot"),
        (Length, "km", 1.609344, "mi mile miles"),
        (Speed, "m/s", 0.01, "cms cmps"),
        (Speed, "km/h", 1.852, "kn kt kts knot knots"),
        (Acceleration, "m/s2", 9.80665, "g gn"),
        (Force, "N", 10.0, "dan"),
        (Pressure, "Pa", 100.0, "hpa mbar"),
        (Pressure, "kPa", 1000.0, "mpa"),
        (Pressure, "kPa", 6.894757, "psi"),
        (Power, "kW", 1000.0, "mw megawatt"),
    ]
};

/// Units of things that a dataset has no quantity for.
const FOREIGN: &str = "ma mv hz khz rpm umin 1min nm knm kwh wh mwh j kj mj l lmin db ppm kva ohm";

/// The unit of a dimension that is spelled so. The dataset's own names come first, then case
/// distinguishes nothing (but mN is no MN).
pub fn find(dimension: Dimension, text: &str) -> Option<Spelled> {
    let text = text.trim();
    let plain = |unit: Unit| Some(Spelled::from(unit));
    match (dimension, text) {
        (Dimension::Ratio, "‰" | "0/00" | "o/oo") => return plain(unit(dimension, "permille")),
        (Dimension::Ratio | Dimension::Count, "-" | "") => return plain(unit(dimension, "1")),
        (Dimension::Angle, "°") => return plain(unit(dimension, "deg")),
        (Dimension::Pressure, "MPa") | (Dimension::Power, "MW") => {
            return spelled(dimension, &text.to_lowercase());
        }
        // Nobody's train pulls with thousandths of a newton or a watt.
        (Dimension::Force, "mN") | (Dimension::Power, "mW") => return None,
        _ => {}
    }
    let exact = Unit::of(dimension).find(|unit| unit.name() == text);
    // kN are no knots: capitals distinguish units of different things.
    let has_capital = text.chars().any(char::is_uppercase);
    if exact.is_none() && has_capital && Unit::all().any(|unit| unit.name() == text) {
        return None;
    }
    let folded = fold(text);
    if folded.is_empty() {
        return exact.and_then(plain);
    }
    let like = || Unit::of(dimension).find(|unit| fold(unit.name()) == folded);
    exact.or_else(like).and_then(plain).or_else(|| spelled(dimension, &folded))
}

fn spelled(dimension: Dimension, folded: &str) -> Option<Spelled> {
    let is_it = |&&(of, .., list): &&(Dimension, &str, f64, &str)| {
        of == dimension && list.split(' ').any(|spelling| spelling == folded)
    };
    let (_, name, scale, _) = SPELLINGS.iter().find(is_it)?;
    Some(Spelled { unit: unit(dimension, name), scale: *scale })
}

fn unit(dimension: Dimension, name: &str) -> Unit {
    Unit::find(dimension, name).unwrap_or_else(|| Unit::base_of(dimension))
}

/// True for the spelling of any unit, of a dataset's or of another thing's.
pub fn is_unit(text: &str) -> bool {
    FOREIGN.split(' ').any(|unit| unit == fold(text))
        || Unit::all().any(|unit| find(unit.dimension(), text).is_some())
}

/// Small letters and digits only.
fn fold(text: &str) -> String {
    let digits = |letter: char| match letter {
        '¹' => '1',
        '²' => '2',
        '³' => '3',
        'µ' | 'μ' => 'u',
        letter => letter,
    };
    let letters = text.chars().map(digits).flat_map(char::to_lowercase);
    letters.filter(|letter| letter.is_alphanumeric()).collect()
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
}

#[cfg(test)]
mod spelling_tests {
    use super::*;

    #[test]
    fn every_entry_leads_to_a_unit_of_its_dimension() {
        for &(dimension, name, scale, spellings) in SPELLINGS {
            assert!(Unit::find(dimension, name).is_some(), "{name}");
            assert!(scale > 0.0);
            for text in spellings.split(' ') {
                assert_eq!(fold(text), text, "spellings are folded");
                let found = find(dimension, text).expect(text);
                assert_eq!((found.unit.name(), found.scale), (name, scale), "{text}");
            }
        }
        for unit in Unit::all() {
            let found = find(unit.dimension(), unit.name()).unwrap();
            assert_eq!((found.unit, found.scale), (unit, 1.0));
        }
    }

    #[test]
    fn common_spellings_are_known() {
        use Dimension::*;
        let cases = [
            (Speed, "KM/H", "km/h", 1.0),
            (Speed, "km h⁻¹", "km/h", 1.0),
            (Speed, "kmh", "km/h", 1.0),
            (Speed, "m s-1", "m/s", 1.0),
            (Acceleration, "m/s²", "m/s2", 1.0),
            (Force, "kn", "kN", 1.0),
            (Force, "daN", "N", 10.0),
            (Pressure, "MPa", "kPa", 1000.0),
            (Pressure, "mbar", "Pa", 100.0),
            (Temperature, "°C", "degC", 1.0),
            (Ratio, "‰", "permille", 1.0),
            (Ratio, "%", "%", 1.0),
            (Angle, "°", "deg", 1.0),
            (Time, "µs", "us", 1.0),
            (Power, "MW", "kW", 1000.0),
        ];
        for (dimension, text, name, scale) in cases {
            let found = find(dimension, text).map(|it| (it.unit.name(), it.scale));
            assert_eq!(found, Some((name, scale)), "{text}");
        }
    }

    #[test]
    fn what_is_no_unit_of_the_dimension_is_none() {
        assert_eq!(find(Dimension::Speed, "kN·m"), None);
        assert_eq!(find(Dimension::Force, "mN"), None);
        assert_eq!(find(Dimension::Speed, "kN"), None);
        assert_eq!(find(Dimension::Time, ""), None);
        assert!(["A", "kV", "1/min", "kN", "km/h"].into_iter().all(is_unit));
        assert!(!is_unit("GPS") && !is_unit("front"));
    }
}
