//! Force of a traction drive from its electric power, where the force is not recorded.

/// Share of the electric power that reaches the wheels' rims unless a train says otherwise: motors,
/// converter and gear of drives of the last decades, under load.
pub const EFFICIENCY_DEFAULT: f64 = 0.85;
/// Speed in m/s below which power determines no force unless a train says otherwise: a drive that hardly
/// turns turns most of its power into heat.
pub const POWER_SPEED_MIN_DEFAULT_MPS: f64 = 2.0;

/// A drive that is known by its electric power.
///
/// Pulling, the wheels have the efficiency's share of what the drive takes; in regeneration the
/// drive gives back the same share of what the wheels feed: force = efficiency P / v for P > 0 and
/// P / (efficiency v) for P < 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PowerTrain {
    /// Mechanical power at the rims over the drive's electric power when it pulls, 0 to 1.
    pub efficiency: f64,
    /// Power in W that the vehicle takes in addition to its drive; 0 where the drive's own is recorded.
    pub auxiliary_power_w: f64,
    /// Speed in m/s below which no force is estimated.
    pub speed_min_mps: f64,
}

impl PowerTrain {
    /// Standard deviation of an efficiency that nobody declares: from transformers and gears under a light load to
    /// power that is recorded at the wheels.
    pub const EFFICIENCY_STD: f64 = 0.1;
    /// Efficiencies that make sense.
    pub const EFFICIENCIES: std::ops::RangeInclusive<f64> = 0.3..=1.0;
    /// Powers in kW of what is fed in addition to the drive.
    pub const AUXILIARIES_KW: std::ops::RangeInclusive<f64> = 0.0..=2000.0;

    /// A drive of which nothing is declared.
    pub const USUAL: PowerTrain = PowerTrain {
        efficiency: EFFICIENCY_DEFAULT,
        auxiliary_power_w: 0.0,
        speed_min_mps: POWER_SPEED_MIN_DEFAULT_MPS,
    };

    /// Mechanical power in W at the rims, braking negative, of a recorded power in W.
    pub fn mechanical_w(&self, recorded_w: f64) -> f64 {
        let drive_w = recorded_w - self.auxiliary_power_w;
        if drive_w >= 0.0 { self.efficiency * drive_w } else { drive_w / self.efficiency }
    }

    /// Traction minus brake force of the drive in N at a speed in m/s; `None` where it turns too
    /// slowly for its power to determine the force.
    pub fn force_n(&self, recorded_w: f64, speed_mps: f64) -> Option<f64> {
        let is_known = recorded_w.is_finite() && speed_mps >= self.speed_min_mps;
        is_known.then(|| self.mechanical_w(recorded_w) / speed_mps)
    }

    /// Returns the difference of the traction and the brake force in N, from a recorded power in W at a speed in
    /// m/s, between this drive and another; `None` where either determines none.
    pub fn beyond_n(&self, other: PowerTrain, recorded_w: f64, speed_mps: f64) -> Option<[f64; 2]> {
        let at = |drive: &PowerTrain| drive.force_n(recorded_w, speed_mps);
        let (own_n, other_n) = at(self).zip(at(&other))?;
        Some([own_n.max(0.0) - other_n.max(0.0), other_n.min(0.0) - own_n.min(0.0)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRIVE: PowerTrain =
        PowerTrain { efficiency: 0.8, auxiliary_power_w: 10e3, speed_min_mps: 2.0 };

    #[test]
    fn a_drive_loses_on_the_way_to_the_wheels_and_on_the_way_back() {
        // 100 kW for the drive: 80 kW at 10 m/s.
        assert_eq!(DRIVE.force_n(110e3, 10.0), Some(8000.0));
        // 80 kW come back of 100 kW that the wheels feed.
        assert!((DRIVE.force_n(-70e3, 10.0).unwrap() + 10e3).abs() < 1e-9);
        assert_eq!(DRIVE.force_n(10e3, 10.0), Some(0.0), "auxiliaries alone pull nothing");
    }

    #[test]
    fn a_better_drive_pulls_more_and_brakes_less_for_the_same_power() {
        let better = PowerTrain { efficiency: 1.0, ..DRIVE };
        assert_eq!(better.beyond_n(DRIVE, 110e3, 10.0), Some([2000.0, 0.0]));
        let [traction_n, brake_n] = better.beyond_n(DRIVE, -70e3, 10.0).unwrap();
        assert!(traction_n == 0.0 && (brake_n + 2000.0).abs() < 1e-9, "{brake_n}");
        assert_eq!(better.beyond_n(DRIVE, 110e3, 1.0), None);
    }

    #[test]
    fn a_drive_that_hardly_turns_shows_no_force() {
        assert_eq!(DRIVE.force_n(110e3, 1.99), None);
        assert_eq!(DRIVE.force_n(110e3, f64::NAN), None);
        assert_eq!(DRIVE.force_n(f64::NAN, 10.0), None);
    }
}
