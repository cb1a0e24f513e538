//! The effects that the monitor looks for, each with one column of the regression.

use crate::pipeline::resistance::regression::UNKNOWNS;
use crate::terms::{SUSPECTS as BANK, Suspect, brake};

/// Columns of the base model: a, b, c, two force scales, the delay.
pub const BASE: usize = UNKNOWNS;
/// Suspects with a column of their own.
pub const SUSPECTS: usize = BANK.len();
/// Onsets of a dragging brake that are kept side by side.
pub const ONSETS: usize = 12;
/// Place of the first onset among the parameters.
pub const FIRST_ONSET: usize = BASE + SUSPECTS;
/// All parameters of the regression.
pub const PARAMETERS: usize = FIRST_ONSET + ONSETS;

/// The suspect behind a parameter beyond the base model.
pub fn suspect_of(parameter: usize) -> &'static Suspect {
    if parameter >= FIRST_ONSET { &brake::SUSPECT } else { &BANK[parameter - BASE] }
}
