//! Recursive estimators of fixed size, without any knowledge of trains.
//!
//! Sizes are const generics, memory is the structs' own, and no update allocates. Each is
//! tested against its batch least-squares twin.

mod bounded;
mod information;
mod joint_state;
mod line;
mod median;
mod mils;
mod rls;
mod whitening;

pub use bounded::{Bounded, bounded_minimum};
pub use information::SquareRootInformation;
pub use joint_state::JointState;
pub use line::Line;
pub use median::RunningMedian;
pub use mils::{Mils, Penalty};
pub use rls::{Forgetting, Rls, Step};
pub use whitening::{Propagation, Sighting, Whitener};

/// A factorisation failed: a matrix that should be positive definite is not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected a positive definite matrix of finite numbers, found none")]
pub struct NotPositiveDefinite;
