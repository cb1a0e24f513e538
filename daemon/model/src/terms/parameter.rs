//! A number of a term that is estimated.

/// A parameter of a term, as a fit knows it.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Its name in the answer.
    pub name: &'static str,
    /// Least value.
    pub lower: f64,
    /// Greatest value.
    pub upper: f64,
    /// Step for finite differences.
    pub step: f64,
}

impl Parameter {
    /// A parameter with its bounds.
    pub const fn new(name: &'static str, (lower, upper): (f64, f64), step: f64) -> Self {
        Parameter { name, lower, upper, step }
    }
}
