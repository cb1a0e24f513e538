//! What a force may depend on.

use crate::named;

named! {
    /// A quantity known at every sample, or at some.
    Covariate ("in files and answers, with the unit") {
        /// Speed in m/s.
        Speed "speed_mps";
        /// Chainage in m.
        Chainage "chainage_m";
        /// Time in s since the train was cold, as its bearings count it.
        TimeSinceStart "time_since_start_s";
        /// Reported traction force in N.
        TractionForce "traction_force_n";
        /// Reported brake force in N.
        BrakeForce "brake_force_n";
        /// Outside temperature in °C.
        Temperature "ambient_temperature_degc";
    }
}
