//! Settings of [`super::JointLeastSquares`].

use dynocar_core::pipeline::motion::MOVING_MPS;
use dynocar_core::settings;

use super::bias_model::BiasModel;
use super::line_resistance::DEFAULT_REFERENCE_RADIUS_M;

/// Number of behaviours of the unexplained acceleration.
pub const JOINT_MODELS: usize = 6;

settings! {
    /// Settings of [`super::JointLeastSquares`].
    #[derive(Copy)]
    JointLeastSquaresSettings {
        /// Standard deviation of the declared mass in %.
        mass_std_percent: f64 = 20.0 => (0.0001 to 50);
        /// Standard deviation in % of a change of mass at a stop; 0 when it never changes.
        mass_change_std_percent: f64 = 10.0 => (0 to 50);
        /// Shortest stop in s at which the mass may change.
        stop_min_s: f64 = 5.0 => (0 to 3600);
        /// Standard deviation in N/kN of the declared resistances.
        resistance_std_n_per_kn: f64 = 5.0 => (0.001 to 100);
        /// Standard deviation of the measured speed in m/s to start with; it is learned.
        speed_noise_mps: f64 = 0.02 => (0.001 to 1);
        /// Standard deviation in m/s² of an acceleration that no parameter explains.
        bias_std_mps2: f64 = 0.01 => (0.0001 to 0.5);
        /// Lowest speed in m/s that is used.
        speed_min_mps: f64 = MOVING_MPS => (0.3 to 20);
        /// Radius in m that the curve resistance refers to.
        reference_radius_m: f64 = DEFAULT_REFERENCE_RADIUS_M => (50 to 10000);
        /// Standard deviation of the mass in % up to which it may be used.
        usable_std_percent: f64 = 2.0 => (0.01 to 50);
        /// Standard deviation in N/kN of the basic resistance up to which it may be used.
        usable_std_n_per_kn: f64 = 0.3 => (0.001 to 10);
    }
}

impl JointLeastSquaresSettings {
    /// The behaviours of the unexplained acceleration: none; slow in proportion to speed; small
    /// and large, each slow and gusty. A constant is z1's to explain, so that 'none' stays far
    /// below what a leg measures of an acceleration, 1e-5 m/s²: otherwise every leg would have a
    /// constant of its own, and what the legs show together would count as less than it is.
    pub fn bias_models(&self) -> [BiasModel; JOINT_MODELS] {
        let model =
            |share: f64, time_s, grows| BiasModel::new(share * self.bias_std_mps2, time_s, grows);
        [
            model(1e-4, f64::INFINITY, false),
            model(1.0, 60.0, true),
            model(0.3, 60.0, false),
            model(0.3, 10.0, false),
            model(1.0, 60.0, false),
            model(1.0, 10.0, false),
        ]
    }
}
