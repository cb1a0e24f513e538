//! A train and its driver from stop to stop, and the score of each leg.

use dynocar_core::filter::FittedLine;
use dynocar_model::simulate::STANDING_MPS;
use dynocar_model::train::Davis;
use dynocar_shared::stopping::RailAdhesion;
use dynocar_shared::{RailCondition, SampleField, TrainSample, Uncertain};

use super::driver::{DriverMeasurements, LegDriver, Phase};
use super::knowledge::Knowledge;
use super::plan::{PlannedLeg, Planner};
use super::train::Train;

/// Running time of the timetable: its ratio to the shortest one with declared parameters, and the seconds added to
/// that.
const TIMETABLE: (f64, f64) = (1.08, 3.0);
/// Confidence of the bounds of the stopping distance.
pub const CONFIDENCE: f64 = 0.99;
/// Adhesion that a controller assumes where it knows nothing of the rail: a wet one, usually more slippery than the
/// law says.
const UNKNOWN_RAIL: RailAdhesion = RailAdhesion::Law(RailCondition::Wet, Uncertain::new(0.8, 0.12));
/// Exerted over reported brake force, and scale of the adhesion law, in the fixed worst case.
const WORST: (f64, f64) = (0.7, 0.45);
/// Greatest mass over the declared one in the fixed worst case.
const WORST_LOAD: f64 = 1.35;
/// Time in s over which a change of acceleration is felt.
const FELT_S: f64 = 0.5;
/// Time in s after the start of a braking at which its bound is computed again.
const SECOND_LOOK_S: f64 = 5.0;

/// A bound of the stopping distance, and the true distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// The bound in m from the driver's knowledge; `None` where it gives no bound.
    pub bound_m: Option<f64>,
    /// The bound of the fixed worst case in m.
    pub fixed_m: f64,
    /// The true distance in m.
    pub true_m: f64,
}

/// Scores of one driven leg.
#[derive(Clone, Debug, PartialEq)]
pub struct DrivenLeg {
    /// Place of the standing train beyond the stopping point in m.
    pub beyond_m: f64,
    /// Later than the timetable in s.
    pub late_s: f64,
    /// Work in J of the traction at the rims, as for an arrival in time.
    pub energy_j: f64,
    /// Greatest jerk in m/s³, felt over half a second.
    pub jerk_mps3: f64,
    /// Bounds of a full braking where the braking begins and within it.
    pub looks: Vec<Look>,
}

/// A train with its driver.
pub struct Journey {
    /// The train.
    pub train: Train,
    /// None while the train stands at a stop.
    driver: Option<LegDriver>,
    /// Time in s until it leaves.
    standing_s: f64,
    running_s: f64,
    braking_s: f64,
    accelerations: Vec<f64>,
    /// The legs so far; the one that is under way is the last.
    pub legs: Vec<DrivenLeg>,
    looks: Vec<Look>,
    /// Work in J that a second more of running time saves.
    saved_w: f64,
}

impl Journey {
    /// Returns a train about to leave its first stop.
    pub fn new(train: Train) -> Self {
        Journey {
            standing_s: train.standing_s(),
            train,
            driver: None,
            running_s: 0.0,
            braking_s: 0.0,
            accelerations: Vec::new(),
            legs: Vec::new(),
            looks: Vec::new(),
            saved_w: 0.0,
        }
    }

    /// Returns the declared parameters, with the load as it was weighed.
    pub fn declared(&self, sample: &TrainSample) -> Knowledge {
        let declared = &self.train.declared;
        let weighed = sample.get(SampleField::Mass);
        let mass_kg = match weighed {
            Some(mass_kg) => Uncertain::new(mass_kg, 0.03 * mass_kg),
            None => Uncertain::new(declared.mass_kg, 0.08 * declared.mass_kg),
        };
        Knowledge {
            mass_kg,
            rotating_mass_factor: declared.rotating_mass_factor,
            davis: declared.resistance,
            w0_std_n_per_kn: 0.3 * declared.resistance.w0_n_per_kn(sample.speed_mps),
            brake_scale: Uncertain::new(1.0, 0.1),
            rail: None,
        }
    }

