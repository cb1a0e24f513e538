//! Which of the force columns a dataset takes, by their signs.

use super::assignment::Assignment;
use crate::Quantity;

/// A force with more than this share of values below zero is signed.
const SIGNED_SHARE: f64 = 0.02;

/// Settles what a dataset cannot have at once: a signed force beside one that is never negative, a
/// handle beside a force.
pub fn settle(assignment: &mut Assignment) {
    use Quantity::{BrakeForce, BrakeHandle, ControlForce, TractionForce, TractionHandle};
    let is_signed = |assignment: &Assignment, quantity| {
        let signs = assignment.facts(quantity).map(|facts| facts.signs());
        signs.is_some_and(|(up, down)| up > SIGNED_SHARE && down > SIGNED_SHARE)
    };
    if is_signed(assignment, TractionForce)
        && !assignment.has(BrakeForce)
        && !assignment.has(ControlForce)
    {
        let doubt = "its values have both signs: taken for traction minus brake force";
        assignment.rename(TractionForce, ControlForce, doubt);
    }
    let has_both = assignment.has(TractionForce) || assignment.has(BrakeForce);
    if assignment.has(ControlForce) && has_both {
        if assignment.has(TractionForce) {
            assignment.drop(ControlForce, "traction_force is recorded by itself");
        } else if is_signed(assignment, ControlForce) {
            assignment.drop(BrakeForce, "control_force holds the brake force already");
        }
    }
    if assignment.has(ControlForce) && !is_signed(assignment, ControlForce) {
        let doubt = "its values have one sign: taken for the traction force alone";
        assignment.rename(ControlForce, TractionForce, doubt);
    }
    let turned = assignment.facts(BrakeForce).map(|facts| facts.signs());
    if turned.is_some_and(|(up, down)| down > up) {
        assignment.turn(BrakeForce, "its values are negative while it brakes: scale = -1");
    }
    let has_control = assignment.has(ControlForce);
    for (handle, force) in [(TractionHandle, TractionForce), (BrakeHandle, BrakeForce)] {
        if assignment.has(force) || has_control {
            assignment.drop(handle, "the force itself is recorded");
        } else {
            let reason = "a handle is a share of an effort curve, which train.toml must declare \
                          first ([traction] or [brake] effort)";
            assignment.drop(handle, reason);
        }
    }
}
