//! The library as controllers use it, from Rust, C and C++. `real_time` counts allocations with an allocator that all
//! tests use: it counts by thread.

mod bindings;
mod channels;
mod foreign_controllers;
mod forks;
mod header;
mod quantities;
mod real_time;
#[path = "../support/mod.rs"]
mod support;
mod wrong_arguments;
