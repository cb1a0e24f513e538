//! What a force outside the library owes.

/// The library comes first: what is outside must explain more than a known kind.
pub const OUTSIDE_COST: f64 = 10.0;
