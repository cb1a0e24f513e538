//! The brake as train protection asks for it: steps of deceleration, how far stops fall short of them, and tables
//! of stopping distances.

mod components;
mod etcs;
mod parameters;
mod speed_steps;
mod stopping_table;

pub use components::{Weakest, weakest, weakest_plain};
pub use etcs::{Basis, DeclaredBrakeFigures, EtcsBrake, read};
pub use parameters::{
    BrakeParameters, Correction, LEVELS, corrections, lower_bound, usual, wet_share,
};
pub use speed_steps::{STEPS_MAX, SpeedSteps};
pub use stopping_table::{HEAD, StoppingTableRow, TableLaw, parse, write};
