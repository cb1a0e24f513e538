//! How a declared gradient may be wrong, before the data: a Gaussian process along the line.

/// Size and length of the errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorScale {
    /// Standard deviation in ‰.
    pub permille: f64,
    /// Length in m over which the error changes.
    pub length_m: f64,
}

/// A map drawn from altitudes, with a wrong vertical curve or a smoothed hill.
pub const MAP: ErrorScale = ErrorScale { permille: 1.5, length_m: 1500.0 };
/// Remaining error of a usual survey: short pieces, each a little wrong.
pub const SURVEYED: ErrorScale = ErrorScale { permille: 0.1, length_m: 600.0 };
/// A line whose gradient nobody surveyed: a railway's, and a street's in hills.
pub const UNSURVEYED: [ErrorScale; 2] =
    [ErrorScale { permille: 8.0, length_m: 600.0 }, ErrorScale { permille: 25.0, length_m: 200.0 }];
