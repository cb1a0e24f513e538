//! What a manoeuvre would show of the mass, by the pipeline that learns it.
//!
//! How sure `mass_kalman` is depends on how the unexplained acceleration behaves, which it weighs by the
//! innovations. So the pipeline itself is driven: over a minute at the manoeuvre's first speed, under the
//! noise that the resistance shows, so that its weights settle; from there, with the mass as well known
//! as it is now, over the manoeuvre. The noise is drawn from fixed seeds; the median over them counts.

use std::sync::Arc;

use dynocar_core::force::balance::mps2_per_n_per_kn;
use dynocar_core::pipeline::papers::wang::{MassKalman, MassKalmanSettings};
use dynocar_core::pipeline::papers::xia::trajectory::step::{Step, StepRule};
use dynocar_core::pipeline::{KeptEstimate, Pipeline};
use dynocar_core::train::{Davis, TrainModel};
use dynocar_shared::{Parameter, ParameterSnapshot, SampleField, TrainId, TrainSample};

use super::Advice;
use super::drive::{Drive, DriveKind, Scene};
use super::noise::Noise;

/// Times in s that a driver may be asked for; traction shows the mass soon or not at all.
const WITHIN_S: [f64; 2] = [20.0, 60.0];
/// Shortest step in s that is used.
const STEP_MIN_S: f64 = 0.2;
/// Time in s in which the pipeline gets to know the noise.
const LEAD_IN_S: f64 = 60.0;
const SEEDS: [u64; 3] = [1, 2, 3];
/// A standard deviation of this share of the mass is good enough: load weighing is no better.
const GOOD_SHARE: f64 = 0.005;
/// A standard deviation beyond this share of the present one is not worth the driving.
const WORTH_SHARE: f64 = 0.9;
const NS_PER_S: f64 = 1e9;

/// The mass after a manoeuvre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassForecast {
    /// The manoeuvre.
    pub drive: Drive,
    /// Time in s that it takes.
    pub lasts_s: f64,
    /// Speed in m/s at its end.
    pub end_mps: f64,
    /// Standard deviation of the mass in t after it.
    pub std_t: f64,
}

/// The manoeuvre that shows most of the mass; `None` where it is known well enough, or none helps.
pub fn for_mass(
    snapshot: &ParameterSnapshot,
    train: &TrainModel,
    davis: Davis,
    noise: &Noise,
) -> Option<Advice> {
    let (mass_t, std_t) = (snapshot.value(Parameter::Mass)?, snapshot.std(Parameter::Mass)?);
    if !(mass_t > 0.0 && std_t > GOOD_SHARE * mass_t) {
        return None;
    }
    let scene = Scene::new(train, davis, 1e3 * mass_t, snapshot.speed_max_mps);
    let within = |within_s: f64| {
        let drives = scene
            .catalogue(within_s)
            .into_iter()
            .filter(|drive| matches!(drive.kind, DriveKind::Accelerate | DriveKind::Brake));
        drives
            .filter_map(|drive| forecast(&scene, std_t, noise, drive))
            .min_by(|one, other| one.std_t.total_cmp(&other.std_t))
    };
    let is_worth = |it: &MassForecast| it.std_t <= WORTH_SHARE * std_t;
    let chosen = WITHIN_S.into_iter().find_map(|within_s| within(within_s).filter(is_worth))?;
    Some(Advice {
        parameter: Parameter::Mass,
        drive: chosen.drive.in_words(chosen.lasts_s, chosen.end_mps),
        std_now: std_t,
        std_after: chosen.std_t,
    })
}

