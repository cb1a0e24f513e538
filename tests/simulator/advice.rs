//! The promises of `advice` are kept by the daemon's pipelines.
//!
//! A train is driven at random, and then through each manoeuvre of the catalogue; the forecast from the snapshot before
//! a manoeuvre is compared with the snapshot after it. Motion and forces are the simulator's; the samples have the
//! noise of sensors, and the true force is disturbed.

use std::sync::Arc;

use dynocar_analysis::advice::manoeuvre::{DriveKind, PlannedManoeuvre, Scene};
use dynocar_analysis::advice::noise::{NoiseSeen, davis_of};
use dynocar_analysis::advice::rehearsal::{KnownBefore, MASS, forecast};
use dynocar_analysis::advice::{best, forecasts};
use dynocar_core::pipeline::Pipeline;
use dynocar_estimators::EstimatorSettings;
use dynocar_model::simulate::motion::{SimulatedMotion, advance};
use dynocar_model::train::{Davis, EffortCurve, TrainModel};
use dynocar_shared::{
    Parameter, ParameterSnapshot, PipelineKind, SampleField, TrainId, TrainSample,
};
use dynocar_tests::simulator::driving::{Controls, TrainOnLine};
use dynocar_tests::simulator::random::{SimulatorRandom, Stream};

const STEP_S: f64 = 0.2;
const SPEED_NOISE_MPS: f64 = 0.03;
/// Root of the density of the disturbing force in N/kN √s.
const DISTURBANCE: f64 = 0.25;
const MASS_KG: f64 = 220e3;
const TRUTH: Davis = Davis { a: 1.7, b: 0.02, c: 0.0042 };
const SEEDS: u64 = 30;
/// Time in s of random driving before the first forecast.
const BEFORE_S: f64 = 120.0;
/// A manoeuvre counts that is foretold to leave at most this share of an interval.
const SHARE_MAX: f64 = 0.95;

/// The train as it is declared, with this mass.
fn declared_at(mass_kg: f64) -> Arc<TrainModel> {
    let resistance = Davis { a: 1.4, b: 0.03, c: 0.0035 };
    Arc::new(TrainModel {
        rotating_mass_factor: 0.06,
        traction: EffortCurve::new(vec![(0.0, 200e3), (10.0, 200e3), (40.0, 50e3)]),
        brake: EffortCurve::new(vec![(0.0, 180e3)]),
        ..TrainModel::bare("railcar", mass_kg, resistance)
    })
}

fn declared() -> Arc<TrainModel> {
    declared_at(MASS_KG)
}

/// A train with its sensors and one of the daemon's pipelines.
struct Trial {
    truth: TrainModel,
    pipeline: Pipeline,
    noise: NoiseSeen,
    random: SimulatorRandom,
    sample: TrainSample,
    motion: SimulatedMotion,
}

impl Trial {
    fn new(seed: u64) -> Trial {
        let declared = declared_at(0.9 * MASS_KG);
        let settings = EstimatorSettings::default_of(PipelineKind::TrainKalman).unwrap();
        let estimator = settings.build(&declared).unwrap();
        let truth = TrainModel { resistance: TRUTH, ..(*declared).clone() };
        Trial {
            truth,
            pipeline: Pipeline::new(TrainId(1), 0, declared, None, estimator),
            noise: NoiseSeen::default(),
            random: SimulatorRandom::new(seed, Stream::Sensors(0)),
            sample: TrainSample::empty(TrainId(1)).with(SampleField::Gradient, 0.0),
            motion: SimulatedMotion { distance_m: 0.0, speed_mps: 8.0 },
        }
    }

    fn snapshot(&self) -> &ParameterSnapshot {
        self.pipeline.snapshot()
    }

