//! Forces as seen by the acceleration, by least squares over windows of motion.
//!
//! In the mean of a window of a few seconds, (1 + gamma) dv/dt = T/m - B/m - g i - p - q v². With right units the
//! factors of traction T, brake B and gradient i are 1. The resistance p + q v² is free, so that only pronounced
//! accelerations reveal the forces and a wrong declared resistance changes nothing.

use dynocar_shared::resistance::GRAVITY_MPS2;
use nalgebra::{SMatrix, SVector};

/// Traction, brake, gradient, 1, v².
const COLUMNS: usize = 5;
/// Windows that the sums look back over.
const MEMORY: f64 = 400.0;
/// Windows of motion that are enough to judge.
const WINDOWS_MIN: f64 = 12.0;
/// Accelerations in m/s² beyond this are impossible in any unit.
const BELIEVED_MAX: f64 = 1e9;
/// Share of a column's scatter that the others must leave to it.
const OWN_SHARE_MIN: f64 = 1e-3;
/// A factor is known when it is this many of its standard deviations away from 0.
const KNOWN_DEVIATIONS: f64 = 8.0;

/// The means over a window of motion, accelerations in m/s².
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WindowMean {
    /// (1 + gamma) dv/dt.
    pub inertia_mps2: f64,
    /// Traction over mass.
    pub traction_mps2: f64,
    /// Brake force over mass.
    pub brake_mps2: f64,
    /// Weight along the track over mass, climbing positive.
    pub gradient_mps2: f64,
    /// Speed in m/s.
    pub speed_mps: f64,
}

/// Acceleration over the acceleration that the reported traction, brake and gradient would give, where the motion
/// determines it; 1 in right units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Slopes {
    /// Of the traction force.
    pub traction: Option<f64>,
    /// Of the brake force.
    pub brake: Option<f64>,
    /// Of the gradient.
    pub gradient: Option<f64>,
}

/// The factor of one quantity as least squares give it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FittedFactor {
    /// Acceleration over the acceleration that the reported quantity would give.
    pub factor: f64,
    /// Its standard deviation, were the windows' errors independent.
    pub std: f64,
    /// Share of the quantity's scatter that the other ones leave to it.
    pub own_share: f64,
    /// Standard deviation in m/s² of a window about the fit.
    pub scatter_mps2: f64,
}

impl FittedFactor {
    /// Returns whether the other quantities leave enough of the quantity's scatter to tell it from them.
    pub fn is_alone(&self) -> bool {
        self.own_share > OWN_SHARE_MIN
    }

    /// Returns whether the motion determines the factor, at least this number of standard deviations away from 0.
    pub fn is_known(&self, deviations: f64) -> bool {
        self.is_alone() && self.factor.abs() > deviations * self.std
    }
}

/// Sums over the windows lately, or over all of a recorded run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WindowBalance {
    /// Share of the sums that is kept when a window comes in.
    keep: f64,
    gram: SMatrix<f64, COLUMNS, COLUMNS>,
    with_inertia: SVector<f64, COLUMNS>,
    inertia_square: f64,
    windows: f64,
}

impl Default for WindowBalance {
    fn default() -> Self {
        WindowBalance {
            keep: 1.0 - 1.0 / MEMORY,
            gram: SMatrix::zeros(),
            with_inertia: SVector::zeros(),
            inertia_square: 0.0,
            windows: 0.0,
        }
    }
}

impl WindowBalance {
    /// Sums over all windows, for recorded data.
    pub fn of_all() -> Self {
        WindowBalance { keep: 1.0, ..WindowBalance::default() }
    }

    /// Takes in a window.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn push(&mut self, mean: &WindowMean) {
        let row = SVector::from([
            mean.traction_mps2,
            -mean.brake_mps2,
            -mean.gradient_mps2,
            -1.0,
            -mean.speed_mps * mean.speed_mps,
        ]);
        // A value beyond any unit is no measurement.
        if !row.iter().chain([&mean.inertia_mps2]).all(|value| value.abs() < BELIEVED_MAX) {
            return;
        }
        let keep = self.keep;
        self.gram = self.gram * keep + row * row.transpose();
        self.with_inertia = self.with_inertia * keep + row * mean.inertia_mps2;
        self.inertia_square = self.inertia_square * keep + mean.inertia_mps2 * mean.inertia_mps2;
        self.windows = self.windows * keep + 1.0;
    }

    /// Returns the root mean square of the gradients in ‰.
    pub fn gradient_rms_permille(&self) -> f64 {
        1e3 / GRAVITY_MPS2 * (self.gram[(2, 2)] / self.windows.max(1.0)).sqrt()
    }

    /// Returns the factors by least squares, as far as the motion determines them.
    pub fn slopes(&self) -> Slopes {
        let slope =
            |fitted: FittedFactor| fitted.is_known(KNOWN_DEVIATIONS).then_some(fitted.factor);
        let [traction, brake, gradient] = self.fit().unwrap_or_default();
        Slopes { traction: slope(traction), brake: slope(brake), gradient: slope(gradient) }
    }

    /// Returns the factors of traction, brake and gradient by least squares; `None` for too few windows.
    pub fn fit(&self) -> Option<[FittedFactor; 3]> {
        if self.windows < WINDOWS_MIN {
            return None;
        }
        // Each column over its own size: quantities in wrong units differ by many powers of ten.
        let scale =
            self.gram.diagonal().map(|square| if square > 0.0 { square.sqrt() } else { 1.0 });
        let scaled = SMatrix::<f64, COLUMNS, COLUMNS>::from_fn(|i, j| {
            let entry = self.gram[(i, j)] / (scale[i] * scale[j]);
            // A column that is not there stands alone.
            if i == j { entry.max(f64::MIN_POSITIVE) + 1e-9 } else { entry }
        });
        let inverse = scaled.cholesky()?.inverse();
        let right = self.with_inertia.component_div(&scale);
        let solution = inverse * right;
        let left = (self.inertia_square - solution.dot(&right)).max(0.0);
        let variance = left / (self.windows - COLUMNS as f64).max(1.0);
        Some(std::array::from_fn(|column| FittedFactor {
            factor: solution[column] / scale[column],
            std: (variance * inverse[(column, column)]).sqrt() / scale[column],
            own_share: if self.gram[(column, column)] > 0.0 {
                1.0 / inverse[(column, column)]
            } else {
                0.0
            },
            scatter_mps2: variance.sqrt(),
        }))
    }

    /// Adds the windows of another run.
    pub fn add(&mut self, other: &WindowBalance) {
        self.gram += other.gram;
        self.with_inertia += other.with_inertia;
        self.inertia_square += other.inertia_square;
        self.windows += other.windows;
    }

    /// Returns the windows in the sums.
    pub fn windows(&self) -> f64 {
        self.windows
    }
}
