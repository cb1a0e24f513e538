//! Wang 2022.

pub mod sensor;
pub mod shuttle;
