//! A measured speed that is late: the true speed of a dead time ago, after a first-order lag.
//!
//! The sensor of the wheels, its filter and its bus cause the delay. To match such a speed, forces, gradient and every
//! resistance must all be taken from the moment at which the speed was true. That distinguishes it from forces that act
//! late, which leave the gradient on time.

use super::delay::{DelayLine, Forces};
use super::wheel::STANDING_MPS;
use super::{Parameter, Resistance};
pub use crate::train::numbers::{SPEED_DELAY as DELAY, SPEED_LAG as LAG};

/// Delay and lag.
pub const PARAMETERS: [Parameter; 2] =
    [Parameter::new("delay_s", (0.0, 4.0), 0.05), Parameter::new("lag_s", (0.0, 4.0), 0.05)];
/// A shorter delay and lag together in s are not distinguishable from forces that act as late as they usually do, where
/// the map is a little off.
pub const LEAST_S: f64 = 0.35;

/// Numbers of a sample that act on the train without being a force of its own: gradient and the parts
/// of the resistance.
const RESISTING: usize = 1 + Resistance::PARTS;

/// Forces on the train when the speed that is measured now was true.
#[derive(Clone, Debug)]
pub struct LateSpeed {
    forces: DelayLine<2>,
    resisting: DelayLine<RESISTING>,
    position_m: DelayLine<1>,
    specific_force_mps2: DelayLine<1>,
    cylinder_pressure_pa: DelayLine<1>,
}

impl LateSpeed {
    /// Behind a speed that is late by a dead time and a lag in s.
    pub fn new(delay_s: f64, lag_s: f64) -> Self {
        LateSpeed {
            forces: DelayLine::new(delay_s, lag_s),
            resisting: DelayLine::new(delay_s, lag_s),
            position_m: DelayLine::new(delay_s, lag_s),
            specific_force_mps2: DelayLine::new(delay_s, lag_s),
            cylinder_pressure_pa: DelayLine::new(delay_s, lag_s),
        }
    }

    /// Forgets all numbers, and starts with another dead time and lag in s.
    pub fn restart(&mut self, delay_s: f64, lag_s: f64) {
        self.forces.restart(delay_s, lag_s);
        self.resisting.restart(delay_s, lag_s);
        self.position_m.restart(delay_s, lag_s);
        self.specific_force_mps2.restart(delay_s, lag_s);
        self.cylinder_pressure_pa.restart(delay_s, lag_s);
    }

    /// Returns the forces in N behind a speed in m/s of a time in ns of a motion segment; `None` while none are known.
    /// A brake on a train that stands moves nothing, and no lag remembers it.
    pub fn forces(
        &mut self,
        at: (i64, u32),
        speed_mps: f64,
        now: Option<Forces>,
    ) -> Option<Forces> {
        self.forces.acting_unless(at, now, |[traction_n, brake_n]| {
            speed_mps <= STANDING_MPS && traction_n <= brake_n
        })
    }

    /// Returns the gradient in ‰ and resistance behind it.
    pub fn resisting(
        &mut self,
        at: (i64, u32),
        (permille, resistance): (f64, Resistance),
    ) -> (f64, Resistance) {
        let mut now = [permille; RESISTING];
        now[1..].copy_from_slice(&resistance.parts());
        let Some([permille, parts @ ..]) = self.resisting.acting(at, Some(now)) else {
            return (permille, resistance);
        };
        (permille, Resistance::of_parts(parts))
    }

    /// Returns the chainage in m where the train was then; `None` while it is not known.
    pub fn position_m(&mut self, at: (i64, u32), now: Option<f64>) -> Option<f64> {
        self.position_m.acting(at, now.map(|m| [m])).map(|[m]| m)
    }

    /// Brake-cylinder pressure in Pa then; `None` while it is not known.
    pub fn cylinder_pressure_pa(&mut self, at: (i64, u32), now: Option<f64>) -> Option<f64> {
        self.cylinder_pressure_pa.acting(at, now.map(|pa| [pa])).map(|[pa]| pa)
    }

    /// Returns the specific force at that time in m/s²; `None` while it is not known.
    pub fn specific_force_mps2(&mut self, at: (i64, u32), now: Option<f64>) -> Option<f64> {
        self.specific_force_mps2.acting(at, now.map(|felt| [felt])).map(|[felt]| felt)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lag_of_a_departing_train_remembers_no_brake_that_held_it() {
        let mut late = LateSpeed::new(0.0, 0.8);
        for k in 0..50 {
            late.forces((k * 100_000_000, 1), 0.0, Some([0.0, 60e3]));
        }
        let mut at = |tenth: i64, forces| late.forces((tenth * 100_000_000, 1), 0.0, Some(forces));
        at(50, [0.0, 0.0]);
        let [traction_n, brake_n] = at(51, [40e3, 0.0]).unwrap();
        assert!(brake_n == 0.0 && (0.0..4e3).contains(&traction_n), "{traction_n} {brake_n}");
    }

    #[test]
    fn everything_that_acts_is_taken_as_it_was_when_the_speed_was_true() {
        let mut late = LateSpeed::new(0.8, 0.0);
        let gradient = |time_s: f64| if time_s < 5.0 { 2.0 } else { 7.0 };
        let curve = |time_s: f64| Resistance { curve_n_per_kn: 0.1 * time_s, ..Resistance::BASIC };
        for k in 0..100 {
            let time_s = f64::from(k) * 0.1;
            let at = ((time_s * 1e9).round() as i64, 1);
            let before_s = (time_s - 0.8).max(0.0);
            let [traction_n, _] = late.forces(at, 20.0, Some([100.0 * time_s, 0.0])).unwrap();
            let (permille, resistance) = late.resisting(at, (gradient(time_s), curve(time_s)));
            let position_m = late.position_m(at, Some(20.0 * time_s)).unwrap();
            assert!((traction_n - 100.0 * before_s).abs() < 1e-6, "{time_s} s");
            assert!((position_m - 20.0 * before_s).abs() < 1e-6, "{time_s} s");
            assert!((resistance.curve_n_per_kn - 0.1 * before_s).abs() < 1e-9, "{time_s} s");
            assert_eq!((resistance.factor, resistance.outside), (1.0, 1.0));
            if (before_s - 5.0).abs() > 0.11 {
                assert!((permille - gradient(before_s)).abs() < 1e-6, "{time_s} s: {permille}");
            }
        }
        assert_eq!(late.forces((11_000_000_000, 1), 20.0, None), None);
        assert_eq!(late.position_m((11_000_000_000, 1), None), None);
    }
}
