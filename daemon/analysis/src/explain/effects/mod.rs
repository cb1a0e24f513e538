//! The library of effects, declared beforehand: one file for each kind.
//!
//! A kind ([`Effect`]) proposes [`Hypothesis`] structures for the data at hand: which tunnels,
//! which interval, which windows. A hypothesis changes the forces on the train for given
//! parameters by the law of its term ([`dynocar_model::terms`]), and nothing else is needed: the same code
//! fits it, simulates it and predicts with it, and the daemon applies the same law to what is
//! written of it into the files. A new kind is one file, one line in [`LIBRARY`] and
//! a row among the kinds of `dynocar_shared::vocabulary`.

mod actuator_delay;
mod ambient_temperature;
mod bearing_temperature;
mod curve_resistance;
mod dragging_brake;
mod gradient_error;
mod gradient_shift;
mod local_resistance;
mod low_adhesion;
mod map_error;
mod mass_change;
mod proposal;
mod rotating_mass;
mod speed_delay;
mod traction_gain;
mod tunnel_drag;
mod unknown;
mod usual_errors;
mod wheel_diameter;
mod wind;

pub use super::hypothesis::{
    AtBound, Hypothesis, OnOthers, Past, ReportContext, Reported, SharedHypothesis, Turn,
};
pub use gradient_error::map_error;
pub use map_error::map_error_as_fitted;
pub use proposal::{Candidate, Effect, Proposal};
pub use usual_errors::usual_errors;

/// Every kind, in the order of the search: timing, scales, mass and gain, what is tied to a
/// place, environment, actuators. What is in no library comes last.
pub const LIBRARY: &[&dyn Effect] = &[
    &actuator_delay::ActuatorDelay,
    &speed_delay::SpeedDelay,
    &wheel_diameter::WheelDiameter,
    &traction_gain::TractionGain,
    &mass_change::MassChange,
    &rotating_mass::RotatingMass,
    &gradient_shift::GradientShift,
    &gradient_error::GradientError,
    &curve_resistance::CurveResistance,
    &tunnel_drag::TunnelDrag,
    &local_resistance::LocalResistance,
    &wind::Wind,
    &ambient_temperature::AmbientTemperature,
    &bearing_temperature::BearingTemperature,
    &dragging_brake::DraggingBrake,
    &low_adhesion::LowAdhesion,
    &unknown::Bands,
];
/// What is in no library, by its form: tried where the library leaves a force.
pub const UNKNOWN: &dyn Effect = &unknown::Forms;
pub use unknown::{OUTSIDE_COST, a_form_explains_more, leaves_a_force};
