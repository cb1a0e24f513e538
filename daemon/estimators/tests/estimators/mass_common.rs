//! A simulated train for the tests of the mass estimators.

#![allow(dead_code)] // Every test file uses a part of it.

use std::ops::{Deref, DerefMut};
use std::sync::Arc;

use dynocar_core::pipeline::admission::Admission;
use dynocar_core::pipeline::{Estimator, Outcome};
use dynocar_model::force::ResolvedSample;
use dynocar_model::terms::Resistance;
use dynocar_model::train::{Davis, EffortCurve, TrainModel};
use dynocar_shared::{ParameterSnapshot, TrainId};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Time in s between two samples.
pub const PERIOD_S: f64 = 0.2;
/// Declared mass in kg.
pub const DECLARED_KG: f64 = 100_000.0;

/// A train of 100 t with gamma = 0.06.
pub fn train() -> Arc<TrainModel> {
    let resistance = Davis { a: 2.0, b: 0.02, c: 0.005 };
    Arc::new(TrainModel {
        length_m: 100.0,
        cars: 4,
        rotating_mass_factor: 0.06,
        traction: EffortCurve::new(vec![(0.0, 90_000.0), (30.0, 40_000.0)]),
        ..TrainModel::bare("test", DECLARED_KG, resistance)
    })
}

/// A phase of a drive: a force in N (traction positive) for a time in s.
pub type Phase = (f64, f64);

/// Power, coasting, power, coasting, braking nearly to a stop: about two minutes.
pub const LEG: [Phase; 5] =
    [(80_000.0, 20.0), (0.0, 25.0), (60_000.0, 12.0), (0.0, 30.0), (-70_000.0, 27.0)];

/// A train on its way.
pub struct Simulation {
    pub mass_kg: f64,
    /// Resistance in N/kN at a time and a speed, gradient included; the samples know the
    /// declared part of it.
    pub extra_n_per_kn: f64,
    pub noise_mps: f64,
    pub quantum_mps: f64,
    /// Share of samples that are off by up to 1.5 m/s.
    pub outlier_share: f64,
    pub speed_mps: f64,
    /// Fastest change of the force in N/s; between two samples it is linear.
    pub slew_n_per_s: f64,
    force_n: f64,
    time_ns: i64,
    segment: u32,
    random: ChaCha8Rng,
}

impl Simulation {
    pub fn new(mass_kg: f64, seed: u64) -> Self {
        Simulation {
            mass_kg,
            extra_n_per_kn: 0.0,
            noise_mps: 0.015,
            quantum_mps: 0.0,
            outlier_share: 0.0,
            speed_mps: 0.0,
            slew_n_per_s: 80_000.0,
            force_n: 0.0,
            time_ns: 0,
            segment: 1,
            random: ChaCha8Rng::seed_from_u64(seed),
        }
    }

    /// Time passes unseen, and the next sample begins a new motion segment.
    pub fn gap(&mut self, seconds: f64) {
        self.time_ns += (seconds * 1e9) as i64;
        self.segment += 1;
    }

    /// Drives through phases; the train stands when it has stopped.
    pub fn drive(&mut self, phases: &[Phase]) -> Vec<ResolvedSample> {
        let mut samples = Vec::new();
        for &(force_n, seconds) in phases {
            for _ in 0..(seconds / PERIOD_S).round() as usize {
                samples.push(self.step(force_n));
            }
        }
        samples
    }

    /// Stands for a time in s, holding brake applied.
    pub fn stand(&mut self, seconds: f64) -> Vec<ResolvedSample> {
        self.speed_mps = 0.0;
        self.drive(&[(-20_000.0, seconds - 2.0), (0.0, 2.0)])
    }

    /// One sample, and the motion to the next.
    fn step(&mut self, wanted_n: f64) -> ResolvedSample {
        let sample = self.sample(self.force_n);
        let change_n = self.slew_n_per_s * PERIOD_S;
        let next_n = wanted_n.clamp(self.force_n - change_n, self.force_n + change_n);
        let slope = (next_n - self.force_n) / 20.0;
        let train = train();
        let inertia = 1.0 + train.rotating_mass_factor;
        for k in 0..20 {
            let force_n = self.force_n + slope * (f64::from(k) + 0.5);
            let w = train.resistance.w0_n_per_kn(self.speed_mps) + self.extra_n_per_kn;
            let acceleration = (force_n / self.mass_kg - 9.81e-3 * w) / inertia;
            self.speed_mps = (self.speed_mps + acceleration * PERIOD_S / 20.0).max(0.0);
        }
        self.force_n = next_n;
        self.time_ns += (PERIOD_S * 1e9) as i64;
        sample
    }

