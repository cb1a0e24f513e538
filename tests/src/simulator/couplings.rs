//! Couplings between the cars: the leading car, which carries the tacho, does not move as the train does.
//!
//! Inner forces do not move the centre of mass, so the train as a whole moves as if it were rigid. Couplings add the
//! motion of its first car relative to the whole: a chain of masses on springs and dampers, with slack in a freight
//! train, under the forces that act on each car.

use dynocar_model::train::TrainModel;

use super::dynamics::TruePhysics;
use super::settings::TrainType;
use super::train_maker::Car;
use super::true_run::{TRUE_STEP_S, TrueState};

/// Steps of the chain in one true step: its fastest mode has a period of about 0.2 s.
const STEPS: usize = 10;
/// Below this speed in m/s brakes and bearings hold each car.
const HELD_MPS: f64 = 0.05;
/// Damping of a coupling as share of the critical one of two cars.
const DAMPING_RATIO: f64 = 0.15;

/// Returns the stiffness in N/m and slack in m of one coupling.
fn coupling(train_type: TrainType) -> (f64, f64) {
    match train_type {
        TrainType::Freight => (1.2e7, 0.015),
        _ => (1e7, 0.0),
    }
}

/// Returns the share of the traction that a car gives: the locomotive pulls, or the leading third of a multiple unit.
fn traction_share(train_type: TrainType, index: usize, cars: usize) -> f64 {
    let pulling = if train_type == TrainType::Freight { 1 } else { cars.div_ceil(3) };
    if index < pulling { 1.0 / pulling as f64 } else { 0.0 }
}

/// The cars against the centre of mass.
struct Chain {
    masses_kg: Vec<f64>,
    stiffness_n_per_m: f64,
    damping_n_per_mps: f64,
    slack_m: f64,
    ahead_m: Vec<f64>,
    speed_mps: Vec<f64>,
}

impl Chain {
    fn new(train_type: TrainType, cars: &[Car], mass_kg: f64) -> Self {
        let (stiffness_n_per_m, slack_m) = coupling(train_type);
        let masses_kg: Vec<f64> = cars.iter().map(|car| car.mass_share * mass_kg).collect();
        let pair_kg = 0.5 * mass_kg / cars.len() as f64;
        Chain {
            damping_n_per_mps: 2.0 * DAMPING_RATIO * (stiffness_n_per_m * pair_kg).sqrt(),
            ahead_m: vec![0.0; masses_kg.len()],
            speed_mps: vec![0.0; masses_kg.len()],
            masses_kg,
            stiffness_n_per_m,
            slack_m,
        }
    }

    /// Returns the force in N between a car and the one behind it, positive when it pulls.
    fn pull_n(&self, front: usize) -> f64 {
        let apart_m = self.ahead_m[front] - self.ahead_m[front + 1];
        let stretched_m = apart_m - apart_m.clamp(-0.5 * self.slack_m, 0.5 * self.slack_m);
        if stretched_m == 0.0 {
            return 0.0;
        }
        let parting_mps = self.speed_mps[front] - self.speed_mps[front + 1];
        self.stiffness_n_per_m * stretched_m + self.damping_n_per_mps * parting_mps
    }

    /// One true step under the forces in N on each car.
    fn advance(&mut self, forces_n: &[f64]) {
        let step_s = TRUE_STEP_S / STEPS as f64;
        let together_mps2 = forces_n.iter().sum::<f64>() / self.masses_kg.iter().sum::<f64>();
        for _ in 0..STEPS {
            let mut pulled_n = 0.0;
            for car in 0..self.masses_kg.len() {
                let pull_n = if car + 1 < self.masses_kg.len() { self.pull_n(car) } else { 0.0 };
                let own_n = forces_n[car] + pulled_n - pull_n;
                pulled_n = pull_n;
                self.speed_mps[car] += (own_n / self.masses_kg[car] - together_mps2) * step_s;
            }
            for (ahead_m, speed_mps) in self.ahead_m.iter_mut().zip(&self.speed_mps) {
                *ahead_m += speed_mps * step_s;
            }
        }
    }
}

/// Adds the leading car's motion against the train to the speed of its wheels.
pub fn move_leading_car(physics: &TruePhysics<'_>, states: &mut [TrueState]) {
    let (train, plan) = (physics.train, physics.plan);
    let mut chain = Chain::new(train.train_type, &train.cars, plan.mass_kg);
    let mut forces_n = vec![0.0; train.cars.len()];
    for state in states {
        if state.speed_mps < HELD_MPS {
            chain.speed_mps.fill(0.0);
            continue;
        }
        state.wheel_speed_mps = (state.wheel_speed_mps + chain.speed_mps[0]).max(0.0);
        let shared_n =
            state.acting.brake_force_n + state.resistance.ordinary_n + state.resistance.extra_n;
        let weight_n = 1000.0 * TrainModel::weight_kn(state.mass_kg);
        for (index, (car, force_n)) in train.cars.iter().zip(&mut forces_n).enumerate() {
            let car_m = state.position_m + plan.direction * car.ahead_m;
            let gradient = physics.disturbances.gradient.mean_around(car_m, car.length_m) / 1000.0;
            let pulls = traction_share(train.train_type, index, train.cars.len());
            *force_n = pulls * state.acting.traction_force_n
                - car.mass_share * (shared_n + plan.direction * gradient * weight_n);
        }
        chain.advance(&forces_n);
    }
}
