//! The text of a `track.toml`, key by key.

use std::fmt::{Display, Write as _};

/// A `track.toml` that is being written.
#[derive(Clone, Debug)]
pub struct TrackText {
    text: String,
}

impl TrackText {
    /// Begins with comments, which end with a line break.
    pub fn new(head: &str) -> Self {
        TrackText { text: format!("{head}[track]\n") }
    }

    /// Adds a key with its value as TOML.
    pub fn value(&mut self, key: &str, value: impl Display) {
        // Writing to a string cannot fail.
        let _ = writeln!(self.text, "{key} = {value}");
    }

    /// Adds a list of entries, each the values between its brackets.
    pub fn list(&mut self, key: &str, entries: impl Iterator<Item = String>) {
        let _ = writeln!(self.text, "{key} = [");
        for entry in entries {
            let _ = writeln!(self.text, "  [{entry}],");
        }
        self.text += "]\n";
    }

    /// The text.
    pub fn into_text(self) -> String {
        self.text
    }
}
