//! The effects that the monitor looks for.
//!
//! Most have a column of the regression each. The delay of the forces is one of the base model's
//! own parameters, and the wheels' diameter is told by positions, without any force.

use dynocar_shared::vocabulary::EffectKind;

use crate::pipeline::resistance::regression::UNKNOWNS;
use crate::terms::speed_band::BANDS;
use crate::terms::{SUSPECTS as TERMS, Suspect, brake};

/// Columns of the base model: a, b, c, two force scales, the delay.
pub const BASE: usize = UNKNOWNS;
/// Suspects with a column of their own.
pub const SUSPECTS: usize = TERMS.len() + BANDS.len();
/// These: the terms, and laws of the speed that none of them follows.
pub const BANK: [Suspect; SUSPECTS] = {
    let mut bank = [BANDS[0]; SUSPECTS];
    let mut place = 0;
    while place < SUSPECTS {
        bank[place] = if place < TERMS.len() { TERMS[place] } else { BANDS[place - TERMS.len()] };
        place += 1;
    }
    bank
};
/// Place of the first band of speed among the parameters.
pub const FIRST_BAND: usize = BASE + TERMS.len();
/// Onsets of a dragging brake that are kept side by side.
pub const ONSETS: usize = 12;
/// Place of the first onset among the parameters.
pub const FIRST_ONSET: usize = BASE + SUSPECTS;
/// All parameters of the regression.
pub const PARAMETERS: usize = FIRST_ONSET + ONSETS;
/// Candidate without a column: forces that act late.
pub const DELAY: usize = PARAMETERS;
/// Candidate without a column: wheels of another diameter.
pub const WHEEL: usize = PARAMETERS + 1;
/// All candidates are those from `BASE` to here.
pub const CANDIDATES: usize = PARAMETERS + 2;

/// The suspect behind a parameter beyond the base model.
pub fn suspect_of(parameter: usize) -> &'static Suspect {
    if parameter >= FIRST_ONSET { &brake::SUSPECT } else { &BANK[parameter - BASE] }
}

/// The effect behind a candidate.
pub fn effect_of(candidate: usize) -> EffectKind {
    match candidate {
        DELAY => EffectKind::ActuatorDelay,
        WHEEL => EffectKind::WheelDiameter,
        parameter => suspect_of(parameter).effect,
    }
}
