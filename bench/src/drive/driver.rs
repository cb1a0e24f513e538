//! An automatic driver: it plans for the timetable, tracks the plan, and brakes along a curve to the
//! stopping point.
//!
//! The integral action is an estimate of the acceleration that the parameters do not explain, from the reported forces
//! and the measured speed: it makes up for wrong parameters within seconds. Forces act late, so each command is
//! computed for the place and speed at which it will act. When the parameters change, the estimate changes with them,
//! so that the force does not jump.

use dynocar_model::simulate::motion::slewed;

use super::knowledge::{Ability, Knowledge};
use super::plan::{BrakingCurve, COASTING_MIN_SHARE, DrivePlan, PlannedLeg, Planner};

/// Greatest bandwidth in rad/s of the estimates of the speed and of the unexplained acceleration.
const OBSERVER_RAD_PER_S: f64 = 0.8;
/// Gain in 1/s with which the measured place corrects the estimated one.
const PLACE_PER_S: f64 = 1.0;
/// Share of the inverse of the lag that corrects an error of the speed, per s.
const SPEED_GAIN: f64 = 0.4;
/// Number of plans on a leg, and the shortest time in s between two plans.
const PLANS: f64 = 12.0;
const REPLAN_MIN_S: f64 = 5.0;
/// Delay from which a coasting train applies traction again: in s, and as a share of the running time.
const LATE: (f64, f64) = (1.5, 0.01);
/// Deceleration in m/s² of a train that is too fast without having to stop.
const REGULATING_MPS2: f64 = 0.3;

/// Phase of a driver's journey.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Accelerates and cruises.
    Driving,
    /// Neither pulls nor brakes.
    Coasting,
    /// Brakes to the stopping point.
    Braking,
}

/// Measurements available to the driver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriverMeasurements {
    /// Time in s since the train may start.
    pub time_s: f64,
    /// Distance in m from where it started.
    pub at_m: f64,
    /// Speed in m/s.
    pub speed_mps: f64,
    /// Traction minus brake force in N as reported.
    pub force_n: f64,
}

/// A driver on one leg from stop to stop.
#[derive(Clone, Debug)]
pub struct LegDriver {
    leg: PlannedLeg,
    ability: Ability,
    cycle_s: f64,
    knowledge: Knowledge,
    phase: Phase,
    plan: DrivePlan,
    next_plan_s: f64,
    /// As steep as when the braking began, or less steep where brake or rail turn out to carry less.
    curve: BrakingCurve,
    /// Estimates: distance in m, speed in m/s, acceleration in m/s² that is not explained.
    at_m: f64,
    speed_mps: f64,
    unexplained_mps2: f64,
    /// Acceleration in m/s² expected from the reported force and the unexplained acceleration.
    acceleration_mps2: f64,
    commanded_mps2: f64,
}

impl LegDriver {
    /// Returns a driver whose train stands at the start of the leg.
    pub fn new(leg: PlannedLeg, ability: Ability, cycle_s: f64, knowledge: Knowledge) -> Self {
        let planner = Planner { leg: &leg, knowledge: &knowledge, ability: &ability };
        let plan = planner.plan((0.0, 0.0), leg.due_s);
        let curve = BrakingCurve::new(&knowledge, &ability, 0.0);
        LegDriver {
            leg,
            ability,
            cycle_s,
            knowledge,
            phase: Phase::Driving,
            plan,
            next_plan_s: 0.0,
            curve,
            at_m: 0.0,
            speed_mps: 0.0,
            unexplained_mps2: 0.0,
            acceleration_mps2: 0.0,
            commanded_mps2: 0.0,
        }
    }

    /// Returns the present phase.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// Returns its estimates of distance in m and speed in m/s.
    pub fn estimate(&self) -> (f64, f64) {
        (self.at_m, self.speed_mps)
    }

    /// Returns the leg.
    pub fn leg(&self) -> &PlannedLeg {
        &self.leg
    }

    /// Returns the force in N, negative for braking, from the measurements and the driver's knowledge.
    pub fn force_n(&mut self, measured: &DriverMeasurements, knowledge: &Knowledge) -> f64 {
        self.take_over(measured, knowledge);
        self.observe(measured);
        if self.phase != Phase::Braking && measured.time_s >= self.next_plan_s {
            self.replan(measured.time_s);
        }
        self.decide();
        let (at_m, speed_mps) = self.ahead();
        let wanted_mps2 = self.wanted_mps2(at_m, speed_mps);
        let most_mps2 = self.ability.jerk_mps3 * self.cycle_s;
        self.commanded_mps2 = slewed(self.commanded_mps2, wanted_mps2, most_mps2);
        let slope = self.leg.slope_permille(at_m);
        let explained_mps2 = self.commanded_mps2 - self.unexplained_mps2;
        let free_n = self.knowledge.force_n(explained_mps2, speed_mps, slope);
        let traction_n = self.ability.traction.force_n(speed_mps);
        let possible_n = free_n.clamp(-self.ability.brake_max_n, traction_n);
        if possible_n != free_n {
            // Only attainable forces are commanded, or the limit of the jerk would start from the others.
            self.commanded_mps2 = self.unexplained_mps2
                + self.knowledge.acceleration_mps2(possible_n, speed_mps, slope);
        }
        possible_n
    }

