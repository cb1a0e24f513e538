//! What a manoeuvre would show of a, b and c, by the filter that learns them.
//!
//! The covariance of a Kalman filter does not depend on what is measured, only on where the train
//! is driven: so the filter of `trajectory_kalman` itself is driven over the manoeuvre, from the present
//! covariance, with the present noise, measuring just what it expects.

use dynocar_core::force::balance::mps2_per_n_per_kn;
use dynocar_core::pipeline::papers::xia::trajectory::hypothesis::Hypothesis;
use dynocar_core::pipeline::papers::xia::trajectory::index::SPEED;
use dynocar_core::pipeline::papers::xia::trajectory::noise::{LearnedNoise, NoiseModel};
use dynocar_core::pipeline::papers::xia::trajectory::online::OUTLIERS;
use dynocar_core::pipeline::papers::xia::trajectory::step::{Step, StepRule};
use nalgebra::{Matrix3, Vector3};

use super::drive::{Drive, Scene};
use super::noise::Noise;

/// Shortest step in s that is used; samples that come faster are taken together.
const STEP_MIN_S: f64 = 0.2;

/// What a manoeuvre would leave.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forecast {
    /// The manoeuvre.
    pub drive: Drive,
    /// Time in s that it takes.
    pub lasts_s: f64,
    /// Speed in m/s at its end.
    pub end_mps: f64,
    /// Standard deviations of a, b and c after it.
    pub std: Vector3<f64>,
}

/// What is known of a, b and c after a manoeuvre that begins from `covariance`; `None` when that is no
/// covariance, or the train cannot drive it for a second.
pub fn forecast(
    scene: &Scene<'_>,
    covariance: &Matrix3<f64>,
    noise: &Noise,
    drive: Drive,
) -> Option<Forecast> {
    let together = (STEP_MIN_S / noise.step_s).ceil().max(1.0);
    let step_s = together * noise.step_s;
    let gain = mps2_per_n_per_kn(scene.train.rotating_mass_factor);
    let model = NoiseModel {
        speed_noise_mps: noise.speed_noise_mps / together.sqrt(),
        speed_noise_range_mps: (0.0, f64::INFINITY),
        disturbance: gain * noise.disturbance_n_per_kn_sqrt_s,
        disturbance_range: (0.0, f64::INFINITY),
        memory: f64::INFINITY,
        learns_speed_noise: false,
        learns_disturbance: false,
    };
    let mut filter =
        Hypothesis::new(&scene.davis, &Vector3::repeat(1.0), LearnedNoise::new(&model));
    let factor = covariance.cholesky()?.unpack();
    filter.factor.0.fixed_view_mut::<3, 3>(0, 0).copy_from(&factor);
    filter.anchor(drive.from_mps);
    filter.factor.0[(SPEED, SPEED)] = tracked_speed_std(&model, step_s);
    let mut driver = drive.begin();
    let mut lasts_s = 0.0;
    while lasts_s + step_s <= drive.within_s {
        let Some(force_n) = driver.force_n(scene, filter.state[SPEED]) else { break };
        let drive_mps2 = force_n / scene.inertial_mass_kg();
        let step = Step { size: step_s, drive_mps2, resistance_gain: gain };
        filter.predict(StepRule::Time, &step, step_s, 0.0);
        filter.measure(filter.state[SPEED], &model, &OUTLIERS);
        lasts_s += step_s;
    }
    let std = filter.davis_covariance().diagonal().map(f64::sqrt);
    let is_sound = filter.is_sound() && std.sum().is_finite() && lasts_s >= 1.0;
    is_sound.then_some(Forecast { drive, lasts_s, end_mps: filter.state[SPEED], std })
}

/// Standard deviation in m/s of a speed that was followed for long: the filter's at rest, where the
/// variance q Δt that a step adds is what a measurement takes off.
fn tracked_speed_std(model: &NoiseModel, step_s: f64) -> f64 {
    let added = model.disturbance * model.disturbance * step_s;
    let measured = model.speed_noise_mps * model.speed_noise_mps;
    (0.5 * ((added * added + 4.0 * added * measured).sqrt() - added)).sqrt()
}