    /// A sample under a control force in N, and the motion to the next.
    fn step(&mut self, force_n: f64) {
        let controls =
            Controls { traction_force_n: force_n.max(0.0), brake_force_n: (-force_n).max(0.0) };
        self.sample.sequence += 1;
        self.sample.time_ns += (1e9 * STEP_S) as i64;
        let measured_mps = self.motion.speed_mps + SPEED_NOISE_MPS * self.random.gaussian();
        self.sample.set(SampleField::Speed, measured_mps.max(0.0));
        self.sample.set(SampleField::TractionForce, controls.traction_force_n);
        self.sample.set(SampleField::BrakeForce, controls.brake_force_n);
        self.pipeline.process(&self.sample);
        self.noise.see(self.pipeline.snapshot());
        let line = TrainOnLine {
            train: &self.truth,
            track: None,
            mass_kg: MASS_KG,
            start_m: 0.0,
            direction: 1.0,
        };
        let density = DISTURBANCE / STEP_S.sqrt() * self.random.gaussian();
        let disturbed_mps2 = 1e-3 * 9.81 / 1.06 * density;
        self.motion = advance(self.motion, STEP_S, |_, at| {
            line.acceleration_mps2(at, controls) + disturbed_mps2
        });
    }

    /// Holds a speed in m/s for a time; forces change no faster than actuators do.
    fn hold(&mut self, speed_mps: f64, time_s: f64) {
        for _ in 0..(time_s / STEP_S) as usize {
            let weight_kn = TrainModel::weight_kn(MASS_KG);
            let resistance_n = weight_kn * TRUTH.w0_n_per_kn(self.motion.speed_mps);
            let wanted_mps2 = 0.3 * (speed_mps - self.motion.speed_mps);
            let force_n = resistance_n + 1.06 * MASS_KG * wanted_mps2.clamp(-0.4, 0.4);
            self.step(force_n);
        }
    }

    /// Drives about between low and middle speeds: c is known worst after it.
    fn drive_about(&mut self) {
        let mut left_s = BEFORE_S;
        while left_s > 0.0 {
            let speed_mps = self.random.uniform(5.0, 18.0);
            self.hold(speed_mps, 30.0);
            left_s -= 30.0;
        }
    }

    /// Begins anew at a speed, as another trip does, and rolls on there for a while.
    fn begin_at(&mut self, speed_mps: f64) {
        self.motion.speed_mps = speed_mps;
        self.sample.run += 1;
        self.hold(speed_mps, 10.0);
    }

    /// The mass in t as it is known, and its standard deviation.
    fn mass_t(&self) -> (f64, f64) {
        let snapshot = self.snapshot();
        (snapshot.value(Parameter::Mass).unwrap(), snapshot.std(Parameter::Mass).unwrap())
    }

    fn known(&self) -> KnownBefore {
        KnownBefore { davis: davis_of(self.snapshot()).unwrap().1, mass_std_t: self.mass_t().1 }
    }

    fn scene<'a>(&self, train: &'a TrainModel) -> Scene<'a> {
        let davis = davis_of(self.snapshot()).map_or(TRUTH, |known| known.0);
        Scene::new(train, davis, MASS_KG, self.snapshot().speed_max_mps)
    }

    fn drive(&mut self, drive: PlannedManoeuvre) {
        let train = declared();
        let mut driver = drive.begin();
        for _ in 0..(drive.within_s / STEP_S) as usize {
            let scene = self.scene(&train);
            let Some(force_n) = driver.force_n(&scene, self.motion.speed_mps) else { break };
            self.step(force_n);
        }
    }
}

fn quantiles(mut values: Vec<f64>) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    [0.1, 0.5, 0.9].map(|share| values[(share * (values.len() - 1) as f64).round() as usize])
}

const STD: fn(&ParameterSnapshot, usize) -> f64 = |snapshot, coefficient| {
    let parameter = [Parameter::DavisA, Parameter::DavisB, Parameter::DavisC][coefficient];
    snapshot.std(parameter).unwrap()
};

