//! The brake in the form that train protection requires: steps of deceleration, the shortfall of stops below them, and
//! tables of stopping distances.

mod components;
mod etcs;
mod parameters;
mod stopping_table;

pub use components::{Weakest, weakest, weakest_plain};
pub use etcs::{Basis, DeclaredBrakeFigures, EtcsBrake, read};
pub use parameters::{
    BrakeParameters, Correction, LEVELS, STEPS_MAX, SpeedSteps, corrections, lower_bound, usual,
    wet_share,
};
pub use stopping_table::{HEAD, StoppingTableRow, TableLaw, parse, write};
