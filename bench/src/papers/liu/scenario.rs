//! Liu's coasting runs, with what the paper leaves out.

use dynocar_model::simulate::motion::{Motion, advance};
use dynocar_model::train::Davis;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::statistics::normal;

/// Table 1's last row, near enough: w0 = 2.2 + 0.025 v + 0.0013 v² in N/kN, v in km/h.
pub const THETA_KMH: [f64; 3] = [2.2, 0.025, 0.0013];
/// Rotating-mass factor.
pub const ROTATING_MASS_FACTOR: f64 = 0.06;
/// Time between samples in s.
pub const STEP_S: f64 = 0.2;
/// Step of the speed's display in km/h.
pub const QUANTUM_KMH: f64 = 0.1;
/// Standard deviation of the speed's noise in km/h, before rounding.
pub const NOISE_KMH: f64 = 0.05;
/// The two coasting runs: from and to, in km/h.
pub const RUNS_KMH: [(f64, f64); 2] = [(72.0, 40.0), (68.0, 42.0)];
/// Share of outliers.
pub const OUTLIER_SHARE: f64 = 0.05;
/// Outliers are off by 1 to 5 km/h, up or down.
pub const OUTLIER_KMH: (f64, f64) = (1.0, 5.0);
/// Share of missing samples.
pub const MISSING_SHARE: f64 = 0.2;

/// What is wrong with the data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Condition {
    /// Noise and rounding only.
    Clean,
    /// 5 % outliers besides.
    Outliers,
    /// 20 % of the samples are missing.
    Missing,
    /// Both.
    Both,
}

impl Condition {
    /// Every condition.
    pub const ALL: [Condition; 4] =
        [Condition::Clean, Condition::Outliers, Condition::Missing, Condition::Both];

    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Condition::Clean => "clean",
            Condition::Outliers => "5 % outliers",
            Condition::Missing => "20 % missing",
            Condition::Both => "5 % outliers, 20 % missing",
        }
    }

    /// Share of outliers.
    pub fn outlier_share(self) -> f64 {
        match self {
            Condition::Outliers | Condition::Both => OUTLIER_SHARE,
            Condition::Clean | Condition::Missing => 0.0,
        }
    }

    /// Share of missing samples.
    pub fn missing_share(self) -> f64 {
        match self {
            Condition::Missing | Condition::Both => MISSING_SHARE,
            Condition::Clean | Condition::Outliers => 0.0,
        }
    }
}

/// A measured speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Time in s since the run's first sample.
    pub time_s: f64,
    /// Speed in km/h.
    pub speed_kmh: f64,
}

/// The true coefficients, for speeds in m/s.
pub fn truth() -> Davis {
    davis(THETA_KMH)
}

/// Coefficients for speeds in m/s from those for km/h.
pub fn davis([a, b, c]: [f64; 3]) -> Davis {
    Davis { a, b: 3.6 * b, c: 3.6 * 3.6 * c }
}

/// Momentum per weight and speed, s = 1000 (1 + gamma) / g in N/kN per m/s².
pub fn inertia() -> f64 {
    1000.0 * (1.0 + ROTATING_MASS_FACTOR) / 9.81
}

/// True speeds in km/h of a run, every [`STEP_S`], until it reaches its last speed.
pub fn true_speeds_kmh((from_kmh, to_kmh): (f64, f64), davis: &Davis) -> Vec<f64> {
    let mut motion = Motion { distance_m: 0.0, speed_mps: from_kmh / 3.6 };
    let mut speeds = Vec::new();
    while motion.speed_mps * 3.6 >= to_kmh {
        speeds.push(motion.speed_mps * 3.6);
        motion = advance(motion, STEP_S, |_, at| -davis.w0_n_per_kn(at.speed_mps) / inertia());
    }
    speeds
}

/// The measured runs of a seed.
pub fn measure(condition: Condition, seed: u64) -> Vec<Vec<Measured>> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    RUNS_KMH
        .iter()
        .map(|run| {
            // Where in the display's step a run begins is chance.
            let shift_kmh = QUANTUM_KMH * (random.random::<f64>() - 0.5);
            let run = (run.0 + shift_kmh, run.1);
            let speeds = true_speeds_kmh(run, &truth());
            let samples = speeds.iter().enumerate().filter_map(|(index, &true_kmh)| {
                let mut speed_kmh = true_kmh + NOISE_KMH * normal(&mut random);
                if random.random::<f64>() < condition.outlier_share() {
                    let (low, high) = OUTLIER_KMH;
                    let size = low + (high - low) * random.random::<f64>();
                    speed_kmh += if random.random() { size } else { -size };
                }
                let is_missing = random.random::<f64>() < condition.missing_share();
                let speed_kmh = (speed_kmh / QUANTUM_KMH).round() * QUANTUM_KMH;
                (!is_missing).then_some(Measured { time_s: STEP_S * index as f64, speed_kmh })
            });
            samples.collect()
        })
        .collect()
}

/// The speeds in m/s at which w0 is compared: where the runs coast.
pub fn compared_speeds_mps() -> Vec<f64> {
    (40..=72).map(|kmh| f64::from(kmh) / 3.6).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_runs_coast_between_the_speeds_they_should() {
        let speeds = true_speeds_kmh(RUNS_KMH[0], &truth());
        assert_eq!(speeds[0], 72.0);
        assert!(*speeds.last().unwrap() >= 40.0 && speeds.len() > 400);
        assert!(speeds.windows(2).all(|pair| pair[1] < pair[0]));
    }

    #[test]
    fn conditions_do_to_the_data_what_they_say() {
        let count = |condition| measure(condition, 3).iter().map(Vec::len).sum::<usize>() as f64;
        let share = 1.0 - count(Condition::Missing) / count(Condition::Clean);
        assert!((share - MISSING_SHARE).abs() < 0.05);
        let wild = |condition| {
            let runs = measure(condition, 3);
            runs.iter()
                .flat_map(|run| run.windows(2))
                .filter(|pair| (pair[1].speed_kmh - pair[0].speed_kmh).abs() > 0.8)
                .count()
        };
        assert_eq!(wild(Condition::Clean), 0);
        assert!(wild(Condition::Outliers) > 40);
        assert_eq!(measure(Condition::Both, 9), measure(Condition::Both, 9));
    }
}