    /// Other parameters explain more or less of the same motion.
    fn take_over(&mut self, measured: &DriverMeasurements, knowledge: &Knowledge) {
        let slope = self.leg.slope_permille(self.at_m);
        let by = |it: &Knowledge| it.acceleration_mps2(measured.force_n, self.speed_mps, slope);
        if measured.speed_mps > 0.0 {
            self.unexplained_mps2 += by(&self.knowledge) - by(knowledge);
        }
        self.knowledge = *knowledge;
    }

    fn observe(&mut self, measured: &DriverMeasurements) {
        if measured.speed_mps <= 0.0 && self.phase != Phase::Braking {
            (self.at_m, self.speed_mps) = (measured.at_m, 0.0);
            return;
        }
        let slope = self.leg.slope_permille(self.at_m);
        let explained = self.knowledge.acceleration_mps2(measured.force_n, self.speed_mps, slope);
        self.acceleration_mps2 = explained + self.unexplained_mps2;
        let rate = OBSERVER_RAD_PER_S.min(0.5 / self.ability.lag_s);
        let error_mps = measured.speed_mps - self.speed_mps - self.cycle_s * self.acceleration_mps2;
        self.at_m += self.cycle_s * (self.speed_mps + 0.5 * self.cycle_s * self.acceleration_mps2);
        self.speed_mps += self.cycle_s * (self.acceleration_mps2 + 2.0 * rate * error_mps);
        self.unexplained_mps2 += self.cycle_s * rate * rate * error_mps;
        self.at_m += (self.cycle_s * PLACE_PER_S).min(1.0) * (measured.at_m - self.at_m);
        self.speed_mps = self.speed_mps.max(0.0);
    }

    fn replan(&mut self, time_s: f64) {
        let planner =
            Planner { leg: &self.leg, knowledge: &self.knowledge, ability: &self.ability };
        let (from, left_s) = ((self.at_m, self.speed_mps), self.leg.due_s - time_s);
        self.next_plan_s = time_s + (self.leg.due_s / PLANS).max(REPLAN_MIN_S);
        if self.phase == Phase::Coasting {
            let on = planner.run(from, self.plan.cruise_mps, self.at_m);
            if on.time_s <= left_s + LATE.0.max(LATE.1 * self.leg.due_s) {
                return;
            }
            self.phase = Phase::Driving;
        }
        self.plan = planner.plan(from, left_s);
    }

    /// Returns the place in m and speed in m/s when a force that is commanded now acts.
    fn ahead(&self) -> (f64, f64) {
        let lag_s = self.ability.lag_s + 0.5 * self.cycle_s;
        let gained_mps = lag_s * self.acceleration_mps2;
        let speed_mps = (self.speed_mps + gained_mps).max(0.0);
        (self.at_m + lag_s * 0.5 * (self.speed_mps + speed_mps), speed_mps)
    }

    fn decide(&mut self) {
        let (at_m, speed_mps) = self.ahead();
        let curve = BrakingCurve::new(&self.knowledge, &self.ability, speed_mps);
        if self.phase == Phase::Braking {
            self.curve = self.curve.no_steeper_than(curve);
            return;
        }
        self.curve = curve;
        // Until the brake is on by the limit of the jerk, the train goes on for half that time.
        let change_mps2 = curve.deceleration_mps2(speed_mps) + self.commanded_mps2;
        let onset_m = 0.5 * speed_mps * change_mps2.max(0.0) / self.ability.jerk_mps3;
        if self.leg.length_m - at_m - onset_m <= curve.distance_m(speed_mps) {
            self.phase = Phase::Braking;
        } else if self.phase == Phase::Driving && at_m >= self.plan.coast_from_m {
            self.phase = Phase::Coasting;
        }
    }

    fn wanted_mps2(&self, at_m: f64, speed_mps: f64) -> f64 {
        let gain = SPEED_GAIN / self.ability.lag_s;
        let slope = self.leg.slope_permille(at_m);
        let free_mps2 =
            self.knowledge.acceleration_mps2(0.0, speed_mps, slope) + self.unexplained_mps2;
        let towards = |target_mps: f64| (gain * (target_mps - speed_mps)).max(-REGULATING_MPS2);
        match self.phase {
            // A train that is too fast coasts; it brakes only where it exceeds the highest speed.
            Phase::Driving | Phase::Coasting => {
                let share = if self.phase == Phase::Driving { 1.0 } else { COASTING_MIN_SHARE };
                let least = towards(share * self.plan.cruise_mps);
                free_mps2.max(least).min(towards(self.leg.top_mps))
            }
            Phase::Braking => {
                let target_mps = self.curve.speed_mps(self.leg.length_m - at_m);
                gain * (target_mps - speed_mps) - self.curve.deceleration_mps2(target_mps)
            }
        }
    }
}
