//! Rules for a number of a file: the values that it may have, and how a finding is combined with a declared value.

/// How a number that was found is combined with one that is declared already.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Joined {
    /// The found number replaces the declared one.
    Replaced,
    /// They add up.
    Added,
    /// They multiply.
    Multiplied,
}

/// Rule for a number of a file, in the file's unit.
#[derive(Clone, Copy, Debug)]
pub struct NumberRule {
    /// Least and greatest value.
    pub range: [f64; 2],
    /// True where the value lies above the least.
    pub is_above: bool,
    /// True for a whole number.
    pub is_whole: bool,
    /// True where its table must hold it.
    pub is_required: bool,
    /// The rule in words.
    pub allowed: &'static str,
    /// Effect of a finding on a declared value.
    pub joined: Joined,
    /// The number in the model's unit over that in the file's.
    pub factor: f64,
}

impl NumberRule {
    /// From a least to a greatest value; `allowed` says so.
    pub const fn within(least: f64, greatest: f64, allowed: &'static str) -> Self {
        NumberRule {
            range: [least, greatest],
            is_above: false,
            is_whole: false,
            is_required: false,
            allowed,
            joined: Joined::Replaced,
            factor: 1.0,
        }
    }

    /// Above a value, up to a greatest one.
    pub const fn above(below: f64, greatest: f64, allowed: &'static str) -> Self {
        NumberRule { is_above: true, ..Self::within(below, greatest, allowed) }
    }

    /// Returns the same for a number that its table must hold.
    pub const fn required(self) -> Self {
        NumberRule { is_required: true, ..self }
    }

    /// Returns the same for a whole number.
    pub const fn whole(self) -> Self {
        NumberRule { is_whole: true, ..self }
    }

    /// Returns the same for a number that the model holds this many times greater.
    pub const fn times(self, factor: f64) -> Self {
        NumberRule { factor, ..self }
    }

    /// Returns the same for a number to which findings add.
    pub const fn added(self) -> Self {
        NumberRule { joined: Joined::Added, ..self }
    }

    /// Returns the same for a number with which findings multiply.
    pub const fn multiplied(self) -> Self {
        NumberRule { joined: Joined::Multiplied, ..self }
    }

    /// Returns true for a number that may stand in the file.
    pub fn allows(&self, value: f64) -> bool {
        let is_above = !self.is_above || value > self.range[0];
        let is_whole = !self.is_whole || value.fract() == 0.0;
        (self.range[0]..=self.range[1]).contains(&value) && is_above && is_whole
    }

    /// Returns the declared number joined with one that was found.
    pub fn join(&self, declared: f64, found: f64) -> f64 {
        match self.joined {
            Joined::Replaced => found,
            Joined::Added => declared + found,
            Joined::Multiplied => declared * found,
        }
    }
}
