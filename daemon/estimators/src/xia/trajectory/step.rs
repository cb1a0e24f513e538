//! One step of a computed trajectory, with its derivatives.
//!
//! Two rules lead from the speed before a step to the speed after it, under a driving
//! acceleration u that holds over the step and a resistance κ w0(v), κ = g / (1000 (1 + γ)):
//!
//! ```text
//! distance  v'² = v² + 2 Δs (u - κ w0(v))                    Xia 2023, eq. 7
//! time      v'  = v + Δt (u - κ w0(v + ½ Δt (u - κ w0(v))))  midpoint rule
//! ```
//!
//! The distance rule is the paper's: the resistance of a step is that at its start, which is
//! of first order in Δs. The time rule is of second order, so that samples of 1 s do as well as
//! samples of 0.2 s.
//!
//! # Response of a filter's estimate to a disturbance of unit density
//!
//! With the gains that a filter has used, the covariance of its estimate is linear in the densities of the noise.
//! [`UnitDisturbance`] follows the disturbance's part for a density of 1 (m/s)²/s; at the best gains it is also the
//! derivative of the covariance with respect to the density, since the derivative with respect to the gains vanishes.

use dynocar_model::train::Davis;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::SPEED;

/// Measure of a step's size, and thereby the rule that computes the speed after the step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepRule {
    /// Size in m; eq. 7 of Xia 2023.
    Distance,
    /// Size in s; midpoint rule.
    Time,
}

/// A step of constant driving force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrajectoryStep {
    /// Distance in m or time in s, as the rule says; positive.
    pub size: f64,
    /// Acceleration u in m/s² by every known force: traction, brake, gradient, curve, tunnel.
    pub drive_mps2: f64,
    /// κ in m/s² per N/kN, see [`balance`](dynocar_model::force::mps2_per_n_per_kn).
    pub resistance_gain: f64,
}

/// An unbroken trajectory: steps and the speeds measured before, between and after them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionSegment<'a> {
    /// The steps.
    pub steps: &'a [TrajectoryStep],
    /// One speed in m/s more than steps.
    pub speeds_mps: &'a [f64],
}

/// The speed after a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Advance {
    /// Speed in m/s.
    pub speed_mps: f64,
    /// Its derivative with respect to the speed before; k in eq. 13.
    pub by_speed: f64,
    /// Its derivatives with respect to a, b and c at a fixed speed before; -p, -p v and -p v²
    /// in eq. 13-15 (eq. 14 corrected: its first term carries ∂v/∂b).
    pub by_davis: Vector3<f64>,
}

/// A speed in m/s below which a train counts as stopped: no rule leads below it.
pub const STALL_SPEED_MPS: f64 = 0.1;

impl StepRule {
    /// Returns the speed after a step; `None` when the train would stop within it (v'² < 0 in eq. 7).
    #[inline]
    pub fn advance(self, step: &TrajectoryStep, davis: &Davis, speed_mps: f64) -> Option<Advance> {
        match self {
            StepRule::Distance => advance_distance(step, davis, speed_mps),
            StepRule::Time => advance_time(step, davis, speed_mps),
        }
    }

    /// As [`StepRule::advance`], but a train that would stop rolls on at the stall speed: a fit may start from
    /// parameters that stop the train.
    #[inline(always)]
    pub fn advance_or_crawl(
        self,
        step: &TrajectoryStep,
        davis: &Davis,
        speed_mps: f64,
    ) -> (Advance, bool) {
        match self.advance(step, davis, speed_mps) {
            Some(advance) => (advance, false),
            None => (
                Advance { speed_mps: STALL_SPEED_MPS, by_speed: 0.0, by_davis: Vector3::zeros() },
                true,
            ),
        }
    }
}

#[inline]
fn advance_distance(step: &TrajectoryStep, davis: &Davis, speed_mps: f64) -> Option<Advance> {
    let reach = step.resistance_gain * step.size;
    let energy = speed_mps * speed_mps + 2.0 * step.size * step.drive_mps2
        - 2.0 * reach * davis.w0_n_per_kn(speed_mps);
    if !(energy >= STALL_SPEED_MPS * STALL_SPEED_MPS) {
        return None;
    }
    let after_mps = energy.sqrt();
    let inverse = 1.0 / after_mps;
    let p = reach * inverse;
    Some(Advance {
        speed_mps: after_mps,
        by_speed: (speed_mps - reach * slope(davis, speed_mps)) * inverse,
        by_davis: Vector3::new(-p, -p * speed_mps, -p * speed_mps * speed_mps),
    })
}

