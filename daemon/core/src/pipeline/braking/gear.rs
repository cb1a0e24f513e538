//! From cylinder pressure to brake force.

use dynocar_model::train::BrakeGear;

/// The brake gear with every quantity declared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeclaredGear {
    /// Brake force in N at the wheel rim per Pa of cylinder pressure, friction and ratio 1.
    force_n_per_pa: f64,
    /// Declared friction coefficient between pad and disc.
    pub friction: f64,
    /// Declared braking ratio.
    pub ratio: f64,
}

impl DeclaredGear {
    /// The gear, `None` while a quantity is not declared or not positive.
    pub fn of(gear: &BrakeGear) -> Option<Self> {
        let positive = |value: Option<f64>| value.filter(|v| v.is_finite() && *v > 0.0);
        let diameter_m = 1e-3 * positive(gear.cylinder_diameter_mm)?;
        let lever = positive(gear.disc_radius_mm)? / positive(gear.wheel_radius_mm)?;
        let area_m2 = std::f64::consts::FRAC_PI_4 * diameter_m * diameter_m;
        let force_n_per_pa = lever * area_m2 * positive(gear.efficiency)? * positive(gear.pads)?;
        let (friction, ratio) = (positive(gear.friction)?, positive(gear.ratio)?);
        Some(DeclaredGear { force_n_per_pa, friction, ratio })
    }

    /// Brake force in N at a cylinder pressure in Pa.
    ///
    /// Xie 2019, eq. (4); Jin 2020, eq. (2). R_c is called a wheel diameter there, but the
    /// declared 460 mm is the radius, and only the radius belongs here. In SI units the factor
    /// of 10^-6 is gone (mm² kPa = 10^-6 kN).
    pub fn force_n(&self, pressure_pa: f64, friction: f64, ratio: f64) -> f64 {
        self.force_n_per_pa * pressure_pa.max(0.0) * friction * ratio
    }

    /// Brake force in N at a cylinder pressure in Pa with the declared friction and ratio.
    pub fn declared_force_n(&self, pressure_pa: f64) -> f64 {
        self.force_n(pressure_pa, self.friction, self.ratio)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// CRH3, table 1 of both papers, with 95 pads.
    pub(crate) fn crh3() -> BrakeGear {
        BrakeGear {
            cylinder_diameter_mm: Some(203.0),
            disc_radius_mm: Some(297.6),
            wheel_radius_mm: Some(460.0),
            efficiency: Some(0.85),
            ratio: Some(2.55),
            friction: Some(0.28),
            pads: Some(95.0),
            friction_brake: None,
        }
    }

    #[test]
    fn the_force_of_the_declared_gear_is_that_of_the_papers() {
        // In mm, kPa and kN, as printed.
        let area_mm2 = std::f64::consts::FRAC_PI_4 * 203.0 * 203.0;
        let printed_kn = area_mm2 * (297.6 / 460.0) * 410.0 * 0.85 * 2.55 * 0.28 * 95.0 * 1e-6;
        let gear = DeclaredGear::of(&crh3()).unwrap();
        assert!((gear.declared_force_n(410_000.0) - 1000.0 * printed_kn).abs() < 1e-6);
        // B/(Mg) as a check on the number of pads, which the papers do not give.
        assert!((printed_kn / (536.0 * 9.8) - 0.0942).abs() < 5e-5);
    }

    #[test]
    fn a_gear_with_a_hole_is_not_declared() {
        let without_pads = BrakeGear { pads: None, ..crh3() };
        assert_eq!(DeclaredGear::of(&without_pads), None);
        let negative = BrakeGear { ratio: Some(-1.0), ..crh3() };
        assert_eq!(DeclaredGear::of(&negative), None);
    }

    #[test]
    fn a_pressure_below_zero_exerts_no_force() {
        let gear = DeclaredGear::of(&crh3()).unwrap();
        assert_eq!(gear.declared_force_n(-2_000.0), 0.0);
    }
}
