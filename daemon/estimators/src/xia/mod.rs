//! Xia 2023: the trajectory of a window of even distances, fitted step by step.
//!
//! - [`deviation`], [`wolfe_newton`]: the paper's method, with its formulas corrected
//! - [`window`]: even distances from samples in time
//! - [`newton`]: the pipeline, with the paper's search or with our own
//! - [`trajectory`]: our own method, over windows and sample by sample

pub mod newton;
pub mod trajectory;
pub mod window;
pub mod wolfe_newton;