#[inline]
fn advance_time(step: &TrajectoryStep, davis: &Davis, speed_mps: f64) -> Option<Advance> {
    let reach = step.resistance_gain * step.size;
    let impulse = step.size * step.drive_mps2;
    let middle_mps = speed_mps + 0.5 * (impulse - reach * davis.w0_n_per_kn(speed_mps));
    let after_mps = speed_mps + impulse - reach * davis.w0_n_per_kn(middle_mps);
    if !(middle_mps >= 0.0 && after_mps >= STALL_SPEED_MPS) {
        return None;
    }
    let slope_middle = slope(davis, middle_mps);
    let middle_by_speed = 1.0 - 0.5 * reach * slope(davis, speed_mps);
    // The regressors at the middle, less the resistance's effect on the middle speed itself.
    let inner = 0.5 * reach * slope_middle;
    let through = |at_middle: f64, at_start: f64| -reach * (at_middle - inner * at_start);
    Some(Advance {
        speed_mps: after_mps,
        by_speed: 1.0 - reach * slope_middle * middle_by_speed,
        by_davis: Vector3::new(
            through(1.0, 1.0),
            through(middle_mps, speed_mps),
            through(middle_mps * middle_mps, speed_mps * speed_mps),
        ),
    })
}

/// dw0/dv in N/kN per m/s.
#[inline]
fn slope(davis: &Davis, speed_mps: f64) -> f64 {
    davis.b + 2.0 * davis.c * speed_mps
}

/// Covariance of [a, b, c, v] from a disturbance of unit density.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UnitDisturbance(SMatrix<f64, 4, 4>);

impl UnitDisturbance {
    /// Returns the part of a, b and c.
    pub fn of_davis(&self) -> Matrix3<f64> {
        self.0.fixed_view::<3, 3>(0, 0).into_owned()
    }

    /// The speed has been taken from a measurement alone.
    pub fn anchor(&mut self) {
        self.0.row_mut(SPEED).fill(0.0);
        self.0.column_mut(SPEED).fill(0.0);
    }

    /// A step with the derivatives of the speed after it.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    #[inline]
    pub fn predict(&mut self, by_davis: &Vector3<f64>, by_speed: f64, duration_s: f64) {
        let row = SVector::<f64, 4>::new(by_davis[0], by_davis[1], by_davis[2], by_speed);
        let with_speed = self.0 * row;
        let own = row.dot(&with_speed);
        self.0.set_column(SPEED, &with_speed);
        self.0.set_row(SPEED, &with_speed.transpose());
        self.0[(SPEED, SPEED)] = own + duration_s;
    }

    /// A measurement of the speed that was taken in with a gain.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    #[inline]
    pub fn measure(&mut self, gain: &SVector<f64, 4>) {
        let seen = self.0.column(SPEED).into_owned();
        // (I - K h) U (I - K h)ᵀ, exactly symmetric.
        let taken = seen - gain * (0.5 * seen[SPEED]);
        self.0 -= gain * taken.transpose() + taken * gain.transpose();
    }

