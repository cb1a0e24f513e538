//! The library of effects, declared beforehand: one file for each kind, or for kinds of one law.
//!
//! A kind ([`Effect`]) proposes [`Hypothesis`] structures for the data at hand: certain tunnels, an interval, some
//! windows. A hypothesis changes the forces on the train, for given parameters, by the law of its term
//! ([`dynocar_model::terms`]), and nothing else is needed: the same code fits it, simulates it and predicts with it,
//! and the daemon applies the same law to the entries of the effect in the files. The [`Policy`] of a kind states how
//! the search treats it. A new kind is one file, one line in [`LIBRARY`] and a row among the kinds of
//! `dynocar_shared::vocabulary`.

mod ambient_temperature;
mod bearing_temperature;
mod curve_resistance;
mod dragging_brake;
mod force_gain;
mod gradient_error;
mod gradient_shift;
mod gradient_under_train;
mod lateness;
mod local_resistance;
mod low_adhesion;
mod mass_change;
mod proposal;
mod rotating_mass;
mod tunnel_drag;
mod unknown;
mod usual_errors;
mod wheel_diameter;
mod wind;

use EffectKind::*;
use dynocar_shared::vocabulary::EffectKind;

pub use super::hypothesis::{
    AtBound, Handling, Hypothesis, Nature, On, OnOthers, Past, ReportContext, ReportedValues,
    SharedHypothesis, Turn,
};
pub use gradient_error::map_error;
pub use gradient_under_train::{VerticalCurves, mass_centre, rounded_steps};
pub use proposal::{
    Candidate, Certainty, DeclaredFigure, Effect, Everyday, Policy, Proposal, Whole,
};
pub use usual_errors::{map_error_as_fitted, usual_errors};

/// Every kind, in the order of the search: timing, scales, mass and gain, effects tied to a place, environment,
/// actuators. Forces outside the library come last.
pub const LIBRARY: &[Effect] = &[
    Effect::new(ActuatorDelay, lateness::of_forces, Whole::None).with(&lateness::OF_FORCES),
    Effect::new(BrakeDelay, lateness::of_brake, Whole::None).with(&lateness::OF_BRAKE),
    Effect::new(SpeedDelay, lateness::of_speed, Whole::None).with(&lateness::OF_SPEED),
    Effect::new(WheelDiameter, wheel_diameter::propose, Whole::First).with(&wheel_diameter::POLICY),
    Effect::new(TractionGain, force_gain::of_traction, Whole::First).with(&force_gain::OF_TRACTION),
    Effect::new(BrakeGain, force_gain::of_brake, Whole::None).with(&force_gain::OF_BRAKE),
    Effect::new(MassChange, mass_change::propose, Whole::Of(mass_change::everywhere))
        .with(&mass_change::POLICY),
    Effect::new(RotatingMass, rotating_mass::propose, Whole::First).with(&rotating_mass::POLICY),
    Effect::new(GradientShift, gradient_shift::propose, Whole::Of(gradient_shift::whole))
        .with(&gradient_shift::POLICY),
    Effect::new(GradientError, gradient_error::propose, Whole::None).with(&gradient_error::POLICY),
    Effect::new(CurveResistance, curve_resistance::propose, Whole::First)
        .with(&curve_resistance::POLICY),
    Effect::new(TunnelDrag, tunnel_drag::propose, Whole::Of(tunnel_drag::whole))
        .with(&tunnel_drag::POLICY),
    Effect::new(LocalResistance, local_resistance::propose, Whole::None)
        .with(&local_resistance::POLICY),
    Effect::new(Wind, wind::propose, Whole::First).with(&wind::POLICY),
    Effect::new(AmbientTemperature, ambient_temperature::propose, Whole::First)
        .with(&ambient_temperature::POLICY),
    Effect::new(BearingTemperature, bearing_temperature::propose, Whole::None)
        .with(&bearing_temperature::POLICY),
    Effect::new(DraggingBrake, dragging_brake::propose, Whole::None).with(&dragging_brake::POLICY),
    Effect::new(LowAdhesion, low_adhesion::propose, Whole::None).with(&low_adhesion::POLICY),
    Effect::new(Unknown, unknown::propose_bands, Whole::None).with(&unknown::POLICY),
];
/// Unnamed effects, by their form: tried where the library leaves a force.
pub const UNKNOWN: &Effect =
    &Effect::new(Unknown, unknown::propose_forms, Whole::None).with(&unknown::POLICY);
pub use unknown::{a_form_explains_more, leaves_a_force};

/// Returns the policy in a kind's row of the library; the usual one for a kind without a row.
pub fn policy_of(kind: EffectKind) -> &'static Policy {
    effect_of(kind).map_or(&Policy::USUAL, |it| &it.policy)
}

/// Returns a kind's row of the library; `None` for a kind without one.
pub fn effect_of(kind: EffectKind) -> Option<&'static Effect> {
    LIBRARY.iter().find(|effect| effect.kind == kind)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_is_freed_by_one_kind() {
        let freed: Vec<DeclaredFigure> =
            LIBRARY.iter().flat_map(|it| it.policy.frees).copied().collect();
        assert!((1..freed.len()).all(|k| !freed[k..].contains(&freed[k - 1])), "{freed:?}");
    }

    #[test]
    fn a_kind_that_is_never_certain_is_not_sought_for_certainty() {
        for effect in LIBRARY.iter().filter(|it| it.policy.certainty == Certainty::Never) {
            assert!(!effect.policy.is_sought_with_nuisance, "{:?}", effect.kind);
        }
    }
}