/// The mass after a manoeuvre that begins with a standard deviation in t; `None` when it cannot be driven.
pub fn forecast(
    scene: &Scene<'_>,
    std_t: f64,
    noise: &Noise,
    drive: Drive,
) -> Option<MassForecast> {
    let mut all = SEEDS.iter().filter_map(|&seed| {
        let mut rehearsal = Rehearsal::new(scene, noise, seed)?;
        rehearsal.speed_mps = drive.from_mps;
        let hold = Drive { kind: DriveKind::Hold, to_mps: drive.from_mps, ..drive };
        rehearsal.drive(Drive { within_s: LEAD_IN_S, ..hold }, true);
        let variance = std_t * std_t;
        let mass_t = 1e-3 * scene.mass_kg;
        let kept = KeptEstimate::new(&[Parameter::Mass], &[mass_t], &[variance]).ok()?;
        rehearsal.pipeline.warm_start(&kept);
        let lasts_s = rehearsal.drive(drive, false);
        let std_t = rehearsal.pipeline.snapshot().std(Parameter::Mass)?;
        let forecast = MassForecast { drive, lasts_s, end_mps: rehearsal.speed_mps, std_t };
        (lasts_s >= 1.0 && std_t.is_finite()).then_some(forecast)
    });
    let (one, two, three) = (all.next()?, all.next()?, all.next()?);
    let mut sorted = [one, two, three];
    sorted.sort_by(|one, other| one.std_t.total_cmp(&other.std_t));
    Some(sorted[1])
}

/// A train and its pipeline.
struct Rehearsal<'a> {
    scene: &'a Scene<'a>,
    pipeline: Pipeline,
    random: Random,
    step_s: f64,
    /// Standard deviations in m/s of the measured speed, and of what disturbs it within a step.
    measured_mps: f64,
    disturbed_mps: f64,
    sample: TrainSample,
    speed_mps: f64,
}

impl<'a> Rehearsal<'a> {
    fn new(scene: &'a Scene<'a>, noise: &Noise, seed: u64) -> Option<Self> {
        let together = (STEP_MIN_S / noise.step_s).ceil().max(1.0);
        let step_s = together * noise.step_s;
        let measured_mps = noise.speed_noise_mps / together.sqrt();
        let Davis { a, b, c } = scene.davis;
        let settings = MassKalmanSettings {
            speed_noise_mps: measured_mps.clamp(0.001, 1.0),
            basic_resistance: Some([a, b, c]),
            ..MassKalmanSettings::default()
        };
        let train = Arc::new(TrainModel { mass_kg: scene.mass_kg, ..scene.train.clone() });
        let estimator = Box::new(MassKalman::new(settings, &train).ok()?);
        let id = TrainId(1);
        let gain = mps2_per_n_per_kn(train.rotating_mass_factor);
        Some(Rehearsal {
            scene,
            pipeline: Pipeline::new(id, 0, train, None, estimator),
            random: Random(seed),
            step_s,
            measured_mps,
            disturbed_mps: gain * noise.disturbance_n_per_kn_sqrt_s * step_s.sqrt(),
            sample: TrainSample::empty(id).with(SampleField::Gradient, 0.0),
            speed_mps: 0.0,
        })
    }

    /// Drives a manoeuvre to its end; `is_free` holds a speed whatever the traction. Gives the time in s.
    fn drive(&mut self, drive: Drive, is_free: bool) -> f64 {
        let gain = mps2_per_n_per_kn(self.scene.train.rotating_mass_factor);
        let mut driver = drive.begin();
        let mut lasts_s = 0.0;
        while lasts_s + self.step_s <= drive.within_s {
            let resistance_n = TrainModel::weight_kn(self.scene.mass_kg)
                * self.scene.davis.w0_n_per_kn(self.speed_mps);
            let wanted = if is_free {
                Some(resistance_n)
            } else {
                driver.force_n(self.scene, self.speed_mps)
            };
            let Some(force_n) = wanted else { break };
            self.measure(force_n);
            let drive_mps2 = force_n / self.scene.inertial_mass_kg();
            let step = Step { size: self.step_s, drive_mps2, resistance_gain: gain };
            let (advance, _) =
                StepRule::Time.advance_or_crawl(&step, &self.scene.davis, self.speed_mps);
            self.speed_mps = advance.speed_mps + self.disturbed_mps * self.random.normal();
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

/// Splitmix64 (Steele, Lea, Flood 2014): enough for a rehearsal.
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (bits >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// The sum of twelve uniforms: mean 0, variance 1.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}
