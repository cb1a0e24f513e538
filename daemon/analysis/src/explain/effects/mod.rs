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
mod force_gain;
mod gradient_error;
mod gradient_shift;
mod lateness;
mod local_resistance;
mod low_adhesion;
mod mass_change;
mod proposal;
mod rotating_mass;
mod speed_delay;
mod tunnel_drag;
mod unknown;
mod usual_errors;
mod vertical_curves;
mod wheel_diameter;
mod wind;

use EffectKind::*;
use dynocar_shared::vocabulary::EffectKind;

pub use super::hypothesis::{
    AtBound, Handling, Hypothesis, Nature, On, OnOthers, Past, ReportContext, Reported,
    SharedHypothesis, Turn,
};
pub use gradient_error::map_error;
pub use proposal::{Candidate, Effect, Proposal, Whole};
pub use usual_errors::{map_error_as_fitted, usual_errors};
pub use vertical_curves::vertical_curves;

/// Every kind, in the order of the search: timing, scales, mass and gain, what is tied to a
/// place, environment, actuators. What is in no library comes last.
pub const LIBRARY: &[Effect] = &[
    Effect::new(ActuatorDelay, actuator_delay::of_both, Whole::None),
    Effect::new(BrakeDelay, actuator_delay::of_brake, Whole::None),
    Effect::new(SpeedDelay, speed_delay::propose, Whole::None),
    Effect::new(WheelDiameter, wheel_diameter::propose, Whole::First),
    Effect::new(TractionGain, force_gain::of_traction, Whole::First),
    Effect::new(BrakeGain, force_gain::of_brake, Whole::None),
    Effect::new(MassChange, mass_change::propose, Whole::Of(mass_change::everywhere)),
    Effect::new(RotatingMass, rotating_mass::propose, Whole::First),
    Effect::new(GradientShift, gradient_shift::propose, Whole::Of(gradient_shift::whole)),
    Effect::new(GradientError, gradient_error::propose, Whole::None),
    Effect::new(CurveResistance, curve_resistance::propose, Whole::First),
    Effect::new(TunnelDrag, tunnel_drag::propose, Whole::Of(tunnel_drag::whole)),
    Effect::new(LocalResistance, local_resistance::propose, Whole::None),
    Effect::new(Wind, wind::propose, Whole::First),
    Effect::new(AmbientTemperature, ambient_temperature::propose, Whole::First),
    Effect::new(BearingTemperature, bearing_temperature::propose, Whole::None),
    Effect::new(DraggingBrake, dragging_brake::propose, Whole::None),
    Effect::new(LowAdhesion, low_adhesion::propose, Whole::None),
    Effect::new(Unknown, unknown::propose_bands, Whole::None),
];
/// Unnamed effects, by their form: tried where the library leaves a force.
pub const UNKNOWN: &Effect = &Effect::new(Unknown, unknown::propose_forms, Whole::None);
pub use unknown::{a_form_explains_more, leaves_a_force};
