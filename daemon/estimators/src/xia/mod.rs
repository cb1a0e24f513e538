//! Xia 2023: the trajectory of a window of even distances, fitted step by step.
//!
//! - [`window`]: even distances from samples in time, and the paper's deviation over them, with its formulas corrected
//! - [`wolfe_newton`]: the paper's search
//! - [`newton`]: the pipeline, with the paper's search or with our own
//! - [`trajectory`]: our own method, over windows and sample by sample

pub mod newton;
pub mod trajectory;
pub mod window;
pub mod wolfe_newton;
