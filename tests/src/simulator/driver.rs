//! A driver who keeps to the limits, coasts and stops at the stations.

use dynocar_model::simulate::motion::{SimulatedMotion, deceleration_mps2};

use super::driving::{Controls, Driver, TrainOnLine};
use super::line_maker::SimulatedLine;
use super::permitted_speed::{PermittedLeg, PermittedSpeed};
use super::random::SimulatorRandom;
use super::run_maker::RunPlan;
use super::train_maker::TrueTrain;

/// Mode of the driver.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Mode {
    /// Standing until this time in s.
    Standing { until_s: f64 },
    /// Taking traction up to the permitted speed.
    Pulling,
    /// Keeping the speed until this time in s.
    Holding { until_s: f64 },
    /// No force.
    Coasting,
    /// Braking to a lower limit or a stop.
    Braking,
}

/// Closer than this in m to the stop, a train at rest has arrived.
const ARRIVED_M: f64 = 8.0;
/// Gain in 1/s from a speed error to an acceleration.
const SPEED_GAIN_PER_S: f64 = 0.12;

/// A driver of one run, who knows the declared train and line, and corrects by the train's motion.
#[derive(Debug)]
pub struct TrainDriver<'a> {
    train: &'a TrueTrain,
    line: &'a SimulatedLine,
    plan: &'a RunPlan,
    declared: TrainOnLine<'a>,
    random: SimulatorRandom,
    /// Distances travelled in m at the stops.
    stops_m: Vec<f64>,
    next_stop: usize,
    permitted: PermittedSpeed,
    mode: Mode,
}

impl<'a> TrainDriver<'a> {
    /// Returns a driver who stands at the run's start for some seconds.
    pub fn new(
        train: &'a TrueTrain,
        line: &'a SimulatedLine,
        plan: &'a RunPlan,
        random: SimulatorRandom,
    ) -> Self {
        let mut random = random;
        let stops_m: Vec<f64> =
            plan.stops_m.iter().map(|stop_m| (stop_m - plan.start_m).abs()).collect();
        let permitted = permitted_to(train, line, plan, 0.0, stops_m[0]);
        let declared = TrainOnLine {
            train: &train.declared,
            track: Some(&line.track),
            mass_kg: plan.declared_mass_kg(),
            start_m: plan.start_m,
            direction: plan.direction,
        };
        let until_s = random.uniform(5.0, 15.0);
        let mode = Mode::Standing { until_s };
        TrainDriver { train, line, plan, declared, random, stops_m, next_stop: 0, permitted, mode }
    }

    /// Returns the greatest holding force in N.
    pub fn holding_force_n(train: &TrueTrain) -> f64 {
        train.handling.holding_share * train.brake_max_n(0.0)
    }

    fn stop_distance_m(&self, motion: SimulatedMotion) -> f64 {
        self.stops_m[self.next_stop] - motion.distance_m
    }

    /// Permitted speed in m/s when the brakes will have come on.
    fn permitted_ahead_mps(&self, motion: SimulatedMotion) -> f64 {
        let handling = &self.train.handling;
        let ahead_s = 0.5 + handling.brake_lag_s + 0.5 * self.braking_mps2() / handling.jerk_mps3;
        self.permitted.at(motion.distance_m + ahead_s * motion.speed_mps)
    }

    fn braking_mps2(&self) -> f64 {
        self.plan.style.braking_share * self.train.handling.braking_mps2
    }

    fn update_mode(&mut self, time_s: f64, motion: SimulatedMotion) -> bool {
        let (speed_mps, stop_m) = (motion.speed_mps, self.stop_distance_m(motion));
        if let Mode::Standing { until_s } = self.mode {
            if time_s < until_s {
                return true;
            }
            if self.next_stop == self.stops_m.len() - 1 && stop_m < ARRIVED_M {
                return false;
            }
            self.depart(motion);
        }
        if speed_mps == 0.0 && self.mode == Mode::Braking {
            if stop_m < ARRIVED_M {
                let dwell_s = self.plan.style.dwell_s;
                let until_s = time_s + self.random.uniform(dwell_s, 2.0 * dwell_s);
                self.mode = Mode::Standing { until_s };
            } else {
                self.mode = Mode::Pulling;
            }
            return true;
        }
        let target_mps = self.permitted.at(motion.distance_m);
        let ahead_mps = self.permitted_ahead_mps(motion);
        if speed_mps > ahead_mps && (speed_mps > 1.0 || stop_m < ARRIVED_M) {
            self.mode = Mode::Braking;
        }
        match self.mode {
            Mode::Pulling if speed_mps >= target_mps - 0.4 => self.settle_at_speed(time_s),
            Mode::Holding { until_s } if time_s >= until_s => self.settle_at_speed(time_s),
            Mode::Holding { .. } if speed_mps < 0.85 * target_mps => self.mode = Mode::Pulling,
            Mode::Coasting
                if speed_mps
                    < (1.0 - self.plan.style.coasting_band) * ahead_mps.min(target_mps) =>
            {
                self.mode = Mode::Pulling;
            }
            Mode::Braking if speed_mps < ahead_mps - 0.1 && stop_m > 60.0 => {
                self.settle_at_speed(time_s);
            }
            _ => {}
        }
        true
    }