#[test]
fn the_interval_of_the_resistance_after_a_manoeuvre_is_the_one_predicted() {
    let train = declared();
    let (mut ratios, mut shares, mut counts) = (Vec::new(), Vec::new(), [0; 3]);
    for seed in 0..SEEDS {
        let index = |k: usize| 4 * k + seed as usize;
        for k in 0..5 {
            let mut trial = Trial::new(seed);
            trial.drive_about();
            let drives = trial.scene(&train).catalogue(180.0);
            let drive = drives[index(k) % drives.len()];
            trial.begin_at(drive.from_mps);
            let noise = trial.noise.noise(trial.snapshot(), &train).unwrap();
            let expected_by_advice =
                forecast(&trial.scene(&train), &trial.known(), &noise, drive).unwrap();
            let now = [0, 1, 2].map(|i| STD(trial.snapshot(), i));
            trial.drive(drive);
            for i in (0..3).filter(|&i| expected_by_advice.std[i] <= SHARE_MAX * now[i]) {
                counts[i] += 1;
                ratios.push(expected_by_advice.std[i] / STD(trial.snapshot(), i));
                shares.push(STD(trial.snapshot(), i) / now[i]);
            }
        }
    }
    println!("shares of the interval left: {:.2?}", quantiles(shares));
    assert!(ratios.len() >= 30 && counts.iter().all(|&count| count > 0), "{counts:?}");
    let [low, median, high] = quantiles(ratios);
    println!("predicted / found: {median:.2}, 80 %: {low:.2} to {high:.2}; a, b, c: {counts:?}");
    assert!((0.85..1.5).contains(&median), "median {median}");
    assert!(low > 0.6 && high < 2.5, "{low} to {high}");
}

#[test]
fn the_advised_manoeuvre_shows_more_than_most_and_about_as_much_as_the_best() {
    let train = declared();
    let worst = 2;
    let (mut against_best, mut against_middle) = (Vec::new(), Vec::new());
    for seed in 100..110 {
        let mut first = Trial::new(seed);
        first.drive_about();
        let noise = first.noise.noise(first.snapshot(), &train).unwrap();
        let all = forecasts(first.snapshot(), &train, first.mass_t(), &noise, 60.0);
        let advised = best(&all, worst).unwrap().drive;
        let left = |drive: PlannedManoeuvre| {
            let mut trial = Trial::new(seed);
            trial.drive_about();
            trial.begin_at(drive.from_mps);
            trial.drive(drive);
            STD(trial.snapshot(), worst)
        };
        let advised_std = left(advised);
        let others = all.iter().filter(|it| it.drive != advised).map(|it| left(it.drive));
        let others: Vec<f64> = others.map(|std| advised_std / std).collect();
        against_best.push(others.iter().copied().fold(0.0, f64::max));
        against_middle.push(quantiles(others)[1]);
    }
    println!(
        "advised over the best other {against_best:.2?}, over the middle {against_middle:.2?}"
    );
    let [_, best, most] = quantiles(against_best);
    assert!(best < 1.25 && most < 1.35, "none of the others shows much more: {best}, {most}");
    let is_ahead = against_middle.iter().all(|&share| share < 0.97);
    assert!(is_ahead, "most of the others show less: {against_middle:.2?}");
}

#[test]
fn the_deviation_of_the_mass_after_traction_is_the_one_predicted() {
    let train = declared();
    let mut ratios = Vec::new();
    for seed in 0..SEEDS {
        let mut trial = Trial::new(seed);
        trial.drive_about();
        // A stop, after which the mass is another one as far as the pipeline knows.
        trial.hold(0.0, 60.0);
        trial.begin_at(3.0);
        let noise = trial.noise.noise(trial.snapshot(), &train).unwrap();
        let kind = DriveKind::Accelerate;
        let drive = PlannedManoeuvre { kind, from_mps: 3.0, to_mps: 38.0, within_s: 20.0 };
        let scene = Scene::new(&train, train.resistance, MASS_KG, 20.0);
        let expected_by_advice = forecast(&scene, &trial.known(), &noise, drive).unwrap();
        trial.drive(drive);
        ratios.push(expected_by_advice.std[MASS] / trial.snapshot().std(Parameter::Mass).unwrap());
    }
    let [low, median, high] = quantiles(ratios);
    println!("mass: predicted / found: median {median:.2}, 10 % {low:.2}, 90 % {high:.2}");
    assert!((0.6..1.7).contains(&median), "{median}");
    assert!(low > 0.3 && high < 3.0, "{low} to {high}");
}
