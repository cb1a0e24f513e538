//! Tests of the estimators from samples to snapshots. Pipelines allocate nothing (`allocation`, whose allocator all
//! tests use: it counts by thread).

mod allocation;
mod braking;
mod mass_common;
mod mass_joint;
mod mass_kalman;
mod mass_staged;
mod perfect_sensors;
