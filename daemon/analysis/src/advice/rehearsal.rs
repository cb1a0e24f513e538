//! Standard deviations of resistance and mass after a manoeuvre, by the pipeline that estimates them.
//!
//! `train_kalman` itself is driven. From the present estimates, it first holds the manoeuvre's initial speed for a
//! while, under the noise that the snapshots show, so that it learns how the unexplained force behaves; then it drives
//! the manoeuvre. The forecast is the share of each standard deviation that remains after the manoeuvre. The noise is
//! drawn from one fixed seed, since a covariance hardly depends on it.

use std::sync::Arc;

use dynocar_core::pipeline::train_kalman::{TrainKalman, TrainKalmanSettings};
use dynocar_core::pipeline::{Estimator, KeptEstimate, Pipeline};
use dynocar_model::force::mps2_per_n_per_kn;
use dynocar_model::train::{Davis, TrainModel};
use dynocar_shared::{SampleField, TrainId, TrainSample};
use nalgebra::{Matrix3, SVector};

use super::manoeuvre::{DriveKind, PlannedManoeuvre, Scene};
use super::noise::{ANSWERED, RunNoise};

/// Shortest step in s; faster samples are combined.
const STEP_MIN_S: f64 = 0.2;
/// Time in s in which the pipeline learns the noise.
const LEAD_IN_S: f64 = 30.0;
/// Index of the mass among [`ANSWERED`].
pub const MASS: usize = 3;
const NS_PER_S: f64 = 1e9;

/// Values of [`ANSWERED`], in the units of a snapshot.
pub type Answered = SVector<f64, 4>;

/// Knowledge before a manoeuvre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownBefore {
    /// Covariance of a, b and c.
    pub davis: Matrix3<f64>,
    /// Standard deviation of the mass in t; 0 where it is exact.
    pub mass_std_t: f64,
}

/// Forecast of the knowledge after a manoeuvre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forecast {
    /// The manoeuvre.
    pub drive: PlannedManoeuvre,
    /// Time in s that it takes.
    pub lasts_s: f64,
    /// Speed in m/s at its end.
    pub end_mps: f64,
    /// Standard deviations of a, b, c and the mass after it.
    pub std: Answered,
}

/// Returns the knowledge after a manoeuvre; `None` when the present knowledge is not a covariance, or the train
/// cannot drive the manoeuvre for a second.
pub fn forecast(
    scene: &Scene<'_>,
    known: &KnownBefore,
    noise: &RunNoise,
    drive: PlannedManoeuvre,
) -> Option<Forecast> {
    let mut rehearsal = Rehearsal::new(scene, known, noise)?;
    rehearsal.speed_mps = drive.from_mps;
    let hold = PlannedManoeuvre {
        kind: DriveKind::Hold,
        to_mps: drive.from_mps,
        within_s: LEAD_IN_S,
        ..drive
    };
    rehearsal.drive(hold, true);
    let before = rehearsal.std()?;
    let lasts_s = rehearsal.drive(drive, false);
    let left = rehearsal.std()?.component_div(&before.map(|std| std.max(f64::MIN_POSITIVE)));
    let davis = known.davis.diagonal().map(|variance| variance.max(0.0).sqrt());
    let now = Answered::new(davis[0], davis[1], davis[2], known.mass_std_t);
    let std = now.component_mul(&left);
    (lasts_s >= 1.0 && std.sum().is_finite()).then_some(Forecast {
        drive,
        lasts_s,
        end_mps: rehearsal.speed_mps,
        std,
    })
}

/// A train and its pipeline.
struct Rehearsal<'a> {
    scene: &'a Scene<'a>,
    pipeline: Pipeline,
    random: Random,
    step_s: f64,
    /// Standard deviations in m/s of the measured speed, and of its disturbance within a step.
    measured_mps: f64,
    disturbed_mps: f64,
    sample: TrainSample,
    speed_mps: f64,
}

