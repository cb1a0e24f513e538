//! The online trajectory filter: one hypothesis, and the bank of jump hypotheses.

use std::sync::Arc;

use dynocar_core::filter::Gaussian;
use dynocar_core::filter::bank::{Bank, Odds};
use dynocar_core::filter::mixture::Mixture;
use dynocar_core::filter::random::Random;
use dynocar_estimators::xia::trajectory::bank::{JumpBank, JumpModel};
use dynocar_estimators::xia::trajectory::hypothesis::{Hypothesis, OutlierModel};
use dynocar_estimators::xia::trajectory::index::{A, B, C, SPEED};
use dynocar_estimators::xia::trajectory::noise::{LearnedNoise, NoiseModel};
use dynocar_estimators::xia::trajectory::online::{OnlineFilter, OnlineSettings};
use dynocar_estimators::xia::trajectory::step::{Step, StepRule};
use dynocar_model::force::balance::mps2_per_n_per_kn;
use dynocar_model::train::Davis;
use nalgebra::{RowVector4, SMatrix, Vector3, Vector4};

use super::measure::{Agreement, Case, Contender};
use super::textbook::TextbookFilter;

const STEPS: usize = 1000;
const STEP_S: f64 = 0.2;
const HYPOTHESES: usize = 8;
const DECLARED: Davis = Davis { a: 1.0, b: 0.02, c: 0.0012 };
const DAVIS_STD: Vector3<f64> = Vector3::new(0.8, 0.03, 0.001);
const JUMPS: JumpModel = JumpModel { evidence: 16.0, std: DAVIS_STD, spacing_s: 1.0 };
/// No measurement is taken for an outlier, so that the textbook's filter can follow.
const NO_OUTLIERS: OutlierModel = OutlierModel { share: 0.0, density: 0.5 };
const SAME: Agreement = Agreement::Relative(1e-5);

/// A step and the speed measured after it.
type Sample = (Step, f64);

struct Drive {
    first_mps: f64,
    samples: Vec<Sample>,
}

/// Traction and coasting by turns; the resistance grows by half midway.
fn drive() -> Arc<Drive> {
    let mut random = Random::new(3);
    let gain = mps2_per_n_per_kn(0.06);
    let mut speed_mps = 25.0;
    let samples = (0..STEPS).map(|index| {
        let rain = if index < STEPS / 2 { 1.0 } else { 1.5 };
        let truth = Davis { a: 1.3 * rain, b: 0.015 * rain, c: 0.0014 * rain };
        let drive_mps2 = if (index / 100) % 2 == 0 { 0.12 } else { -0.02 };
        let step = Step { size: STEP_S, drive_mps2, resistance_gain: gain };
        let after = StepRule::Time.advance(&step, &truth, speed_mps).expect("the train rolls");
        speed_mps = after.speed_mps;
        (step, speed_mps + 0.03 * random.normal())
    });
    Arc::new(Drive { first_mps: 25.0, samples: samples.collect() })
}

/// The noise that `trajectory_kalman` starts from.
fn noise(learns: bool) -> NoiseModel {
    let gain = mps2_per_n_per_kn(0.06);
    NoiseModel {
        speed_noise_mps: 0.03,
        speed_noise_range_mps: (1e-3, 1.0),
        disturbance: 0.2 * gain,
        disturbance_range: (0.01 * gain, 10.0 * gain),
        memory: 2000.0,
        learns_speed_noise: learns,
        learns_disturbance: learns,
    }
}

/// The cases of this module.
pub fn cases() -> Vec<Case> {
    let drive = drive();
    vec![step_of_one(&drive), step_of_bank(&drive), step_as_run(&drive)]
}

fn first_hypothesis(drive: &Drive, noise: &NoiseModel) -> Hypothesis {
    let mut first = Hypothesis::new(&DECLARED, &DAVIS_STD, LearnedNoise::new(noise));
    first.anchor(drive.first_mps);
    first
}

fn first_textbook(drive: &Drive) -> TextbookFilter<4> {
    let deviations = Vector4::new(DAVIS_STD[0], DAVIS_STD[1], DAVIS_STD[2], 0.03);
    let mean = Vector4::new(DECLARED.a, DECLARED.b, DECLARED.c, drive.first_mps);
    TextbookFilter::new(mean, SMatrix::from_diagonal(&deviations.component_mul(&deviations)))
}

/// An extended Kalman filter's step over time and its measurement; the log-likelihood.
fn textbook_step(filter: &mut TextbookFilter<4>, step: &Step, measured_mps: f64) -> f64 {
    let mean = filter.mean;
    let davis = Davis { a: mean[A], b: mean[B], c: mean[C] };
    let (advance, _) = StepRule::Time.advance_or_crawl(step, &davis, mean[SPEED]);
    let mut transition = SMatrix::<f64, 4, 4>::identity();
    transition.fixed_view_mut::<1, 3>(SPEED, A).copy_from(&advance.by_davis.transpose());
    transition[(SPEED, SPEED)] = advance.by_speed;
    let model = noise(false);
    let mut added = SMatrix::<f64, 4, 4>::zeros();
    added[(SPEED, SPEED)] = model.disturbance * model.disturbance * STEP_S;
    let moved = Vector4::new(mean[A], mean[B], mean[C], advance.speed_mps);
    filter.predict(moved, &transition, &added);
    let row = RowVector4::new(0.0, 0.0, 0.0, 1.0);
    let variance = model.speed_noise_mps * model.speed_noise_mps;
    filter.measure(&row, measured_mps, variance).log_likelihood()
}