    /// Returns whether the driver brakes to the stopping point.
    pub fn is_braking(&self) -> bool {
        self.driver.as_ref().is_some_and(|driver| driver.phase() == Phase::Braking)
    }

    /// Returns the time in s since the train left its stop.
    pub fn running_s(&self) -> f64 {
        self.running_s
    }

    /// Runs one cycle with known parameters.
    ///
    /// The driver drives by `knowledge`; `sure` gives the bound of a stop.
    pub fn proceed(&mut self, sample: &TrainSample, knowledge: &Knowledge, sure: &Knowledge) {
        let cycle_s = self.train.service.cycle_s();
        if self.driver.is_some() {
            return self.run(sample, (knowledge, sure), cycle_s);
        }
        self.standing_s -= cycle_s;
        self.train.apply(-0.4 * self.train.ability.brake_max_n);
        if self.standing_s <= 0.0 {
            self.depart(sample, knowledge, cycle_s);
        }
    }

    fn depart(&mut self, sample: &TrainSample, knowledge: &Knowledge, cycle_s: f64) {
        let (leg, ability) = (self.train.leg(), self.train.ability.clone());
        let declared = self.declared(sample);
        // The timetable is made for the declared mass, not for the mass of the day.
        let usual =
            Knowledge { mass_kg: Uncertain::exact(self.train.declared.mass_kg), ..declared };
        let start = (0.0, 0.0);
        let shortest = Planner { leg: &leg, knowledge: &usual, ability: &ability };
        let shortest_s = shortest.plan(start, 0.0).time_s;
        let due_s = TIMETABLE.0 * shortest_s + TIMETABLE.1;
        let leg = PlannedLeg { due_s, ..leg };
        let truth = self.train.truth();
        self.saved_w = saved_w(&Planner { leg: &leg, knowledge: &truth, ability: &ability }, due_s);
        self.driver = Some(LegDriver::new(leg, ability, cycle_s, *knowledge));
        (self.running_s, self.braking_s) = (0.0, 0.0);
        self.accelerations.clear();
    }

    fn run(
        &mut self,
        sample: &TrainSample,
        (knowledge, sure): (&Knowledge, &Knowledge),
        cycle_s: f64,
    ) {
        let Some(driver) = &mut self.driver else { return };
        self.running_s += cycle_s;
        let measured = DriverMeasurements {
            time_s: self.running_s,
            at_m: self.train.along_m(sample),
            speed_mps: sample.speed_mps,
            force_n: sample.traction_force_n - sample.brake_force_n,
        };
        let force_n = driver.force_n(&measured, knowledge);
        if driver.phase() == Phase::Braking {
            let is_look = self.braking_s == 0.0
                || (self.braking_s < SECOND_LOOK_S && self.braking_s + cycle_s >= SECOND_LOOK_S);
            self.braking_s += cycle_s;
            if is_look && self.train.speed_mps() > 2.0 {
                let look = self.look(sure);
                self.looks.push(look);
            }
        }
        self.accelerations.push(self.train.apply(force_n));
        if self.train.speed_mps() <= 0.0 && self.running_s > 10.0 && self.braking_s > 0.0 {
            self.arrive(cycle_s);
        }
    }

    fn look(&self, knowledge: &Knowledge) -> Look {
        let ability = &self.train.ability;
        let speed_mps = self.train.speed_mps().max(STANDING_MPS);
        let at_m = self.driver.as_ref().map_or(0.0, |driver| driver.estimate().0);
        let slope = |within_m: f64| {
            let leg = self.driver.as_ref().map(LegDriver::leg);
            leg.map_or(0.0, |leg| leg.mean_slope_permille(at_m, at_m + within_m))
        };
        let true_m = self.train.full_braking_m();
        let bound = |knowledge: &Knowledge, rail: RailAdhesion| {
            let level_m =
                0.5 * speed_mps * speed_mps / knowledge.braking_max_mps2(ability, speed_mps);
            let at = (speed_mps, slope(level_m));
            knowledge.bound_m(ability, at, rail, CONFIDENCE).ok()
        };
        let worst = Knowledge {
            mass_kg: Uncertain::exact(WORST_LOAD * self.train.declared.mass_kg),
            rotating_mass_factor: knowledge.rotating_mass_factor,
            davis: Davis { a: 0.0, b: 0.0, c: 0.0 },
            w0_std_n_per_kn: 0.0,
            brake_scale: Uncertain::exact(WORST.0),
            rail: None,
        };
        let worst_rail = RailAdhesion::Law(RailCondition::Wet, Uncertain::exact(WORST.1));
        Look {
            bound_m: bound(knowledge, UNKNOWN_RAIL),
            fixed_m: bound(&worst, worst_rail).unwrap_or(f64::INFINITY),
            true_m,
        }
    }

