//! Wheel-rail adhesion over speed: the laws that controllers and estimators share.

/// A value with its standard deviation, both in the unit of the value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Uncertain {
    /// The value.
    pub value: f64,
    /// Its standard deviation; 0 when it is known exactly.
    pub std: f64,
}

impl Uncertain {
    /// Returns a value with its standard deviation.
    pub const fn new(value: f64, std: f64) -> Self {
        Uncertain { value, std }
    }

    /// Returns a value known exactly.
    pub const fn exact(value: f64) -> Self {
        Uncertain { value, std: 0.0 }
    }
}

const KMH_PER_MPS: f64 = 3.6;

/// Adhesion as a function of speed, offset + numerator / (pole + v) with v in km/h.
///
/// The two laws are those of Xie 2019, section 3.1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum RailCondition {
    /// 0.06 + 46.6 / (260 + v).
    Dry,
    /// 0.04 + 13.7 / (120 + v).
    Wet,
}

impl RailCondition {
    /// Offset, numerator and pole in km/h.
    const fn coefficients(self) -> [f64; 3] {
        match self {
            RailCondition::Dry => [0.06, 46.6, 260.0],
            RailCondition::Wet => [0.04, 13.7, 120.0],
        }
    }

    /// Adhesion coefficient at a speed in m/s.
    pub fn adhesion(self, speed_mps: f64) -> f64 {
        let [offset, numerator, pole_kmh] = self.coefficients();
        offset + numerator / (pole_kmh + KMH_PER_MPS * speed_mps)
    }

    /// Derivative of the adhesion coefficient by speed, in s/m.
    pub fn adhesion_slope_s_per_m(self, speed_mps: f64) -> f64 {
        let [_, numerator, pole_kmh] = self.coefficients();
        let distance = pole_kmh + KMH_PER_MPS * speed_mps;
        -KMH_PER_MPS * numerator / (distance * distance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_laws_give_the_values_that_xie_2019_states() {
        let at = |condition: RailCondition, kmh: f64| condition.adhesion(kmh / 3.6);
        assert!((at(RailCondition::Dry, 300.0) - 0.1432).abs() < 5e-5);
        assert!((at(RailCondition::Dry, 250.0) - 0.1514).abs() < 5e-5);
        assert!((at(RailCondition::Wet, 300.0) - 0.0726).abs() < 5e-5);
        assert!((at(RailCondition::Wet, 250.0) - 0.0770).abs() < 5e-5);
        assert!((at(RailCondition::Wet, 100.0) - 0.1023).abs() < 5e-5);
        assert!((at(RailCondition::Wet, 50.0) - 0.1206).abs() < 5e-5);
    }

    #[test]
    fn the_slope_is_the_derivative() {
        for condition in [RailCondition::Dry, RailCondition::Wet] {
            for speed_mps in [0.0, 12.0, 80.0] {
                let step = 1e-4;
                let difference = (condition.adhesion(speed_mps + step)
                    - condition.adhesion(speed_mps - step))
                    / (2.0 * step);
                assert!((condition.adhesion_slope_s_per_m(speed_mps) - difference).abs() < 1e-10);
            }
        }
    }
}
