//! When an undeclared effect acts, from the true motion of a simulated run.

use dynocar_tests::simulator::true_run::TrueState;
use dynocar_tests::simulator::{Effect, SimulatedDataset, SimulatedRun};

/// A train that is slower shows little of anything.
pub const MOVING_MPS: f64 = 2.0;
/// Share of the reported brake force below which the rail does not carry it.
const CARRIED_SHARE: f64 = 0.9;

/// Whether any effect of a dataset acts in a state of one of its runs.
pub fn acts(data: &SimulatedDataset, run: &SimulatedRun, state: &TrueState) -> bool {
    let one = |effect: &Effect| one_acts(effect, data, run, state);
    state.speed_mps > MOVING_MPS && data.effects.iter().any(one)
}

fn one_acts(
    effect: &Effect,
    data: &SimulatedDataset,
    run: &SimulatedRun,
    state: &TrueState,
) -> bool {
    let (track, at_m) = (data.track(), state.position_m);
    let length_m = data.declared_train().length_m;
    let disturbances = &run.disturbances;
    match effect {
        Effect::TunnelDrag { .. } => track.tunnel_share(at_m, length_m) > Some(0.0),
        Effect::CurveResistance { .. } => track.curvature_per_m(at_m, length_m) > Some(0.0),
        Effect::DraggingBrake { .. } => disturbances.drag_n(state.time_s) > 0.0,
        Effect::MassChangeSections(_) | Effect::MassChangeWindows(_) => {
            disturbances.effect_mass_factor(state.time_s, at_m) != 1.0
        }
        Effect::LocalResistance { intervals_m, .. } => {
            let is_near = |&(from_m, to_m): &(f64, f64)| {
                (from_m - 0.5 * length_m..=to_m + 0.5 * length_m).contains(&at_m)
            };
            disturbances.local.is_some() && intervals_m.iter().any(is_near)
        }
        Effect::LowAdhesion { .. } => {
            let carried_n = CARRIED_SHARE * state.reported.brake_force_n;
            disturbances.adhesion.is_some() && state.acting.brake_force_n < carried_n
        }
        _ => true,
    }
}
