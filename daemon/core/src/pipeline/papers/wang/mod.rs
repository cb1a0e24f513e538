//! Wang 2022: resistance on open track, in curves and in tunnels, and then the mass.
//!
//! - `descent`: normalised gradient descent on sums over all samples
//! - `staged`: the paper's stages

mod descent;
mod staged;
mod staged_settings;

pub use staged::StagedDescent;
pub use staged_settings::{MassRegression, StagedDescentSettings};
