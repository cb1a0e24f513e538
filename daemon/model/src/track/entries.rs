//! What stands in the lists of a line.

/// A curve of the line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Curve {
    /// Chainage in m where it starts.
    pub start_m: f64,
    /// Chainage in m where it ends.
    pub end_m: f64,
    /// Radius in m.
    pub radius_m: f64,
}

/// A tunnel of the line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tunnel {
    /// Chainage in m of the lower portal.
    pub start_m: f64,
    /// Chainage in m of the upper portal.
    pub end_m: f64,
}

/// A section between stations on which trains in one direction weigh more or less than declared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassSection {
    /// Chainage in m where it starts.
    pub from_m: f64,
    /// Chainage in m where it ends.
    pub to_m: f64,
    /// Direction of travel, +1 or -1.
    pub direction: f64,
    /// True over declared mass.
    pub mass_factor: f64,
}

impl MassSection {
    /// True at a chainage in m in a direction of travel.
    #[inline]
    pub fn holds(&self, centre_m: f64, direction: f64) -> bool {
        self.direction == direction && (self.from_m..self.to_m).contains(&centre_m)
    }
}
