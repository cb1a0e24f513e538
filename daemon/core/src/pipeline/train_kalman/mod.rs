//! `train_kalman`: running resistance and mass of a train as one estimate.
//!
//! With u the declared mass over the true one the balance of forces is linear in what is unknown:
//!
//! ```text
//! s dv/dt = u ((1 + t) traction - (1 + r) brake) - known - (a + b v + c v²) - d,   s = 1000 (1 + gamma) / g
//! ```
//!
//! in N per kN of weight: traction and braking determine u, coasting and cruising a, b, c, gradients
//! both. Whoever takes the mass for exact puts its error into the resistance, and the other way round;
//! here each is known as well as the other allows, and their covariance says how they depend.

mod acting_forces;
mod bank;
mod behaviour;
mod braking_watch;
mod estimator;
mod jump_share;
mod learned;
mod load;
mod motion_filter;
mod prior;
mod report;
mod settings;
mod steps;
mod systematic;
#[cfg(test)]
mod tests;

pub use estimator::TrainKalman;
pub use settings::TrainKalmanSettings;

/// Standard deviation in N/kN of the declared a before any sample, by default.
pub fn declared_a_std(train: &dynocar_model::train::TrainModel) -> f64 {
    let relative_std = TrainKalmanSettings::default().prior_relative_std;
    prior::Resistance::declared(&train.resistance, relative_std).a_std()
}
