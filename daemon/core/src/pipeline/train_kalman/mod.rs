//! `train_kalman`: running resistance and mass of a train as one estimate.
//!
//! With u the declared mass over the true one the balance of forces is linear in the unknowns:
//!
//! ```text
//! s dv/dt = u ((1 + t) traction - (1 + r) brake) - known - (a + b v + c v²) - d,   s = 1000 (1 + gamma) / g
//! ```
//!
//! in N per kN of weight: traction and braking determine u, coasting and cruising a, b, c, gradients both. An estimator
//! that took the mass for exact would put its error into the resistance, and the other way round; here each is known as
//! well as the other allows, and their covariance says how they depend on each other.

use dynocar_model::terms::{brake as usual_brake, delay, masses, traction};

use crate::settings;

pub use estimator::TrainKalman;
pub use learned_state::declared_a_std;

mod brake;
mod estimator;
mod forces;
mod learned_state;
#[cfg(test)]
mod load_tests;
mod motion_bank;
mod motion_filter;
mod report;
mod step_builder;
#[cfg(test)]
mod tests;
mod weigher;

settings! {
    /// Settings of [`TrainKalman`].
    #[derive(Copy)]
    TrainKalmanSettings {
        /// Standard deviation in % of a mass that the samples carry, as weighed; 0 where it is exact.
        mass_std_percent: f64 = 100.0 * masses::WEIGHED_STD => (0 to 50);
        /// Standard deviation in % of the train's declared mass where the samples carry none: from
        /// empty to full.
        load_std_percent: f64 = 15.0 => (0 to 50);
        /// Standard deviation in % by which the load changes at a stop where the samples carry no mass.
        load_change_std_percent: f64 = 10.0 => (0 to 50);
        /// Shortest stop in s at which the load may change.
        stop_min_s: f64 = 1.0 => (0 to 3600);
        /// Standard deviation of each declared coefficient of resistance as a share of it.
        prior_relative_std: f64 = 0.4 => (0.001 to 10);
        /// Random walk of the resistance in N/kN over an hour of motion: weather, wear.
        drift_n_per_kn_per_sqrt_h: f64 = 0.01 => (0 to 10 "N/kN");
        /// Standard deviation of the scale of the traction force: 0.01 is 1 %.
        force_scale_std: f64 = traction::USUAL_STD => (0.000001 to 0.5);
        /// Standard deviation of the brake force as a share of the reported force: friction changes with heat, moisture
        /// and wear, and is blended with an electric brake.
        brake_scale_std: f64 = 0.3 => (0.000001 to 1);
        /// Time in s within which the brake follows its report, as a time constant; a faster one is none
        /// the worse.
        brake_lag_s: f64 = usual_brake::SLOWEST_S => (0.01 to 60 "s");
        /// Standard deviation in m/s of the wind of the day along the line; gusts have half of it.
        wind_std_mps: f64 = 1.5 => (0 to 20 "m/s");
        /// Standard deviation in s of the delay of a force behind its report.
        force_delay_std_s: f64 = delay::USUAL_STD_S => (0.000001 to 5 "s");
        /// Standard deviation of the scale of accelerations, by wheel diameter and rotating mass,
        /// which nothing here can find: 0.003 is 0.3 %.
        acceleration_scale_std: f64 = 0.0025 => (0 to 0.1);
        /// Standard deviation in ‰ of gradients along a line for which no survey states one, of
        /// which every passage is the same.
        gradient_std_permille: f64 = 0.1 => (0 to 10 "‰");
        /// Standard deviation of the measured speed in m/s to start with; it is learned.
        speed_noise_mps: f64 = 0.05 => (0.001 to 1 "m/s");
        /// Standard deviation in m of the position against the gradient profile.
        position_std_m: f64 = 3.0 => (0 to 1000 "m");
        /// Lowest speed in m/s that is used: sensors miss slower wheels, and bearings stick.
        speed_min_mps: f64 = 0.5 => (0.3 to 20 "m/s");
    }
}
