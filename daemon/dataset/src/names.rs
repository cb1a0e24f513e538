//! Names that a user may mistype, and what was meant.

use strsim::levenshtein;

/// The names that were possible, with the one most like what was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Choices {
    names: Vec<String>,
    nearest: Option<usize>,
}

impl Choices {
    /// The choices for a word that is none of them.
    pub fn new<T: Into<String>>(word: &str, names: impl IntoIterator<Item = T>) -> Self {
        let names: Vec<String> = names.into_iter().map(Into::into).collect();
        let nearest = nearest(word, &names);
        Choices { names, nearest }
    }

    /// The possible names.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The name most like the word, when it is like enough to be meant.
    pub fn nearest(&self) -> Option<&str> {
        self.nearest.map(|index| self.names[index].as_str())
    }
}

impl std::fmt::Display for Choices {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let Some(nearest) = self.nearest() {
            write!(f, "; did you mean '{nearest}'?")?;
        }
        let names: Vec<_> = self.names.iter().map(|name| format!("'{name}'")).collect();
        write!(f, " (choices: {})", names.join(", "))
    }
}

/// The index of the name nearest to a word: at most a third of the letters differ, or else it
/// is the only name that the word begins.
fn nearest(word: &str, names: &[String]) -> Option<usize> {
    let word = folded(word);
    let names: Vec<_> = names.iter().map(|name| folded(name)).collect();
    let distances = names.iter().enumerate().map(|(index, name)| (levenshtein(&word, name), index));
    let (distance, index) = distances.min()?;
    let letters = |name: &str| name.chars().count();
    if distance <= letters(&word).max(letters(&names[index])) / 3 {
        return Some(index);
    }
    let mut begun = (0..names.len()).filter(|&index| names[index].starts_with(&word));
    begun.next().filter(|_| begun.next().is_none() && !word.is_empty())
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
        let units = ["m/s", "km/h", "mph"];
        assert_eq!(Choices::new("kmh", units).nearest(), Some("km/h"));
        assert_eq!(Choices::new("KM/H", units).nearest(), Some("km/h"));
        assert_eq!(Choices::new("furlong", units).nearest(), None);
        assert_eq!(Choices::new("v", ["t", "v_kmh"]).nearest(), Some("v_kmh"));
        assert_eq!(Choices::new("v", ["t", "v_kmh", "v_ref"]).nearest(), None);
        let keys = ["position_reference", "description"];
        assert_eq!(Choices::new("Position-Referance", keys).nearest(), Some("position_reference"));
    }

    #[test]
    fn choices_are_listed_after_the_suggestion() {
        let shown = Choices::new("sped", ["speed", "time"]).to_string();
        assert_eq!(shown, "; did you mean 'speed'? (choices: 'speed', 'time')");
    }
}
