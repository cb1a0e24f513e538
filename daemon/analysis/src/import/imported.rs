//! Result of an import: a train or a line as far as the file describes it, and an account of every field.

use dynocar_model::track::TrackCurve;
use dynocar_model::train::Davis;

use crate::dataset::document::Item;
use crate::dataset::{DatasetError, SourcePosition};

/// How to read a file where its format leaves a choice.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImportReading {
    /// Share of the permitted load that is on the train, 0 to 1, where a file gives the load.
    pub load_share: f64,
    /// Name of the mode whose effort curve is used where there are several; the file's default without it.
    pub mode: Option<String>,
}

/// Outcome of a field.
#[derive(Clone, Debug, PartialEq)]
pub enum FieldOutcome {
    /// It was converted to a key.
    Taken {
        /// The field, with its unit where the format has one.
        field: String,
        /// The key of `train.toml` or `track.toml`.
        key: &'static str,
        /// How it was converted or read.
        how: String,
    },
    /// It was read, but there is no key for it.
    Left {
        /// The field.
        field: String,
        /// Why.
        why: String,
    },
    /// A key that the file does not give.
    Unknown {
        /// The key.
        key: &'static str,
        /// Missing quantity.
        why: String,
    },
}

/// The account of the fields of one train or line, each once.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Account {
    outcomes: Vec<FieldOutcome>,
}

impl Account {
    /// Returns everything said, in the order of the work.
    pub fn outcomes(&self) -> &[FieldOutcome] {
        &self.outcomes
    }

    fn say(&mut self, outcome: FieldOutcome) {
        if !self.outcomes.contains(&outcome) {
            self.outcomes.push(outcome);
        }
    }

    pub(super) fn taken(&mut self, field: &str, key: &'static str, how: impl Into<String>) {
        self.say(FieldOutcome::Taken { field: field.into(), key, how: how.into() });
    }

    pub(super) fn left(&mut self, field: &str, why: impl Into<String>) {
        self.say(FieldOutcome::Left { field: field.into(), why: why.into() });
    }

    pub(super) fn unknown(&mut self, key: &'static str, why: impl Into<String>) {
        self.say(FieldOutcome::Unknown { key, why: why.into() });
    }

    /// Returns a value that a field gives: taken under a key, or not known for a reason.
    pub(super) fn given<T>(
        &mut self,
        value: Option<T>,
        field: &str,
        (key, how): (&'static str, &str),
        why: &str,
    ) -> Option<T> {
        match value {
            Some(_) => self.taken(field, key, how),
            None => self.unknown(key, why),
        }
        value
    }

    /// Accounts for the fields of a map that were not taken: those of `without_place`, lists with a reason each,
    /// and those that nobody has asked for. `prefix` stands before each name.
    pub(super) fn rest(&mut self, prefix: &str, map: &Item, without_place: &[(&str, &str)]) {
        for key in map.keys() {
            let is_listed = |(_, list): &&(&str, &str)| list.split(", ").any(|name| name == key);
            let why = match without_place.iter().find(is_listed) {
                Some((why, _)) => why,
                None if map.is_unread(key) => "not understood",
                None => continue,
            };
            self.left(&format!("{prefix}{key}"), why);
        }
    }
}

/// Returns a force of an effort curve in N.
pub(super) fn force_n(item: &Item) -> Result<f64, DatasetError> {
    item.number("a force in N from 0 to 1e7", 0.0..=1e7)
}

/// A train as far as its file gives it, in SI units.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportedTrain {
    /// By which it is chosen among others.
    pub id: String,
    /// Where it stands.
    pub place: SourcePosition,
    /// Name for people.
    pub name: String,
    /// Mass in kg.
    pub mass_kg: Option<f64>,
    /// Length in m.
    pub length_m: Option<f64>,
    /// Number of cars.
    pub cars: Option<u32>,
    /// Rotating-mass factor gamma.
    pub rotating_mass_factor: Option<f64>,
    /// Basic resistance.
    pub resistance: Option<Davis>,
    /// Greatest traction force: (m/s, N), by speed.
    pub traction: Option<Vec<(f64, f64)>>,
    /// Deceleration by all of the brake: (m/s, m/s²), by speed.
    pub brake_mps2: Option<Vec<(f64, f64)>>,
    /// Outcome of the file's fields.
    pub account: Account,
}

/// A line as far as its file gives it, in SI units; a list that is `None` is not known.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportedLine {
    /// By which it is chosen among others.
    pub id: String,
    /// Where it stands.
    pub place: SourcePosition,
    /// Name for people.
    pub name: String,
    /// Length in m.
    pub length_m: f64,
    /// (chainage in m, ‰ climbing positive as the chainage grows).
    pub gradient: Option<Vec<(f64, f64)>>,
    /// Curves.
    pub curves: Option<Vec<TrackCurve>>,
    /// Stops: chainage in m and name.
    pub stops: Vec<(f64, String)>,
    /// (chainage in m, permitted speed in m/s).
    pub permitted_speed: Option<Vec<(f64, f64)>>,
    /// Outcome of the file's fields.
    pub account: Account,
}