    fn sample(&mut self, force_n: f64) -> ResolvedSample {
        // Sum of twelve uniforms: close to normal, variance 1.
        let normal: f64 = (0..12).map(|_| self.random.random::<f64>()).sum::<f64>() - 6.0;
        let mut measured = self.speed_mps + self.noise_mps * normal;
        if self.random.random::<f64>() < self.outlier_share {
            measured += 3.0 * self.random.random::<f64>() - 1.5;
        }
        if self.quantum_mps > 0.0 {
            measured = (measured / self.quantum_mps).round() * self.quantum_mps;
        }
        let is_standing = self.speed_mps <= 0.0;
        ResolvedSample {
            time_ns: self.time_ns,
            step_s: PERIOD_S,
            segment: self.segment,
            direction: 1.0,
            position_m: None,
            speed_mps: if is_standing { 0.0 } else { measured.max(0.0) },
            mass_kg: DECLARED_KG,
            is_mass_measured: false,
            inertial_mass_kg: 1.06 * DECLARED_KG,
            weight_kn: TrainModel::weight_kn(DECLARED_KG),
            traction_force_n: Some(force_n.max(0.0)),
            brake_force_n: Some((-force_n).max(0.0)),
            gradient_permille: Some(0.0),
            gradient_std_permille: 0.0,
            curvature_per_m: Some(0.0),
            resistance: Resistance::BASIC,
            extra_n_per_kn: 0.0,
            since_cold_s: 0.0,
            tunnel_share: Some(0.0),
            brake_cylinder_pressure_pa: None,
            ambient_temperature_degc: None,
            is_sliding: false,
        }
    }
}

/// An estimator behind its admission, as a pipeline has it.
pub struct Admitted<E> {
    admission: Admission,
    estimator: E,
}

impl<E: Estimator> Admitted<E> {
    pub fn new(estimator: E) -> Self {
        Admitted { admission: Admission::new(TrainId(1), train()), estimator }
    }

    pub fn update(&mut self, sample: &ResolvedSample) -> Outcome {
        self.admission.pass(&mut self.estimator, sample)
    }
}

impl<E> Deref for Admitted<E> {
    type Target = E;

    fn deref(&self) -> &E {
        &self.estimator
    }
}

impl<E> DerefMut for Admitted<E> {
    fn deref_mut(&mut self) -> &mut E {
        &mut self.estimator
    }
}

/// Feeds samples to an estimator.
pub fn feed(estimator: &mut Admitted<impl Estimator>, samples: &[ResolvedSample]) {
    for sample in samples {
        estimator.update(sample);
    }
}

/// The snapshot of an estimator.
pub fn snapshot(estimator: &Admitted<impl Estimator>) -> ParameterSnapshot {
    let mut snapshot = ParameterSnapshot::empty();
    estimator.admission.write(&estimator.estimator, &mut snapshot);
    snapshot
}

/// Panics when a snapshot holds a number that is not finite.
pub fn assert_finite(snapshot: &ParameterSnapshot) {
    let others = [
        snapshot.innovation_normalised,
        snapshot.innovation_mean_square,
        snapshot.innovation_correlation,
        snapshot.unexplained_force_n,
        snapshot.unexplained_force_std_n,
        snapshot.speed_min_mps,
        snapshot.speed_max_mps,
    ];
    let numbers = snapshot.values.iter().chain(&snapshot.covariance).chain(&others);
    assert!(numbers.clone().all(|number| number.is_finite()), "{snapshot:?}");
}

/// Samples that are wrong in every way that a sample can be.
pub fn garbage(seed: u64, count: usize) -> Vec<ResolvedSample> {
    let mut simulation = Simulation::new(110_000.0, seed);
    let mut samples = Vec::new();
    while samples.len() < count {
        samples.extend(simulation.drive(&LEG));
        simulation.gap(3.0);
    }
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    for sample in &mut samples {
        let bad = [f64::NAN, f64::INFINITY, -1e300, 1e300, -50.0, 0.0];
        let value = bad[random.random_range(0..bad.len())];
        match random.random_range(0..24) {
            0 => sample.speed_mps = value,
            1 => sample.traction_force_n = Some(value),
            2 => sample.brake_force_n = None,
            3 => sample.gradient_permille = Some(value),
            4 => sample.gradient_permille = None,
            5 => sample.curvature_per_m = Some(value),
            6 => sample.tunnel_share = Some(value),
            7 => sample.mass_kg = value,
            8 => sample.time_ns = i64::MIN,
            9 => sample.time_ns = i64::MAX,
            10 => sample.segment = random.random(),
            11 => sample.is_sliding = true,
            12 => sample.extra_n_per_kn = value,
            _ => {}
        }
    }
    samples
}
