//! Settings of [`super::StagedDescent`].

use dynocar_core::pipeline::motion::MOVING_MPS;
use dynocar_core::settings;
use serde::Deserialize;

use super::line_resistance::DEFAULT_REFERENCE_RADIUS_M;

/// What the mass is fitted on; the paper does not say.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MassRegression {
    /// Force on the differentiated speed. Its noise is in the regressor and pulls the mass down:
    /// the shortfall that Table 3 shows.
    #[default]
    ForceOnAcceleration,
    /// The differentiated speed on force, as eq. (27) has it: unbiased.
    AccelerationOnForce,
}

settings! {
    /// Settings of [`super::StagedDescent`].
    #[derive(Copy)]
    StagedDescentSettings {
        /// What the mass is fitted on.
        mass_regression: MassRegression = MassRegression::ForceOnAcceleration;
        /// Samples of the first stages, driven at the declared mass; the mass is learned after.
        resistance_samples: u64 = 28_000 => (0 to 1000000000);
        /// Steps down the gradient with each sample.
        steps_per_sample: u32 = 4 => (1 to 100);
        /// Length of a step relative to the inverse trace of the second derivative.
        rate: f64 = 1.0 => (0.001 to 1.9);
        /// Shortest stop in s at which the mass may change.
        stop_min_s: f64 = 5.0 => (0 to 3600);
        /// Lowest speed in m/s that is used.
        speed_min_mps: f64 = MOVING_MPS => (0.3 to 20);
        /// Least force in N/kN on which mass is learned.
        force_min_n_per_kn: f64 = 5.0 => (0 to 100);
        /// Radius in m that the curve resistance refers to.
        reference_radius_m: f64 = DEFAULT_REFERENCE_RADIUS_M => (50 to 10000);
    }
}
