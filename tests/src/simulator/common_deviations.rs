//! Deviations that are the same in all runs of a dataset.

use super::deviations::TrueDeviations;
use super::random::{SimulatorRandom, Stream};
use super::train_maker::rounded;

/// A draw of the deviations that all runs of a dataset share.
#[derive(Clone, Debug, PartialEq)]
pub struct CommonDeviations {
    /// True over declared curve constant.
    pub curve_constant: f64,
    /// Reported over true traction and brake force.
    pub force_gains: [f64; 2],
    /// Time in s that forces act after their stamps.
    pub force_late_s: f64,
    /// Measured over true speed.
    pub speed_scale: f64,
    /// Addition of cold bearings at the start over the basic resistance, and their time constant in s.
    pub warming: (f64, f64),
    /// Error of the declared rotating-mass factor.
    pub rotating_mass: f64,
    /// Length in m over which the line rounds each step of its gradient.
    pub vertical_curve_m: f64,
    /// Waves of the map's error: ‰, length in m, phase.
    waves: Vec<[f64; 3]>,
}

/// Number of waves whose sum is a map's error.
const WAVES: usize = 12;
/// Their lengths in m.
const WAVES_M: (f64, f64) = (1500.0, 8000.0);
/// Time constants in s of cold bearings.
const WARMING_S: (f64, f64) = (150.0, 400.0);

impl CommonDeviations {
    /// Returns the draw of a seed.
    pub fn draw(deviations: &TrueDeviations, seed: u64) -> Self {
        let mut random = SimulatorRandom::new(seed, Stream::Deviations);
        let mut near_one = |share: f64| 1.0 + share * random.gaussian();
        let curve_constant = near_one(deviations.curve_constant_share);
        let force_gains = [near_one(deviations.force_share), near_one(deviations.force_share)];
        let speed_scale = near_one(deviations.wheel_share);
        let late_s = deviations.force_late_s * random.uniform(0.5, 1.5);
        let warming = deviations.warming_share * random.uniform(0.5, 1.5);
        let warming = (warming, random.uniform(WARMING_S.0, WARMING_S.1));
        // Amplitudes whose squares add up to twice the variance.
        let each_permille = deviations.map_permille * (2.0 / WAVES as f64).sqrt();
        let (shortest, longest) = (WAVES_M.0.ln(), WAVES_M.1.ln());
        let waves = (0..WAVES)
            .map(|_| {
                let wave_m = random.uniform(shortest, longest).exp();
                [each_permille, wave_m, random.uniform(0.0, std::f64::consts::TAU)]
            })
            .collect();
        let rotating_mass = deviations.rotating_mass * random.gaussian();
        let vertical_curve_m = deviations.vertical_curve_m * random.uniform(0.5, 1.5);
        CommonDeviations {
            rotating_mass,
            vertical_curve_m,
            curve_constant,
            force_gains,
            force_late_s: rounded(late_s, 0.05),
            speed_scale,
            warming,
            waves: if each_permille > 0.0 { waves } else { Vec::new() },
        }
    }

    /// Returns the error of the map on a line of a length in m: chainage in m and ‰; empty for none.
    pub fn map_error(&self, length_m: f64) -> Vec<(f64, f64)> {
        if self.waves.is_empty() { Vec::new() } else { wavy(&self.waves, length_m) }
    }
}

/// Distance in m between the nodes of a wavy gradient.
const APART_M: f64 = 100.0;

/// The sum of waves (‰, length in m, phase) along a line of a length in m, by chainage in m.
pub(super) fn wavy(waves: &[[f64; 3]], length_m: f64) -> Vec<(f64, f64)> {
    let at = |chainage_m: f64| {
        let wave = |[permille, wave_m, phase]: &[f64; 3]| {
            permille * (std::f64::consts::TAU * chainage_m / wave_m + phase).sin()
        };
        waves.iter().map(wave).sum::<f64>()
    };
    let count = (length_m / APART_M).ceil() as usize;
    let chainages = (0..=count).map(|k| APART_M * k as f64);
    chainages.map(|m| (m, rounded(at(m), 0.001))).collect()
}
