//! The true forces on a train of many cars.

use dynocar_core::train::TrainModel;

use super::disturbances::Disturbances;
use super::line_maker::Line;
use super::run_maker::RunPlan;
use super::train_maker::TrueTrain;

/// What the line does to a train at one place: each car feels what is under it.
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

/// What changes from instant to instant besides place and speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instant {
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
pub struct Resistance {
    /// Basic and curve resistance by the true Davis coefficients and the declared curve constant.
    pub ordinary_n: f64,
    /// What the undeclared effects add.
    pub extra_n: f64,
    /// Weight along the slope.
    pub gradient_n: f64,
}

impl Resistance {
    /// All together.
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
    pub line: &'a Line,
    /// The run.
    pub plan: &'a RunPlan,
    /// What is undeclared in it.
    pub disturbances: &'a Disturbances,
}

impl TruePhysics<'_> {
    /// The line under each car, put together.
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

    /// Everything that holds the train back at a speed in m/s.
    pub fn resistance(&self, speed_mps: f64, under: &LineUnderTrain, now: &Instant) -> Resistance {
        let disturbances = self.disturbances;
        let declared_k = self.train.declared.curve_constant_n_per_kn_m;
        let davis = self.train.resistance;
        let w0_n_per_kn = disturbances.resistance_factor * davis.w0_n_per_kn(speed_mps);
        let air_mps = speed_mps + now.headwind_mps;
        let outside = 1.0 - under.tunnel_share;
        let mut extra_n_per_kn = under.local_n_per_kn
            + (disturbances.curve_constant_n_per_kn_m - declared_k) * under.curvature_per_m
            + davis.c
                * (disturbances.tunnel_c_factor - 1.0)
                * under.tunnel_share
                * speed_mps.powi(2)
            + davis.c * outside * (air_mps * air_mps.abs() - speed_mps * speed_mps);
        if let Some((delta_a, tau_s)) = disturbances.cold_bearings {
            extra_n_per_kn += delta_a * (-now.time_s / tau_s).exp();
        }
        if let Some((w0_per_k, reference_k)) = disturbances.ambient {
            extra_n_per_kn +=
                w0_n_per_kn * w0_per_k * (now.temperature_degc + 273.15 - reference_k);
        }
        if let Some(band) = disturbances.speed_band {
            let away = (speed_mps - band.centre_mps) / band.width_mps;
            extra_n_per_kn += band.extra_n_per_kn * (-0.5 * away * away).exp();
        }
        let drag_n = disturbances.drag_n(now.time_s);
        let weight_kn = TrainModel::weight_kn(now.mass_kg);
        Resistance {
            ordinary_n: weight_kn * (w0_n_per_kn + declared_k * under.curvature_per_m),
            extra_n: weight_kn * extra_n_per_kn + drag_n,
            gradient_n: weight_kn * under.gradient_permille,
        }
    }
}