fn step_of_one(drive: &Arc<Drive>) -> Case {
    let ours = Contender::new("ours", STEPS, drive, |drive| {
        let model = noise(false);
        let mut filter = first_hypothesis(drive, &model);
        for (step, measured_mps) in &drive.samples {
            filter.predict(StepRule::Time, step, STEP_S, 0.0);
            filter.measure(*measured_mps, &model, &NO_OUTLIERS);
        }
        filter.state.as_slice().to_vec()
    });
    let peer = Contender::new("textbook EKF", STEPS, drive, |drive| {
        let mut filter = first_textbook(drive);
        for (step, measured_mps) in &drive.samples {
            textbook_step(&mut filter, step, *measured_mps);
        }
        filter.mean.as_slice().to_vec()
    });
    Case::new("trajectory filter step, one hypothesis", SAME, ours).peer(peer)
}

fn step_of_bank(drive: &Arc<Drive>) -> Case {
    let ours = Contender::new("ours", STEPS, drive, |drive| {
        let model = noise(false);
        let first = first_hypothesis(drive, &model);
        let mut bank = JumpBank::new(first, HYPOTHESES, JUMPS, model, NO_OUTLIERS);
        for (step, measured_mps) in &drive.samples {
            bank.advance(StepRule::Time, step, STEP_S, *measured_mps);
        }
        let likeliest = bank.likeliest();
        let variances = likeliest.davis_covariance().diagonal();
        likeliest.state.iter().chain(&variances).copied().collect()
    });
    let peer = Contender::new("textbook EKF bank", STEPS, drive, |drive| {
        let members = Bank::even([(first_textbook(drive), 0.0)]);
        let mut bank = TextbookBank { members, since_spawn_s: 0.0 };
        for (step, measured_mps) in &drive.samples {
            bank.advance(step, *measured_mps);
        }
        let (likeliest, _) = bank.members.likeliest();
        let variances = likeliest.covariance.diagonal();
        likeliest.mean.iter().chain(variances.iter().take(3)).copied().collect()
    });
    Case::new("jump bank step, 8 hypotheses", SAME, ours).peer(peer).aim(3000.0)
}

/// As the pipeline runs it, with noise learned and outliers judged; no peer does that.
fn step_as_run(drive: &Arc<Drive>) -> Case {
    let ours = Contender::new("ours", STEPS, drive, |drive| {
        let mut filter = OnlineFilter::new(OnlineSettings {
            davis: DECLARED,
            davis_std: DAVIS_STD,
            jumps: JUMPS,
            hypotheses: HYPOTHESES,
            noise: noise(true),
        });
        filter.begin(drive.first_mps);
        for (step, measured_mps) in &drive.samples {
            filter.advance(StepRule::Time, step, STEP_S, *measured_mps);
            std::hint::black_box(filter.davis());
        }
        let (davis, _) = filter.davis();
        vec![davis.a, davis.b, davis.c]
    });
    Case::new("jump bank step, noise learned, published", SAME, ours).aim(3000.0)
}

/// Extended Kalman filters with their ages in s, and the bank's rules for jumps: one member more each second, the
/// two closest in relative age united when there are too many.
struct TextbookBank {
    members: Bank<(TextbookFilter<4>, f64), Odds, HYPOTHESES>,
    since_spawn_s: f64,
}

impl TextbookBank {
    fn advance(&mut self, step: &Step, measured_mps: f64) {
        self.since_spawn_s += STEP_S;
        if self.since_spawn_s >= JUMPS.spacing_s {
            self.spawn();
        }
        for ((filter, age_s), weight) in self.members.weighed_mut() {
            *weight *= textbook_step(filter, step, measured_mps).exp();
            *age_s += STEP_S;
        }
        self.members.settle();
        self.members.drop_up_to((-40.0_f64).exp());
    }

    fn spawn(&mut self) {
        let (mut child, _) = *self.members.likeliest();
        for i in [A, B, C] {
            child.covariance[(i, i)] += JUMPS.std[i] * JUMPS.std[i];
        }
        let weight = (self.since_spawn_s.ln() - JUMPS.evidence).min(-0.7).exp();
        self.since_spawn_s = 0.0;
        if self.members.hypotheses().len() == HYPOTHESES {
            self.unite();
        }
        self.members.join((child, 0.0), weight);
    }

    fn unite(&mut self) {
        let (all, weights) = (self.members.hypotheses(), self.members.weights());
        let gap = |i: usize| (all[i].1 - all[i + 1].1) / all[i].1.max(f64::MIN_POSITIVE);
        let older = (0..all.len() - 1)
            .min_by(|&i, &j| gap(i).total_cmp(&gap(j)))
            .expect("a full bank has two members");
        let mut both = Mixture::default();
        for at in [older, older + 1] {
            both.add(weights[at], &all[at].0.mean, &all[at].0.covariance);
        }
        let Gaussian { mean, covariance } = both.belief;
        let heavier = if weights[older] >= weights[older + 1] { older } else { older + 1 };
        let united = (TextbookFilter::new(mean, covariance), all[heavier].1);
        self.members.unite(older, (united, both.weight));
    }
}
