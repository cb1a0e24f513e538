//! The true forces on a train of many cars.

use dynocar_model::train::TrainModel;

use super::disturbances::{DisturbanceInput, Disturbances};
use super::line_maker::SimulatedLine;
use super::run_maker::RunPlan;
use super::train_maker::TrueTrain;

/// The line under a train at one place: each car is subject to the line under it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LineUnderTrain {
    /// Mean gradient in ‰ along the travel, weighted by mass.
    pub gradient_permille: f64,
    /// Mean of 1/R in 1/m, weighted by mass.
    pub curvature_per_m: f64,
    /// Share of the train's length in tunnels.
    pub tunnel_share: f64,
    /// Undeclared local resistance in N/kN, weighted by mass.
    pub local_n_per_kn: f64,
}

/// Values that change from instant to instant besides place and speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimulatedMoment {
    /// Time in s from the run's first sample.
    pub time_s: f64,
    /// Headwind in m/s along the travel, gusts included.
    pub headwind_mps: f64,
    /// Outside temperature in °C.
    pub temperature_degc: f64,
    /// True mass in kg.
    pub mass_kg: f64,
}

/// Resisting forces in N.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SimulatedResistance {
    /// Basic and curve resistance by the true Davis coefficients and the declared curve constant.
    pub ordinary_n: f64,
    /// Force of the undeclared effects.
    pub extra_n: f64,
    /// Weight along the slope.
    pub gradient_n: f64,
}

impl SimulatedResistance {
    /// Returns all together.
    pub fn total_n(&self) -> f64 {
        self.ordinary_n + self.extra_n + self.gradient_n
    }
}

/// The true forces on a train in one run.
#[derive(Clone, Copy, Debug)]
pub struct TruePhysics<'a> {
    /// The train.
    pub train: &'a TrueTrain,
    /// The line.
    pub line: &'a SimulatedLine,
    /// The run.
    pub plan: &'a RunPlan,
    /// Undeclared effects.
    pub disturbances: &'a Disturbances,
}

impl TruePhysics<'_> {
    /// Returns the line under each car, put together.
    pub fn line_under(&self, centre_m: f64) -> LineUnderTrain {
        let track = &self.line.track;
        let mut under = LineUnderTrain::default();
        for car in &self.train.cars {
            let car_m = centre_m + self.plan.direction * car.ahead_m;
            let gradient_permille = self.disturbances.gradient.mean_around(car_m, car.length_m);
            let curvature = track.curvature_per_m(car_m, car.length_m).unwrap_or(0.0);
            let inside = track.tunnel_share(car_m, car.length_m).unwrap_or(0.0);
            under.gradient_permille += car.mass_share * gradient_permille;
            under.curvature_per_m += car.mass_share * curvature;
            under.tunnel_share += car.length_share * inside;
            if let Some(local) = &self.disturbances.local {
                under.local_n_per_kn += car.mass_share * local.mean_around(car_m, car.length_m);
            }
        }
        under.gradient_permille *= self.plan.direction;
        under
    }

    /// Returns everything that holds the train back at a speed in m/s.
    pub fn resistance(
        &self,
        speed_mps: f64,
        under: &LineUnderTrain,
        now: &SimulatedMoment,
    ) -> SimulatedResistance {
        let disturbances = self.disturbances;
        let davis = self.train.resistance;
        let w0_n_per_kn = disturbances.resistance_factor * davis.w0_n_per_kn(speed_mps);
        let declared_k = self.train.declared.curve_constant_n_per_kn_m;
        let ordinary_n_per_kn = w0_n_per_kn + declared_k * under.curvature_per_m;
        let mut all = disturbances.resistance(DisturbanceInput {
            time_s: now.time_s,
            curvature_per_m: under.curvature_per_m,
            tunnel_share: under.tunnel_share,
            headwind_mps: now.headwind_mps,
            degc: Some(now.temperature_degc),
            local_n_per_kn: under.local_n_per_kn,
        });
        all.factor *= disturbances.resistance_factor;
        all.other_n_per_kn =
            disturbances.unlisted_n_per_kn(speed_mps, now.time_s, Some(now.temperature_degc));
        let all_n_per_kn = davis.w0_n_per_kn(speed_mps) + all.extra_n_per_kn(davis, speed_mps);
        let drag_n = disturbances.drag_n(now.time_s);
        let weight_kn = TrainModel::weight_kn(now.mass_kg);
        SimulatedResistance {
            ordinary_n: weight_kn * ordinary_n_per_kn,
            extra_n: weight_kn * (all_n_per_kn - ordinary_n_per_kn) + drag_n,
            gradient_n: weight_kn * under.gradient_permille,
        }
    }
}
