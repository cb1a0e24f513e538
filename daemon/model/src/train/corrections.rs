//! What measured runs have added to the declared model.

/// Effects of a train and its sensors that a declared model usually lacks, as far as they are
/// known. The default knows of none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corrections {
    /// Measured over true speed, by another wheel diameter than declared.
    pub speed_scale: f64,
    /// The measured speed is so many s late.
    pub speed_delay_s: f64,
    /// And then follows the true one with this time constant in s.
    pub speed_lag_s: f64,
    /// Reported over true traction force.
    pub traction_gain: f64,
    /// The reported forces act so many s later.
    pub actuator_delay_s: f64,
    /// And then build up with this time constant in s.
    pub actuator_lag_s: f64,
    /// Factor on c v² for the part of the train in tunnels.
    pub tunnel_c_factor: f64,
    /// What is added to c for the part of the train in tunnels, in N/kN per (m/s)².
    pub tunnel_dc_n_per_kn_per_mps2: f64,
    /// Headwind in m/s for the direction of growing chainage, outside tunnels.
    pub wind_plus_mps: f64,
    /// Further a in N/kN of cold bearings at the start.
    pub bearing_delta_a_n_per_kn: f64,
    /// Time constant in s with which they warm up.
    pub bearing_tau_s: f64,
    /// Relative change of the basic resistance per kelvin.
    pub ambient_w0_per_k: f64,
    /// Temperature in K at which the basic resistance holds.
    pub ambient_reference_k: f64,
}

impl Corrections {
    /// No correction.
    pub const NONE: Corrections = Corrections {
        speed_scale: 1.0,
        speed_delay_s: 0.0,
        speed_lag_s: 0.0,
        traction_gain: 1.0,
        actuator_delay_s: 0.0,
        actuator_lag_s: 0.0,
        tunnel_c_factor: 1.0,
        tunnel_dc_n_per_kn_per_mps2: 0.0,
        wind_plus_mps: 0.0,
        bearing_delta_a_n_per_kn: 0.0,
        bearing_tau_s: 300.0,
        ambient_w0_per_k: 0.0,
        ambient_reference_k: 288.15,
    };
}

impl Default for Corrections {
    fn default() -> Self {
        Corrections::NONE
    }
}
