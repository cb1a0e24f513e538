//! The online trajectory filter: one hypothesis, and the bank of jump hypotheses.

use std::sync::Arc;

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
    TextbookFilter {
        mean: Vector4::new(DECLARED.a, DECLARED.b, DECLARED.c, drive.first_mps),
        covariance: SMatrix::from_diagonal(&deviations.component_mul(&deviations)),
    }
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
        let mut bank = TextbookBank::new(first_textbook(drive));
        for (step, measured_mps) in &drive.samples {
            bank.advance(step, *measured_mps);
        }
        let likeliest = &bank.members[bank.likeliest()].filter;
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

#[derive(Clone)]
struct Member {
    filter: TextbookFilter<4>,
    log_weight: f64,
    age_s: f64,
}

/// Extended Kalman filters with the bank's rules for jumps: one member more each second, the
/// two closest in relative age united when there are too many.
struct TextbookBank {
    members: Vec<Member>,
    since_spawn_s: f64,
}

impl TextbookBank {
    fn new(first: TextbookFilter<4>) -> Self {
        let first = Member { filter: first, log_weight: 0.0, age_s: 0.0 };
        TextbookBank { members: vec![first], since_spawn_s: 0.0 }
    }

    fn likeliest(&self) -> usize {
        let weight = |i: &usize| self.members[*i].log_weight;
        (0..self.members.len()).max_by(|i, j| weight(i).total_cmp(&weight(j))).unwrap_or(0)
    }

    fn advance(&mut self, step: &Step, measured_mps: f64) {
        self.since_spawn_s += STEP_S;
        if self.since_spawn_s >= JUMPS.spacing_s {
            self.spawn();
        }
        for member in &mut self.members {
            member.log_weight += textbook_step(&mut member.filter, step, measured_mps);
            member.age_s += STEP_S;
        }
        let best = self.members[self.likeliest()].log_weight;
        self.members.iter_mut().for_each(|member| member.log_weight -= best);
        self.members.retain(|member| member.log_weight > -40.0);
    }

    fn spawn(&mut self) {
        let mut child = self.members[self.likeliest()].clone();
        child.log_weight += (self.since_spawn_s.ln() - JUMPS.evidence).min(-0.7);
        child.age_s = 0.0;
        for i in [A, B, C] {
            child.filter.covariance[(i, i)] += JUMPS.std[i] * JUMPS.std[i];
        }
        self.since_spawn_s = 0.0;
        if self.members.len() == HYPOTHESES {
            self.unite();
        }
        self.members.push(child);
    }

    fn unite(&mut self) {
        let age = |i: usize| self.members[i].age_s;
        let gap = |i: usize| (age(i) - age(i + 1)) / age(i).max(f64::MIN_POSITIVE);
        let older = (0..self.members.len() - 1)
            .min_by(|&i, &j| gap(i).total_cmp(&gap(j)))
            .expect("a full bank has two members");
        let younger = self.members.remove(older + 1);
        let older = &mut self.members[older];
        let (more, less) = if older.log_weight >= younger.log_weight {
            (older.clone(), younger)
        } else {
            (younger, older.clone())
        };
        let odds = (less.log_weight - more.log_weight).exp();
        let share = odds / (1.0 + odds);
        let apart = less.filter.mean - more.filter.mean;
        let covariance = more.filter.covariance * (1.0 - share)
            + less.filter.covariance * share
            + apart * apart.transpose() * (share * (1.0 - share));
        let filter = TextbookFilter { mean: more.filter.mean + apart * share, covariance };
        *older = Member { filter, log_weight: more.log_weight + odds.ln_1p(), age_s: more.age_s };
    }
}
