//! Plausibility of samples: wrong units, swapped forces, reversed signs.
//!
//! The same laws judge live samples and recorded runs, both by [`Admission`](crate::pipeline::admission::Admission).
//!
//! # Layout, in the order of the work
//!
//! - `watch`: sample by sample, with [`window_balance`] (forces against acceleration)
//! - [`diagnosis`]: which input fault makes all figures come out as they did
//! - [`input_fault`]: the input faults, their names, severity and words

pub mod diagnosis;
pub mod input_fault;
pub(crate) mod watch;
pub mod window_balance;

pub use diagnosis::DetectedFaults;
pub use input_fault::{DetectedFault, InputFault, Severity};
