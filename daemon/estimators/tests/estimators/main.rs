//! Estimators from samples to snapshots; that they allocate nothing is shown in `allocation`, whose
//! allocator is its own.

mod braking;
mod mass_common;
mod mass_joint;
mod mass_kalman;
mod mass_staged;
mod perfect_sensors;
