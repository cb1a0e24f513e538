//! Simulated runs for the tests of this module.

use dynocar_model::force::{ResolvedSample, mps2_per_n_per_kn};
use dynocar_model::train::Davis;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::motion::tests::sample;
use super::step::{StepRule, TrajectoryStep};

/// A high-speed train.
pub const FAST: Davis = Davis { a: 0.79, b: 0.0229, c: 0.001493 };
/// A metro.
pub const METRO: Davis = Davis { a: 1.5, b: 0.02, c: 0.0012 };

pub fn random(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// Returns a standard normal number, by Box and Muller.
pub fn normal(random: &mut ChaCha8Rng) -> f64 {
    let radius = (-2.0 * (1.0 - random.random::<f64>()).ln()).sqrt();
    radius * (std::f64::consts::TAU * random.random::<f64>()).cos()
}

/// Returns steps of traction, coasting and braking between 10 and 80 m/s over rolling ground.
pub fn steps(rule: StepRule, count: usize) -> Vec<TrajectoryStep> {
    (0..count)
        .map(|i| {
            let phase = [0.38, 0.2, 0.12, 0.0, -0.25, 0.25, 0.15, 0.0][(8 * i / count) % 8];
            TrajectoryStep {
                size: if rule == StepRule::Distance { 100.0 } else { 2.5 },
                drive_mps2: phase + 0.05 * (0.7 * i as f64).sin(),
                resistance_gain: mps2_per_n_per_kn(0.06),
            }
        })
        .collect()
}

/// Returns the speeds along steps, by the rule itself.
pub fn speeds(
    rule: StepRule,
    steps: &[TrajectoryStep],
    davis: &Davis,
    initial_mps: f64,
) -> Vec<f64> {
    let mut speeds = vec![initial_mps];
    for step in steps {
        let last_mps = speeds[speeds.len() - 1];
        speeds.push(rule.advance(step, davis, last_mps).expect("a moving train").speed_mps);
    }
    speeds
}

/// Returns the samples of a metro at 5 Hz: start, traction, coasting, braking, a stop of 20 s, and again.
///
/// `disturbance` is the root of the density of a white disturbing acceleration, in m/s² √s.
pub fn metro(
    davis: impl Fn(f64) -> Davis,
    seconds: u32,
    noise_mps: f64,
    disturbance: f64,
    seed: u64,
) -> Vec<ResolvedSample> {
    let mut random = random(seed);
    let mut speed_mps: f64 = 0.0;
    let mut samples = Vec::new();
    let force_at = |time_s: f64| match time_s % 160.0 {
        t if t < 30.0 => 70_000.0,
        t if t < 60.0 => 12_000.0,
        t if t < 110.0 => 0.0,
        _ => -70_000.0,
    };
    for index in 0..5 * seconds {
        let time_s = 0.2 * f64::from(index);
        let force_n = force_at(time_s);
        let measured_mps = (speed_mps + noise_mps * normal(&mut random)).max(0.0);
        samples.push(sample(index, measured_mps, force_n));
        // The force changes linearly to the next sample's, as the tracker takes it.
        let next_force_n = force_at(time_s + 0.2);
        let resistance_n = 981.0 * davis(time_s).w0_n_per_kn(speed_mps);
        let pull_n = 0.5 * (force_n + next_force_n) - resistance_n;
        speed_mps += 0.2 * pull_n / 1.06e5 + disturbance * 0.2_f64.sqrt() * normal(&mut random);
        speed_mps = speed_mps.max(0.0);
    }
    samples
}
