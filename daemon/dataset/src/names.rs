//! Names that a user may mistype, and what was meant.

use strsim::levenshtein;

/// Returns the words for a name that may not stand in its place.
pub fn unknown<T: Into<String>>(
    what: &str,
    name: &str,
    context: &str,
    names: impl IntoIterator<Item = T>,
) -> String {
    let names: Vec<String> = names.into_iter().map(Into::into).collect();
    let meant = nearest(name, &names).map(|meant| format!("; did you mean '{meant}'?"));
    let choices: Vec<String> = names.iter().map(|name| format!("'{name}'")).collect();
    let (meant, choices) = (meant.unwrap_or_default(), choices.join(", "));
    format!("unknown {what} '{name}'{context}{meant} (choices: {choices})")
}

/// The name that is likely meant by a word: at most a third of the letters differ, or else it is
/// the only name that the word begins.
pub fn nearest<'n>(word: &str, all: &'n [String]) -> Option<&'n str> {
    let word = folded(word);
    let names: Vec<_> = all.iter().map(|name| folded(name)).collect();
    let distances = names.iter().enumerate().map(|(index, name)| (levenshtein(&word, name), index));
    let (distance, index) = distances.min()?;
    let letters = |name: &str| name.chars().count();
    if distance <= letters(&word).max(letters(&names[index])) / 3 {
        return Some(&all[index]);
    }
    let mut begun = (0..names.len()).filter(|&index| names[index].starts_with(&word));
    let only = begun.next().filter(|_| begun.next().is_none() && !word.is_empty());
    only.map(|index| all[index].as_str())
}

/// Case and what separates words do not distinguish names for the purpose of a guess.
fn folded(name: &str) -> String {
    // A word of any length may come from a file; a name's first letters are enough for a guess.
    let letters = name.chars().take(80).flat_map(char::to_lowercase);
    letters.map(|letter| if letter == '-' || letter == ' ' { '_' } else { letter }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_that_was_meant_is_suggested() {
        let meant = |word: &str, names: &[&str]| {
            let names: Vec<String> = names.iter().map(|&name| name.into()).collect();
            nearest(word, &names).map(ToOwned::to_owned)
        };
        let of = |name: &str| Some(name.to_string());
        let units = ["m/s", "km/h", "mph"];
        assert_eq!(meant("kmh", &units), of("km/h"));
        assert_eq!(meant("KM/H", &units), of("km/h"));
        assert_eq!(meant("furlong", &units), None);
        assert_eq!(meant("v", &["t", "v_kmh"]), of("v_kmh"));
        assert_eq!(meant("v", &["t", "v_kmh", "v_ref"]), None);
        let keys = ["position_reference", "description"];
        assert_eq!(meant("Position-Referance", &keys), of("position_reference"));
    }

    #[test]
    fn choices_are_listed_after_the_suggestion() {
        let shown = unknown("key", "sped", " in [x]", ["speed", "time"]);
        let expected =
            "unknown key 'sped' in [x]; did you mean 'speed'? (choices: 'speed', 'time')";
        assert_eq!(shown, expected);
    }
}
