//! A small train for tests: point mass on a sampled line, with the errors of its sensors.

use std::sync::Arc;

use dynocar_core::pipeline::Pipeline;
use dynocar_core::pipeline::momentum::UnitSample;
use dynocar_model::track::Track;
use dynocar_model::train::{Davis, TrainModel};
use dynocar_shared::{ParameterSnapshot, SampleField, TrainId, TrainSample};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::EstimatorSettings;

pub const TRAIN: TrainId = TrainId(1);
const TICK_S: f64 = 0.05;

/// Simulated scenario; forces in N/kN.
#[derive(Clone, Copy, Debug)]
pub struct RunScenario {
    pub davis: Davis,
    pub rotating_mass_factor: f64,
    pub speed_max_mps: f64,
    pub duration_s: f64,
    pub step_s: f64,
    pub speed_std_mps: f64,
    pub quantum_mps: f64,
    pub disturbance_std: f64,
    pub disturbance_time_s: f64,
    pub force_scale: f64,
    pub spike_share: f64,
    pub is_coasting_only: bool,
    pub seed: u64,
}

impl Default for RunScenario {
    fn default() -> Self {
        RunScenario {
            davis: Davis { a: 1.8, b: 0.03, c: 0.0035 },
            rotating_mass_factor: 0.06,
            speed_max_mps: 28.0,
            duration_s: 1800.0,
            step_s: 0.2,
            speed_std_mps: 0.02,
            quantum_mps: 0.01,
            disturbance_std: 0.0,
            disturbance_time_s: 60.0,
            force_scale: 1.0,
            spike_share: 0.0,
            is_coasting_only: false,
            seed: 1,
        }
    }
}

/// Returns the sum of twelve uniforms: mean 0, variance 1.
pub fn normal(random: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0
}

/// Returns the samples of a train with s = 100 N/kN per m/s² under constant driving force, every `step_s`, by small
/// Euler steps.
pub fn driven(davis: &Davis, speed_mps: f64, driving: f64, step_s: f64) -> Vec<UnitSample> {
    let mut speed_mps = speed_mps;
    let ticks = 1000;
    (0..300)
        .map(|index| {
            let sample = UnitSample {
                time_ns: (step_s * f64::from(index) * 1e9).round() as i64,
                segment: 1,
                speed_mps,
                driving,
                traction: driving.max(0.0),
                brake: (-driving).max(0.0),
                known: 0.0,
                inertia: 100.0,
            };
            for _ in 0..ticks {
                let rate = (driving - davis.w0_n_per_kn(speed_mps)) / 100.0;
                speed_mps += rate * step_s / f64::from(ticks);
            }
            sample
        })
        .collect()
}

impl RunScenario {
    /// Returns the train as declared: with another resistance than the true one.
    pub fn train(&self) -> Arc<TrainModel> {
        let Davis { a, b, c } = self.davis;
        let resistance = Davis { a: 1.3 * a, b: 0.5 * b, c: 1.1 * c };
        Arc::new(TrainModel {
            length_m: 100.0,
            rotating_mass_factor: self.rotating_mass_factor,
            curve_constant_n_per_kn_m: 600.0,
            ..TrainModel::bare("test", 200_000.0, resistance)
        })
    }