    /// Returns the mean of two by the share of the other.
    pub fn mixed(&self, other: &UnitDisturbance, share: f64) -> UnitDisturbance {
        UnitDisturbance(self.0 * (1.0 - share) + other.0 * share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynocar_model::force::mps2_per_n_per_kn;

    const DAVIS: Davis = Davis { a: 0.79, b: 0.0229, c: 0.001493 };

    fn steps() -> [(StepRule, TrajectoryStep); 2] {
        let gain = mps2_per_n_per_kn(0.06);
        [
            (
                StepRule::Distance,
                TrajectoryStep { size: 100.0, drive_mps2: 0.2, resistance_gain: gain },
            ),
            (StepRule::Time, TrajectoryStep { size: 4.0, drive_mps2: -0.3, resistance_gain: gain }),
        ]
    }

    #[test]
    fn derivatives_of_both_rules_match_finite_differences() {
        for (rule, step) in steps() {
            for speed_mps in [12.0, 55.0, 83.0] {
                let at = |davis: Davis, speed| rule.advance(&step, &davis, speed).unwrap();
                let here = at(DAVIS, speed_mps);
                let central = |plus: Advance, minus: Advance, width: f64| {
                    (plus.speed_mps - minus.speed_mps) / (2.0 * width)
                };
                let h = 1e-3;
                let by_speed = central(at(DAVIS, speed_mps + h), at(DAVIS, speed_mps - h), h);
                assert!((by_speed - here.by_speed).abs() < 1e-8, "{rule:?} {speed_mps}");
                let moved = |da: f64, db: f64, dc: f64| {
                    let plus = Davis { a: DAVIS.a + da, b: DAVIS.b + db, c: DAVIS.c + dc };
                    let minus = Davis { a: DAVIS.a - da, b: DAVIS.b - db, c: DAVIS.c - dc };
                    central(at(plus, speed_mps), at(minus, speed_mps), da + db + dc)
                };
                for (i, (difference, size)) in [
                    (moved(1e-3, 0.0, 0.0), 1.0),
                    (moved(0.0, 1e-5, 0.0), 1e2),
                    (moved(0.0, 0.0, 1e-7), 1e4),
                ]
                .into_iter()
                .enumerate()
                {
                    let error = (difference - here.by_davis[i]).abs();
                    assert!(error < 1e-8 * size, "{rule:?} {speed_mps} {i}: {error:e}");
                }
            }
        }
    }

    #[test]
    fn the_time_rule_follows_the_exact_solution_to_second_order() {
        // dv/dt = -κ c v²: v = v0 / (1 + κ c v0 t).
        let davis = Davis { a: 0.0, b: 0.0, c: 0.002 };
        let gain = mps2_per_n_per_kn(0.0);
        let exact = |t: f64| 80.0 / (1.0 + gain * davis.c * 80.0 * t);
        let error = |size: f64| {
            let step = TrajectoryStep { size, drive_mps2: 0.0, resistance_gain: gain };
            let mut speed_mps = 80.0;
            for _ in 0..(64.0 / size) as usize {
                speed_mps = StepRule::Time.advance(&step, &davis, speed_mps).unwrap().speed_mps;
            }
            (speed_mps - exact(64.0)).abs()
        };
        let ratio = error(8.0) / error(4.0);
        assert!((3.5..4.5).contains(&ratio), "{ratio}");
        assert!(error(1.0) < 1e-4);
    }

    #[test]
    fn a_train_that_stops_has_no_speed_after_the_step() {
        let gain = mps2_per_n_per_kn(0.06);
        let brake = TrajectoryStep { size: 100.0, drive_mps2: -1.0, resistance_gain: gain };
        assert_eq!(StepRule::Distance.advance(&brake, &DAVIS, 10.0), None);
        assert_eq!(StepRule::Time.advance(&brake, &DAVIS, 10.0), None);
        let (crawl, is_stalled) = StepRule::Distance.advance_or_crawl(&brake, &DAVIS, 10.0);
        assert!(is_stalled && crawl.speed_mps == STALL_SPEED_MPS);
    }

    #[test]
    fn what_is_not_a_number_stops_the_train() {
        let step = TrajectoryStep { size: f64::NAN, drive_mps2: 0.0, resistance_gain: 0.01 };
        assert_eq!(StepRule::Distance.advance(&step, &DAVIS, 10.0), None);
        assert_eq!(StepRule::Time.advance(&step, &DAVIS, 10.0), None);
    }
}

#[cfg(test)]
mod unit_disturbance_tests {
    use super::{StepRule, *};
    use crate::xia::trajectory::hypothesis::{JumpHypothesis, OutlierModel};
    use crate::xia::trajectory::noise::{LearnedNoise, NoiseModel};
    use crate::xia::trajectory::tests::{FAST, speeds, steps};

    /// Returns the covariance after a run, with its part by the disturbance.
    fn covariance(density: f64) -> (Matrix3<f64>, Matrix3<f64>) {
        let rule = StepRule::Time;
        let steps = steps(rule, 400);
        let speeds = speeds(rule, &steps, &FAST, 30.0);
        let model = NoiseModel {
            speed_noise_mps: 0.1,
            speed_noise_range_mps: (1e-3, 1.0),
            disturbance: density.sqrt(),
            disturbance_range: (0.0, 1.0),
            memory: 1000.0,
            learns_speed_noise: false,
            learns_disturbance: false,
        };
        let std = Vector3::new(0.3, 0.01, 0.0004);
        let mut filter = JumpHypothesis::new(&FAST, &std, LearnedNoise::new(&model));
        filter.anchor(speeds[0]);
        let outliers = OutlierModel { share: 1e-9, density: 0.5 };
        for (step, &speed_mps) in steps.iter().zip(&speeds[1..]) {
            filter.predict(rule, step, step.size, 0.0);
            filter.measure(speed_mps, &model, &outliers);
        }
        (filter.davis_covariance(), filter.unit_disturbance().of_davis())
    }

    #[test]
    fn it_is_the_derivative_of_the_covariance_with_respect_to_the_density() {
        let (density, width) = (1e-4, 1e-6);
        let (more, less) = (covariance(density + width).0, covariance(density - width).0);
        let slope = (more - less) / (2.0 * width);
        let unit = covariance(density).1;
        for i in 0..3 {
            let ratio = unit[(i, i)] / slope[(i, i)];
            assert!((ratio - 1.0).abs() < 1e-3, "{i}: {ratio}");
        }
    }
}
