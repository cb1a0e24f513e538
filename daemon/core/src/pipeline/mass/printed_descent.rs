//! The descent as Wang 2022 prints it: raw features, one step a sample, learning rate 1e-7.

use nalgebra::Vector3;
use serde::Deserialize;

use super::section::Section;
use crate::train::Davis;

/// Learning rate of section 3.1.
pub const PRINTED_RATE: f64 = 1e-7;
/// A coefficient beyond this has diverged; the printed ones lie below 3.
const DIVERGED: f64 = 1e6;

/// The unit in which the network sees the speed; the paper does not say which.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
pub enum SpeedUnit {
    /// km/h, which Table 1 and Table 2 are in.
    #[default]
    #[serde(rename = "km/h")]
    KilometresPerHour,
    /// m/s.
    #[serde(rename = "m/s")]
    MetresPerSecond,
}

impl SpeedUnit {
    /// How many of the unit are 1 m/s.
    pub fn per_mps(self) -> f64 {
        match self {
            SpeedUnit::KilometresPerHour => 3.6,
            SpeedUnit::MetresPerSecond => 1.0,
        }
    }
}

/// z1, z2 and z3 as the weights of the network, in powers of the raw speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrintedDescent {
    unit: SpeedUnit,
    /// z1, z2, z3 in N/kN with the speed in `unit`.
    weights: [Vector3<f64>; 3],
    steps: u64,
    diverged_after: Option<u64>,
}

impl PrintedDescent {
    /// Starts at a basic resistance and at z2 = z3 = (1, 1, 1), as Table 1.
    pub fn new(unit: SpeedUnit, basic: &Davis) -> Self {
        let factor = unit.per_mps();
        let first = Vector3::new(basic.a, basic.b / factor, basic.c / (factor * factor));
        let rest = Vector3::repeat(1.0);
        PrintedDescent { unit, weights: [first, rest, rest], steps: 0, diverged_after: None }
    }

    /// One step on one sample: eq. (27) with E = (O - target)².
    ///
    /// The network of eq. (19)-(25) computes z · (1, v, v²); with b_j subtracted in (19), the
    /// threshold is -alpha_j, where (22) prints alpha_j. Force and gradient are not among its
    /// inputs: the target is the resistance in N/kN that they leave.
    pub fn learn(&mut self, section: Section, speed_mps: f64, target_n_per_kn: f64) {
        if self.diverged_after.is_some() {
            return;
        }
        let speed = speed_mps * self.unit.per_mps();
        let features = Vector3::new(1.0, speed, speed * speed);
        let mut weights = self.weights[section as usize];
        let known = match section {
            Section::Basic => 0.0,
            Section::Curve | Section::Tunnel => self.weights[0].dot(&features),
        };
        let error = known + weights.dot(&features) - target_n_per_kn;
        weights -= features * (2.0 * error * PRINTED_RATE);
        self.steps += 1;
        if weights.iter().all(|weight| weight.abs() < DIVERGED) {
            self.weights[section as usize] = weights;
        } else {
            self.diverged_after = Some(self.steps);
        }
    }

    /// A polynomial of the speed in m/s; the last one before it diverged.
    pub fn davis(&self, section: Section) -> Davis {
        let factor = self.unit.per_mps();
        let [a, b, c] = self.weights[section as usize].into();
        Davis { a, b: b * factor, c: c * factor * factor }
    }

    /// The number of steps after which a coefficient had diverged.
    pub fn diverged_after(&self) -> Option<u64> {
        self.diverged_after
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE_1_KMH: [f64; 3] = [2.7551, 0.014, 0.00075];

    fn table_1() -> Davis {
        let [a, b, c] = TABLE_1_KMH;
        Davis { a, b: b * 3.6, c: c * 12.96 }
    }

    /// Pulling away on the straight, with a target that the differentiated speed scatters by
    /// 10 N/kN either way.
    fn pull_away(descent: &mut PrintedDescent, section: Section, samples: u32) {
        for k in 0..samples {
            let speed_mps = (0.2 * f64::from(k)).min(27.0);
            let scatter = if k.is_multiple_of(2) { 10.0 } else { -10.0 };
            descent.learn(section, speed_mps, table_1().w0_n_per_kn(speed_mps) + 0.5 + scatter);
        }
    }

    #[test]
    fn the_printed_rate_diverges_within_a_minute_in_kilometres_per_hour() {
        let mut descent = PrintedDescent::new(SpeedUnit::KilometresPerHour, &table_1());
        pull_away(&mut descent, Section::Basic, 300);
        let after = descent.diverged_after().expect("diverged");
        assert!((60..300).contains(&after), "{after}");
        let last = descent.davis(Section::Basic);
        assert!(last.a.is_finite() && last.b.is_finite() && last.c.is_finite());
    }

    #[test]
    fn the_printed_rate_moves_nothing_in_metres_per_second() {
        let mut descent = PrintedDescent::new(SpeedUnit::MetresPerSecond, &table_1());
        pull_away(&mut descent, Section::Basic, 28_000);
        assert_eq!(descent.diverged_after(), None);
        let moved = (descent.davis(Section::Basic).a - table_1().a).abs();
        assert!(moved > 0.0 && moved < 0.01, "of the 0.5 N/kN to learn: {moved}");
    }

    #[test]
    fn the_printed_start_of_z2_is_ten_thousand_newtons_per_kilonewton() {
        let descent = PrintedDescent::new(SpeedUnit::KilometresPerHour, &table_1());
        let w = descent.davis(Section::Curve).w0_n_per_kn(100.0 / 3.6);
        assert!((w - 10_101.0).abs() < 1e-6);
    }
}
