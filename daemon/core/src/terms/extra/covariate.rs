//! What a force may depend on.

/// A quantity known at every sample, or at some.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Covariate {
    /// Speed in m/s.
    Speed,
    /// Chainage in m.
    Chainage,
    /// Time in s since the train was cold, as its bearings count it.
    TimeSinceStart,
    /// Reported traction force in N.
    TractionForce,
    /// Reported brake force in N.
    BrakeForce,
    /// Outside temperature in °C.
    Temperature,
}

impl Covariate {
    /// All of them.
    pub const ALL: [Covariate; 6] = [
        Covariate::Speed,
        Covariate::Chainage,
        Covariate::TimeSinceStart,
        Covariate::TractionForce,
        Covariate::BrakeForce,
        Covariate::Temperature,
    ];

    /// Its name in files and answers, with the unit.
    pub const fn name(self) -> &'static str {
        match self {
            Covariate::Speed => "speed_mps",
            Covariate::Chainage => "chainage_m",
            Covariate::TimeSinceStart => "time_since_start_s",
            Covariate::TractionForce => "traction_force_n",
            Covariate::BrakeForce => "brake_force_n",
            Covariate::Temperature => "ambient_temperature_degc",
        }
    }

    /// The covariate of this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Covariate::ALL.into_iter().find(|covariate| covariate.name() == name)
    }
}
