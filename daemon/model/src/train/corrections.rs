//! Corrections of the declared model by measured runs.

/// Lists every correction once, with its value where nothing is corrected.
macro_rules! corrections {
    ($( #[doc = $doc:literal] $name:ident = $none:literal; )*) => {
        /// Effects of a train and its sensors that a declared model usually lacks, as far as they are
        /// known. The default knows of none.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct Corrections { $( #[doc = $doc] pub $name: f64 ),* }

        impl Corrections {
            /// No correction.
            pub const NONE: Corrections = Corrections { $( $name: $none ),* };
        }
    };
}

corrections! {
    /// Measured over true speed, by another wheel diameter than declared.
    speed_scale = 1.0;
    /// Delay of the measured speed in s.
    speed_delay_s = 0.0;
    /// And then follows the true one with this time constant in s.
    speed_lag_s = 0.0;
    /// Reported over true traction force.
    traction_gain = 1.0;
    /// Reported over true brake force.
    brake_gain = 1.0;
    /// Delay of the reported brake force alone in s.
    brake_delay_s = 0.0;
    /// And then builds up and releases with this time constant in s.
    brake_lag_s = 0.0;
    /// Delay of the reported forces in s.
    actuator_delay_s = 0.0;
    /// And then build up with this time constant in s.
    actuator_lag_s = 0.0;
    /// Factor on c v² for the part of the train in tunnels.
    tunnel_c_factor = 1.0;
    /// Addition to c for the part of the train in tunnels, in N/kN per (m/s)².
    tunnel_dc_n_per_kn_per_mps2 = 0.0;
    /// Headwind in m/s for the direction of growing chainage, outside tunnels.
    wind_plus_mps = 0.0;
    /// Further a in N/kN of cold bearings at the start.
    bearing_delta_a_n_per_kn = 0.0;
    /// Time constant in s with which they warm up.
    bearing_tau_s = 300.0;
    /// Relative change of the basic resistance per kelvin.
    ambient_w0_per_k = 0.0;
    /// Temperature in K at which the basic resistance holds.
    ambient_reference_k = 288.15;
}

impl Default for Corrections {
    fn default() -> Self {
        Corrections::NONE
    }
}
