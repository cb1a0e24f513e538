//! Drives, brakes and cylinders: acting forces from the driver's commands.

use dynocar_model::simulate::motion::{DeadTime, lagged};

use super::driving::Controls;
use super::train_maker::TrueTrain;

/// Returns `value` moved towards a goal by at most `change`. Unlike
/// [`motion::slewed`](dynocar_model::simulate::motion::slewed) it may miss the goal by rounding; the numbers of
/// seeded datasets depend on that.
pub(crate) fn slewed(value: f64, goal: f64, change: f64) -> f64 {
    value + (goal - value).clamp(-change, change)
}

/// Jerk-limited commands with first-order actuators behind them.
#[derive(Clone, Debug)]
pub struct Actuators {
    step_s: f64,
    slew_n_per_s: f64,
    command: Controls,
    force: Controls,
    cylinder_pressure_pa: f64,
}

impl Actuators {
    /// Returns the actuators of a train of this mass in kg, at rest with `held_n` of brake force.
    pub fn new(train: &TrueTrain, mass_kg: f64, step_s: f64, held_n: f64) -> Self {
        let held = Controls { traction_force_n: 0.0, brake_force_n: held_n };
        Actuators {
            step_s,
            slew_n_per_s: train.handling.jerk_mps3 * mass_kg,
            command: held,
            force: held,
            cylinder_pressure_pa: friction_pressure_pa(train, held_n, 0.0),
        }
    }

    /// Moves the forces one step towards the driver's wish.
    pub fn advance(&mut self, train: &TrueTrain, wanted: Controls, speed_mps: f64) -> Controls {
        let handling = &train.handling;
        let change_n = self.slew_n_per_s * self.step_s;
        let traction_n = wanted.traction_force_n.min(train.traction_max_n(speed_mps));
        let brake_n = wanted.brake_force_n.min(train.brake_max_n(speed_mps));
        let command = &mut self.command;
        command.traction_force_n = slewed(command.traction_force_n, traction_n, change_n);
        command.brake_force_n = slewed(command.brake_force_n, brake_n, change_n);
        let force = &mut self.force;
        let limit_n = train.traction_max_n(speed_mps);
        force.traction_force_n = settle(
            lagged(
                force.traction_force_n,
                command.traction_force_n,
                self.step_s,
                handling.traction_lag_s,
            )
            .min(limit_n),
            command.traction_force_n,
            1e-3 * train.traction_max_n(0.0),
        );
        force.brake_force_n = settle(
            lagged(force.brake_force_n, command.brake_force_n, self.step_s, handling.brake_lag_s),
            command.brake_force_n,
            1e-3 * train.brake_max_n(0.0),
        );
        let goal_pa = friction_pressure_pa(train, self.force.brake_force_n, speed_mps);
        self.cylinder_pressure_pa =
            lagged(self.cylinder_pressure_pa, goal_pa, self.step_s, handling.cylinder_lag_s);
        self.force
    }

    /// Pressure in Pa in the brake cylinders.
    pub fn cylinder_pressure_pa(&self) -> f64 {
        self.cylinder_pressure_pa
    }
}

/// Lets a force that is all but released end at zero.
fn settle(force_n: f64, command_n: f64, negligible_n: f64) -> f64 {
    if command_n == 0.0 && force_n < negligible_n { 0.0 } else { force_n }
}

/// Cylinder pressure in Pa for the part of a brake force that the electric brake does not give;
/// that fades out between 6 and 2 m/s.
fn friction_pressure_pa(train: &TrueTrain, brake_n: f64, speed_mps: f64) -> f64 {
    let handling = &train.handling;
    let full_n = train.brake_max_n(0.0);
    let fade = ((speed_mps - 2.0) / 4.0).clamp(0.0, 1.0);
    let electric_n = handling.electric_share * fade * full_n;
    let friction_n = (brake_n - electric_n).max(0.0);
    handling.cylinder_pressure_full_pa * friction_n / full_n
}

/// True forces behind reported ones: a dead time and a first-order lag.
#[derive(Clone, Debug)]
pub struct LateForces {
    dead_time: DeadTime<Controls>,
    force: Controls,
    step_s: f64,
    lag_s: f64,
}

impl LateForces {
    /// Forces `delay_s` and `lag_s` behind, from a steady `initial` on.
    pub fn new(delay_s: f64, lag_s: f64, step_s: f64, initial: Controls) -> Self {
        let dead_time = DeadTime::steady(delay_s, step_s, initial);
        LateForces { dead_time, force: initial, step_s, lag_s }
    }

    /// Returns the true forces when these are reported.
    pub fn advance(&mut self, reported: Controls) -> Controls {
        let arrived = self.dead_time.pass(reported);
        let force = &mut self.force;
        force.traction_force_n =
            lagged(force.traction_force_n, arrived.traction_force_n, self.step_s, self.lag_s);
        force.brake_force_n =
            lagged(force.brake_force_n, arrived.brake_force_n, self.step_s, self.lag_s);
        self.force
    }
}
