//! The library as controllers use it, from Rust, C and C++; what allocates is counted in `real_time`,
//! whose allocator is its own.

mod bindings;
mod channels;
mod foreign_controllers;
mod header;
mod quantities;
#[path = "../support/mod.rs"]
mod support;
mod wrong_arguments;