    fn arrive(&mut self, cycle_s: f64) {
        let Some(driver) = self.driver.take() else { return };
        let late_s = self.running_s - driver.leg().due_s;
        let felt = (FELT_S / cycle_s).round().max(1.0) as usize;
        let jerk = |pair: (&f64, &f64)| (pair.1 - pair.0).abs() / (felt as f64 * cycle_s);
        let later = self.accelerations.iter().skip(felt);
        let jerk_mps3 = self.accelerations.iter().zip(later).map(jerk).fold(0.0, f64::max);
        self.legs.push(DrivenLeg {
            beyond_m: -self.train.left_m(),
            late_s,
            energy_j: self.train.energy_j + late_s * self.saved_w,
            jerk_mps3,
            looks: std::mem::take(&mut self.looks),
        });
        self.train.turn_to_next();
        self.standing_s = self.train.standing_s();
    }
}

/// Work in J that a second more of running time saves around a time in s: the slope of a straight line
/// through some plans.
fn saved_w(planner: &Planner<'_>, due_s: f64) -> f64 {
    let mut line = FittedLine::default();
    for late in [1.0, 1.01, 1.02, 1.03, 1.04] {
        let plan = planner.plan((0.0, 0.0), late * due_s);
        line.push(plan.time_s - due_s, plan.energy_j);
    }
    // A train that is late at its best saves nothing.
    let slope_w = line.slope().filter(|_| line.spread().sqrt() >= 0.01 * due_s);
    slope_w.map_or(0.0, |slope_w| (-slope_w).max(0.0))
}

#[cfg(test)]
mod tests {
    use super::super::deviations::{CONDITIONS, Condition, ORDINARY, Service};
    use super::*;
    use crate::scenarios::world::Traffic;

    fn drive(traffic: Traffic, condition: Condition, knows: bool, stops: usize) -> Vec<DrivenLeg> {
        let service = Service { traffic, condition, cycle_ms: 50 };
        let mut journey = Journey::new(Train::new(service, 7));
        while journey.legs.len() < stops {
            let sample = journey.train.sample();
            let knowledge = if knows { journey.train.truth() } else { journey.declared(&sample) };
            journey.proceed(&sample, &knowledge, &knowledge);
        }
        journey.legs
    }

    #[test]
    fn a_driver_that_knows_its_train_stops_at_the_platform_and_in_time() {
        for traffic in [Traffic::Metro, Traffic::Emu, Traffic::HighSpeed] {
            for leg in drive(traffic, ORDINARY, true, 5) {
                println!("{traffic:?} {leg:?}");
                assert!(leg.beyond_m.abs() < 0.5, "{leg:?}");
                assert!(leg.late_s.abs() < 6.0, "{leg:?}");
                assert!(leg.jerk_mps3 < 1.2, "{leg:?}");
                let looks = leg.looks.iter();
                assert!(looks.clone().count() > 0);
                assert!(looks.clone().all(|look| look.bound_m.unwrap() < look.fixed_m), "{leg:?}");
            }
        }
    }

    #[test]
    fn declared_parameters_cost_time_energy_or_place_but_the_train_arrives() {
        for leg in drive(Traffic::Metro, CONDITIONS[2], false, 5) {
            println!("{leg:?}");
            assert!(leg.beyond_m.abs() < 3.0 && leg.late_s.abs() < 15.0, "{leg:?}");
        }
    }
}
