//! Indices of the coefficients and the speed in vectors and matrices.

use dynocar_shared::Parameter;

/// Davis a.
pub const A: usize = 0;
/// Davis b.
pub const B: usize = 1;
/// Davis c.
pub const C: usize = 2;
/// The speed, last: a step changes only the last row of a triangular factor then.
pub const SPEED: usize = 3;

/// The coefficients in their order.
pub const DAVIS: [Parameter; 3] = [Parameter::DavisA, Parameter::DavisB, Parameter::DavisC];