    fn depart(&mut self, motion: SimulatedMotion) {
        if self.stop_distance_m(motion) < ARRIVED_M {
            self.next_stop += 1;
        }
        let stop_m = self.stops_m[self.next_stop];
        self.permitted = permitted_to(self.train, self.line, self.plan, motion.distance_m, stop_m);
        self.mode = Mode::Pulling;
    }

    fn settle_at_speed(&mut self, time_s: f64) {
        self.mode = if self.random.chance(self.plan.style.coasting_share) {
            Mode::Coasting
        } else {
            Mode::Holding { until_s: time_s + self.random.uniform(12.0, 60.0) }
        };
    }

    /// Returns the force in N along the travel that gives an acceleration in m/s², by the declared model.
    fn force_for_n(&self, motion: SimulatedMotion, acceleration_mps2: f64) -> f64 {
        let inertia_kg = self.declared.mass_kg * (1.0 + self.declared.train.rotating_mass_factor);
        let coasting_mps2 = self.declared.acceleration_mps2(motion, Controls::default());
        inertia_kg * (acceleration_mps2 - coasting_mps2)
    }

    /// Returns the deceleration wanted while braking, as an acceleration in m/s².
    fn braking_acceleration_mps2(&self, motion: SimulatedMotion) -> f64 {
        let (speed_mps, stop_m) = (motion.speed_mps, self.stop_distance_m(motion));
        let ordinary_mps2 = self.braking_mps2();
        let for_stop_mps2 = deceleration_mps2((speed_mps, 0.0), (stop_m - 0.3).max(0.4));
        let ahead_mps = self.permitted_ahead_mps(motion);
        let is_falling = self.permitted.at(motion.distance_m) - ahead_mps > 0.02;
        let for_limit_mps2 = if is_falling { ordinary_mps2 } else { 0.0 }
            + SPEED_GAIN_PER_S * (speed_mps - ahead_mps);
        let is_stopping = for_stop_mps2 > 0.7 * ordinary_mps2;
        let wanted_mps2 = if is_stopping { for_stop_mps2 } else { for_limit_mps2 };
        if speed_mps < 0.6 && stop_m < ARRIVED_M {
            return -wanted_mps2.max(0.15 * ordinary_mps2).min(0.6 * ordinary_mps2);
        }
        -wanted_mps2.clamp(0.0, 1.5 * ordinary_mps2)
    }
}

impl Driver for TrainDriver<'_> {
    fn controls(&mut self, time_s: f64, motion: SimulatedMotion) -> Option<Controls> {
        if !self.update_mode(time_s, motion) {
            return None;
        }
        let pull = |force_n: f64| Controls { traction_force_n: force_n, brake_force_n: 0.0 };
        let brake = |force_n: f64| Controls { traction_force_n: 0.0, brake_force_n: force_n };
        let target_mps = self.permitted.at(motion.distance_m).min(self.permitted_ahead_mps(motion));
        let towards_target_mps2 = SPEED_GAIN_PER_S * (target_mps - motion.speed_mps);
        Some(match self.mode {
            Mode::Standing { .. } => brake(Self::holding_force_n(self.train)),
            Mode::Coasting => Controls::default(),
            Mode::Pulling => {
                let greatest_n =
                    self.plan.style.traction_share * self.train.traction_max_n(motion.speed_mps);
                let needed_n = self.force_for_n(motion, 3.0 * towards_target_mps2 + 0.05);
                pull(needed_n.clamp(0.0, greatest_n))
            }
            Mode::Holding { .. } => {
                let force_n = self.force_for_n(motion, towards_target_mps2);
                // Nobody brakes to keep a speed within a notch.
                let notch_n = 0.02 * self.train.brake_max_n(0.0);
                if force_n >= 0.0 {
                    pull(force_n)
                } else if force_n < -notch_n && motion.speed_mps > target_mps + 0.3 {
                    brake(-force_n)
                } else {
                    Controls::default()
                }
            }
            Mode::Braking => {
                let wanted_mps2 = self.braking_acceleration_mps2(motion);
                brake((-self.force_for_n(motion, wanted_mps2)).max(0.0))
            }
        })
    }
}

fn permitted_to(
    train: &TrueTrain,
    line: &SimulatedLine,
    plan: &RunPlan,
    from_m: f64,
    to_m: f64,
) -> PermittedSpeed {
    let leg = PermittedLeg {
        from_m,
        to_m,
        origin_m: plan.start_m,
        direction: plan.direction,
        train_length_m: train.declared.length_m,
        speed_share: plan.style.speed_share,
        speed_max_mps: train.handling.speed_max_mps,
        braking_mps2: plan.style.braking_share * train.handling.braking_mps2,
    };
    PermittedSpeed::new(line, &leg)
}