impl<'a> Rehearsal<'a> {
    fn new(scene: &'a Scene<'a>, known: &KnownBefore, noise: &RunNoise) -> Option<Self> {
        let together = (STEP_MIN_S / noise.step_s).ceil().max(1.0);
        let step_s = together * noise.step_s;
        let measured_mps = noise.speed_noise_mps / together.sqrt();
        let train = Arc::new(TrainModel {
            mass_kg: scene.mass_kg,
            resistance: scene.davis,
            ..scene.train.clone()
        });
        let mut settings = TrainKalmanSettings {
            speed_noise_mps: measured_mps.clamp(0.001, 1.0),
            ..TrainKalmanSettings::default()
        };
        if known.mass_std_t <= 0.0 {
            settings.load_std_percent = 0.0;
        }
        let mut estimator = Box::new(TrainKalman::new(settings, &train).ok()?);
        estimator.warm_start(&known.kept(scene)?);
        let id = TrainId(1);
        let gain = mps2_per_n_per_kn(train.rotating_mass_factor);
        Some(Rehearsal {
            scene,
            pipeline: Pipeline::new(id, 0, train, None, estimator),
            random: Random(1),
            step_s,
            measured_mps,
            disturbed_mps: gain * noise.disturbance_n_per_kn_sqrt_s * step_s.sqrt(),
            sample: TrainSample::empty(id).with(SampleField::Gradient, 0.0),
            speed_mps: 0.0,
        })
    }

    fn std(&self) -> Option<Answered> {
        let snapshot = self.pipeline.snapshot();
        let [a, b, c, mass] = ANSWERED.map(|parameter| snapshot.std(parameter));
        Some(Answered::new(a?, b?, c?, mass?))
    }

    /// Drives a manoeuvre to its end; `is_free` holds a speed by any traction that this needs. Returns the time in s.
    fn drive(&mut self, drive: PlannedManoeuvre, is_free: bool) -> f64 {
        let gain = mps2_per_n_per_kn(self.scene.train.rotating_mass_factor);
        let weight_kn = TrainModel::weight_kn(self.scene.mass_kg);
        let mut driver = drive.begin();
        let mut lasts_s = 0.0;
        while lasts_s + self.step_s <= drive.within_s {
            let w0 = self.scene.davis.w0_n_per_kn(self.speed_mps);
            let wanted = match is_free {
                true => Some(weight_kn * w0),
                false => driver.force_n(self.scene, self.speed_mps),
            };
            let Some(force_n) = wanted else { break };
            self.measure(force_n);
            let advance_mps = self.step_s * gain * (force_n / weight_kn - w0);
            let disturbed_mps = self.disturbed_mps * self.random.normal();
            self.speed_mps = (self.speed_mps + advance_mps + disturbed_mps).max(0.0);
            lasts_s += self.step_s;
        }
        lasts_s
    }

    fn measure(&mut self, force_n: f64) {
        let sample = &mut self.sample;
        sample.sequence += 1;
        sample.time_ns += (NS_PER_S * self.step_s) as i64;
        let speed_mps = (self.speed_mps + self.measured_mps * self.random.normal()).max(0.0);
        sample.set(SampleField::Speed, speed_mps);
        sample.set(SampleField::TractionForce, force_n.max(0.0));
        sample.set(SampleField::BrakeForce, (-force_n).max(0.0));
        self.pipeline.process(sample);
    }
}

impl KnownBefore {
    fn kept(&self, scene: &Scene<'_>) -> Option<KeptEstimate> {
        let Davis { a, b, c } = scene.davis;
        let it = &self.davis;
        let davis = [it[(0, 0)], it[(1, 0)], it[(1, 1)], it[(2, 0)], it[(2, 1)], it[(2, 2)]];
        if self.mass_std_t > 0.0 {
            let mut all = davis.to_vec();
            all.extend([0.0, 0.0, 0.0, self.mass_std_t * self.mass_std_t]);
            return KeptEstimate::new(&ANSWERED, &[a, b, c, 1e-3 * scene.mass_kg], &all).ok();
        }
        KeptEstimate::new(&ANSWERED[..MASS], &[a, b, c], &davis).ok()
    }
}

/// Splitmix64 (Steele, Lea, Flood 2014): enough for a rehearsal.
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (bits >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Returns the sum of twelve uniforms: mean 0, variance 1.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}
