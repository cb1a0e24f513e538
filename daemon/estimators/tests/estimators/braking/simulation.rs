//! A CRH3 that brakes, as samples of its controller.

use std::sync::Arc;

use dynocar_core::pipeline::Pipeline;
use dynocar_estimators::EstimatorSettings;
use dynocar_model::train::{BrakeGear, Davis, TrainModel};
use dynocar_shared::{ParameterSnapshot, PipelineKind, SampleField, TrainId, TrainSample};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The braking pipelines.
pub const KINDS: [PipelineKind; 7] = [
    PipelineKind::AdhesionEm,
    PipelineKind::AdhesionEkf,
    PipelineKind::AdhesionSmoother,
    PipelineKind::AdhesionLaw,
    PipelineKind::BrakeEm,
    PipelineKind::BrakeEkf,
    PipelineKind::BrakeSmoother,
];

pub const TRAIN: TrainId = TrainId(1);
pub const FULL_PRESSURE_PA: f64 = 410_000.0;
/// Full brake force over weight with the declared gear.
pub const DEMAND: f64 = 494_973.0 / (536_000.0 * 9.81);

pub fn train() -> TrainModel {
    TrainModel {
        length_m: 200.0,
        cars: 8,
        rotating_mass_factor: 0.06,
        brake_gear: BrakeGear {
            cylinder_diameter_mm: Some(203.0),
            disc_radius_mm: Some(297.6),
            wheel_radius_mm: Some(460.0),
            efficiency: Some(0.85),
            ratio: Some(2.55),
            friction: Some(0.28),
            pads: Some(95.0),
            ..BrakeGear::default()
        },
        ..TrainModel::bare("CRH3", 536_000.0, Davis { a: 0.79, b: 0.023, c: 0.0015 })
    }
}

/// A braking run: the adhesion of the rail and the force of the brake, over time and speed.
pub struct Run {
    pub from_mps: f64,
    pub seconds: f64,
    pub gradient_permille: f64,
    /// Adhesion over time in s and speed in m/s.
    pub adhesion: fn(f64, f64) -> f64,
    /// Cylinder pressure in Pa over time.
    pub pressure_pa: fn(f64) -> f64,
    /// True over declared brake force.
    pub brake_factor: f64,
    pub step_s: f64,
}

pub const FULL_BRAKING: Run = Run {
    from_mps: 80.0,
    seconds: 30.0,
    gradient_permille: -5.0,
    adhesion: |_, _| 1.0,
    pressure_pa: |_| FULL_PRESSURE_PA,
    brake_factor: 1.0,
    step_s: 0.2,
};

/// A wet rail, Xie 2019, section 3.1.
pub fn wet(speed_mps: f64) -> f64 {
    0.04 + 13.7 / (120.0 + 3.6 * speed_mps)
}

/// A dry rail, ditto.
pub fn dry(speed_mps: f64) -> f64 {
    0.06 + 46.6 / (260.0 + 3.6 * speed_mps)
}

/// One sample with the truth next to it.
pub struct Moment {
    pub sample: TrainSample,
    pub time_s: f64,
    pub speed_mps: f64,
}

impl Run {
    pub fn simulate(&self, seed: u64) -> Vec<Moment> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut uniform = |half_width: f64| half_width * (2.0 * random.random::<f64>() - 1.0);
        let train = train();
        let weight_kn = TrainModel::weight_kn(train.mass_kg);
        let inertial_mass_kg = train.mass_kg * (1.0 + train.rotating_mass_factor);
        let (mut position_m, mut speed_mps) = (10_000.0, self.from_mps);
        // Fine steps of the motion between samples.
        let substeps = 20;
        let fine_s = self.step_s / f64::from(substeps);
        let count = (self.seconds / self.step_s) as u64;
        (0..count)
            .map(|index| {
                let time_s = index as f64 * self.step_s;
                let pressure_pa = (self.pressure_pa)(time_s);
                let mut sample = TrainSample::empty(TRAIN)
                    .with(SampleField::Position, position_m + uniform(0.17))
                    .with(SampleField::Speed, (speed_mps + uniform(0.1)).max(0.0))
                    .with(SampleField::TractionForce, 0.0)
                    .with(SampleField::BrakeCylinderPressure, pressure_pa)
                    .with(SampleField::Gradient, self.gradient_permille);
                sample.time_ns = (time_s * 1e9) as i64;
                sample.sequence = index + 1;
                let moment = Moment { sample, time_s, speed_mps };
                for substep in 0..substeps {
                    let now_s = time_s + f64::from(substep) * fine_s;
                    let brake_n = self.brake_factor * 494_973.0 * (self.pressure_pa)(now_s)
                        / FULL_PRESSURE_PA;
                    let carried_n = 1000.0 * weight_kn * (self.adhesion)(now_s, speed_mps);
                    let w0 = train.resistance.w0_n_per_kn(speed_mps);
                    let force_n =
                        brake_n.min(carried_n) + weight_kn * (w0 + self.gradient_permille);
                    position_m += fine_s * speed_mps;
                    speed_mps = (speed_mps - fine_s * force_n / inertial_mass_kg).max(0.0);
                }
                moment
            })
            .collect()
    }
}

/// A pipeline around an estimator with its default settings changed by `change`.
pub fn pipeline(settings: &EstimatorSettings) -> Pipeline {
    pipeline_for(settings, train())
}

pub fn pipeline_for(settings: &EstimatorSettings, train: TrainModel) -> Pipeline {
    let train = Arc::new(train);
    let estimator = settings.build(&train).expect("valid settings");
    Pipeline::new(TRAIN, 0, train, None, estimator)
}

/// The snapshot after a whole run.
pub fn after(pipeline: &mut Pipeline, moments: &[Moment]) -> ParameterSnapshot {
    for moment in moments {
        let snapshot = pipeline.process(&moment.sample);
        assert_finite(snapshot);
    }
    *pipeline.snapshot()
}

/// No number of a snapshot is NaN or infinite.
pub fn assert_finite(snapshot: &ParameterSnapshot) {
    let numbers = snapshot.values.iter().chain(&snapshot.covariance).copied().chain([
        snapshot.innovation_normalised,
        snapshot.innovation_mean_square,
        snapshot.innovation_correlation,
        snapshot.unexplained_force_n,
        snapshot.unexplained_force_std_n,
        snapshot.speed_min_mps,
        snapshot.speed_max_mps,
    ]);
    for number in numbers {
        assert!(number.is_finite(), "{snapshot:?}");
    }
}
