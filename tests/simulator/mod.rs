//! The simulator of trains, and findings from its recordings.

mod advice;
mod brake_steps;
mod common_to_runs;
mod couplings;
mod drive_power;
mod effects;
mod far_declarations;
mod felt_gradients;
mod files;
mod fits;
mod force_sampling;
mod many_runs;
mod modulated_stops;
mod other_lines;
mod parts;
mod physics;
mod places;
mod plausibility;
mod recorded_days;
mod residual_monitor;
mod rough;
mod stops;
mod survey;
mod surveyed_masses;
mod threads;