    /// Returns a line of steps of a few ‰.
    pub fn track(&self) -> Arc<Track> {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed ^ 0xface);
        let steps: Vec<_> =
            (0..200).map(|i| (400.0 * f64::from(i), 2.0 * normal(&mut random))).collect();
        Arc::new(Track::new("test".into(), None, Some(&steps), None, None).unwrap())
    }

    /// Returns the samples of one run.
    pub fn samples(&self) -> Vec<TrainSample> {
        let (train, track) = (self.train(), self.track());
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let weight_kn = TrainModel::weight_kn(train.mass_kg);
        let inertia = 1000.0 * (1.0 + self.rotating_mass_factor) / 9.81;
        let ticks = (self.step_s / TICK_S).round() as usize;
        let kept = (-TICK_S / self.disturbance_time_s).exp();
        let renewed = self.disturbance_std * (1.0 - kept * kept).sqrt();
        let mut disturbance = self.disturbance_std * normal(&mut random);
        let (mut speed_mps, mut position_m, mut force, mut wanted) = (
            if self.is_coasting_only { self.speed_max_mps } else { 0.6 * self.speed_max_mps },
            500.0,
            0.0,
            0.0,
        );
        let mut samples = Vec::new();
        for tick in 0..(self.duration_s / TICK_S) as usize {
            if tick % 800 == 0 && !self.is_coasting_only {
                wanted = self.handle(speed_mps, &mut random);
            }
            force += (wanted - force).clamp(-10.0 * TICK_S, 10.0 * TICK_S);
            if tick % ticks == 0 {
                let time_s = tick as f64 * TICK_S;
                let mut sample = self.sample(speed_mps, position_m, &mut random);
                sample.time_ns = (time_s * 1e9).round() as i64;
                sample.sequence = samples.len() as u64 + 1;
                let reported_n = force / self.force_scale * weight_kn;
                sample.set(SampleField::TractionForce, reported_n.max(0.0));
                sample.set(SampleField::BrakeForce, (-reported_n).max(0.0));
                samples.push(sample);
            }
            disturbance = kept * disturbance + renewed * normal(&mut random);
            let gradient = track.gradient_permille(position_m, train.length_m).unwrap();
            let retarding = self.davis.w0_n_per_kn(speed_mps) + gradient + disturbance;
            let next_mps = (speed_mps + TICK_S * (force - retarding) / inertia).max(0.0);
            position_m += 0.5 * TICK_S * (speed_mps + next_mps);
            speed_mps = next_mps;
        }
        samples
    }

    /// Returns the force that the driver commands next, in N/kN: coasting most of the time.
    fn handle(&self, speed_mps: f64, random: &mut ChaCha8Rng) -> f64 {
        let share = speed_mps / self.speed_max_mps;
        match random.random::<f64>() {
            _ if share < 0.3 => 25.0,
            _ if share > 0.95 => 0.0,
            chance if chance < 0.4 => 0.0,
            chance if chance < 0.6 => self.davis.w0_n_per_kn(speed_mps),
            chance if chance < 0.85 => 20.0,
            _ => -15.0,
        }
    }

    fn sample(&self, speed_mps: f64, position_m: f64, random: &mut ChaCha8Rng) -> TrainSample {
        let mut seen_mps = speed_mps + self.speed_std_mps * normal(random);
        if random.random::<f64>() < self.spike_share {
            seen_mps += 0.6;
        }
        if self.quantum_mps > 0.0 {
            seen_mps = (seen_mps / self.quantum_mps).round() * self.quantum_mps;
        }
        TrainSample::empty(TRAIN)
            .with(SampleField::Speed, seen_mps.max(0.0))
            .with(SampleField::Position, position_m)
    }

    /// Returns the snapshot after a run, by an estimator as in a configuration file.
    pub fn identify(&self, settings: &str) -> ParameterSnapshot {
        self.identify_samples(settings, &self.samples())
    }

    /// Returns the snapshot after other samples of this scenario's train.
    pub fn identify_samples(&self, settings: &str, samples: &[TrainSample]) -> ParameterSnapshot {
        let settings: EstimatorSettings = toml::from_str(settings).unwrap();
        let train = self.train();
        let estimator = settings.build(&train).unwrap();
        let mut pipeline = Pipeline::new(TRAIN, 0, train, Some(self.track()), estimator);
        for sample in samples {
            pipeline.process(sample);
        }
        *pipeline.snapshot()
    }

    /// (estimate - truth) / standard deviation of w0 at a speed.
    pub fn normalised_error(&self, snapshot: &ParameterSnapshot, speed_mps: f64) -> f64 {
        let estimate = snapshot.resistance_at(speed_mps).unwrap();
        (estimate.w0_n_per_kn - self.davis.w0_n_per_kn(speed_mps)) / estimate.w0_std_n_per_kn
    }

    /// Estimate over truth, less one, of w0 at a speed.
    pub fn relative_error(&self, snapshot: &ParameterSnapshot, speed_mps: f64) -> f64 {
        let estimate = snapshot.resistance_at(speed_mps).unwrap();
        estimate.w0_n_per_kn / self.davis.w0_n_per_kn(speed_mps) - 1.0
    }
}
