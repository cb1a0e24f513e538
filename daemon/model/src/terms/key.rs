//! Where a number of a term stands in the files, and what may stand there.

use super::extra::Extra;
use crate::train::TrainModel;

/// How a number that was found comes to one that is declared already.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Joined {
    /// It takes its place.
    Replaced,
    /// They add up.
    Added,
    /// They multiply.
    Multiplied,
}

/// One number of a term in `train.toml`.
#[derive(Clone, Copy, Debug)]
pub struct Key {
    /// The table that holds it.
    pub table: &'static str,
    /// Its name there.
    pub name: &'static str,
    /// Least and greatest value.
    pub range: [f64; 2],
    /// The range in words.
    pub allowed: &'static str,
    /// What a finding does to a declared value.
    pub joined: Joined,
    /// Its place in a train.
    pub of: fn(&mut TrainModel) -> &mut f64,
}

/// One entry of the files that a finding becomes.
#[derive(Clone, Debug, PartialEq)]
pub enum Entry {
    /// A number of `train.toml`.
    Number(&'static Key, f64),
    /// A number of `[track]` that adds to a declared one.
    TrackNumber(&'static str, f64),
    /// A list of `[track]` that stands alone.
    List(&'static str, Vec<Vec<f64>>),
    /// Further rows of a list of `[track]`.
    Rows(&'static str, Vec<Vec<f64>>),
    /// A further table of `[[extra]]` of `train.toml`.
    Extra(Extra),
}

impl PartialEq for Key {
    fn eq(&self, other: &Self) -> bool {
        (self.table, self.name) == (other.table, other.name)
    }
}

impl Key {
    /// What a train declares.
    pub fn declared(&self, train: &TrainModel) -> f64 {
        *(self.of)(&mut train.clone())
    }

    /// The declared number joined with one that was found.
    pub fn join(&self, declared: f64, found: f64) -> f64 {
        match self.joined {
            Joined::Replaced => found,
            Joined::Added => declared + found,
            Joined::Multiplied => declared * found,
        }
    }

    /// True for a number that may stand in the file.
    pub fn allows(&self, value: f64) -> bool {
        (self.range[0]..=self.range[1]).contains(&value)
    }
}
