//! Adhesion and brake friction: a window of 40 samples by EM, by our smoother, and by the
//! textbook's; and the step of the extended Kalman filter.

use std::sync::Arc;

use dynocar_core::filter::Gaussian;
use dynocar_core::filter::random::Random;
use dynocar_core::pipeline::braking::engine::{Engine, Observation};
use dynocar_core::pipeline::braking::law::Law;
use dynocar_core::pipeline::braking::motion::{self, STATES, State, Walk};
use dynocar_core::pipeline::braking::tracker::{Prior, PriorScale, Tracker, TrackerModel};
use dynocar_estimators::xie::{
    EmModel, EmWindow, Expectation, KalmanExpectation, ParticleExpectation,
};
use dynocar_shared::Uncertain;
use nalgebra::RowVector4;

use super::em_peers::{
    FIRST_SPEED_STD_MPS, INITIAL, INPUTS, ITERATIONS, NOISE, PARTICLES, textbook_kalman_em,
    textbook_particle_em,
};
use super::measure::{Agreement, Case, Contender};
use super::textbook::{TextbookFilter, TextbookStep, smooth};

/// Samples of a window.
const SAMPLES: usize = 40;
const TRUTH: f64 = 0.08;
const FIRST_MPS: f64 = 80.0;
/// Windows in a pass.
const WINDOWS: u64 = 8;
/// Samples that the smoothed estimate lies back.
const LAG: usize = 25;
const SAME: Agreement = Agreement::Relative(1e-6);

/// Observations of a braking with a constant coefficient.
fn braking(samples: usize, seed: u64) -> Vec<Observation> {
    let mut random = Random::new(seed);
    let (mut distance_m, mut speed_mps) = (0.0, FIRST_MPS);
    let distance_std = (NOISE.distance_m2_per_s * INPUTS.step_s).sqrt();
    let speed_std = (NOISE.speed_m2_per_s3 * INPUTS.step_s).sqrt();
    (0..samples)
        .map(|_| {
            let observation = Observation {
                distance_m: distance_m + 0.1 * random.normal(),
                speed_mps,
                is_speed_valid: false,
                demand: INPUTS.demand,
            };
            let moved = motion::advance(&INPUTS, &Law::Constant, speed_mps, TRUTH);
            distance_m += moved.travelled_m + distance_std * random.normal();
            speed_mps = moved.speed_mps + speed_std * random.normal();
            observation
        })
        .collect()
}

type Windows = Arc<[Vec<Observation>]>;

/// The cases of this module.
pub fn cases() -> Vec<Case> {
    let windows: Windows = (1..=WINDOWS).map(|seed| braking(SAMPLES, seed)).collect();
    vec![particle_em(&windows), kalman_em(&windows), window_smoother(&windows), filter_step()]
}

/// An answer for each window.
fn contender(
    name: &str,
    windows: &Windows,
    mut run: impl FnMut(&[Observation]) -> Vec<f64> + 'static,
) -> Contender {
    Contender::new(name, windows.len(), windows, move |windows| {
        windows.iter().flat_map(|window| run(window)).collect()
    })
}

fn em_contender<E: Expectation + 'static>(windows: &Windows, expectation: E) -> Contender {
    let model = EmModel {
        noise: NOISE,
        window_steps: SAMPLES,
        slide_steps: 5,
        iterations: ITERATIONS,
        tolerance: 0.0,
        initial: Some(INITIAL),
        initial_speed_std_mps: FIRST_SPEED_STD_MPS,
        has_printed_cap: false,
    };
    let mut em = EmWindow::new(model, expectation);
    contender("ours", windows, move |window| {
        em.start(&window[0]);
        for observation in &window[1..] {
            em.step(&INPUTS, observation).expect("a sound window");
        }
        vec![em.estimate().expect("the window is full").coefficient.value]
    })
}

fn particle_em(windows: &Windows) -> Case {
    let mut random = Random::new(17);
    let ours = em_contender(windows, ParticleExpectation::new(PARTICLES, SAMPLES, 11));
    let peer = contender("textbook particle EM", windows, move |window| {
        vec![textbook_particle_em(window, &mut random)]
    });
    // Both scatter with their particles.
    Case::new(
        "EM window, 20 particles, 50 iterations, 40 samples",
        Agreement::Absolute(0.008),
        ours,
    )
    .peer(peer)
    .aim(3e6)
}

fn kalman_em(windows: &Windows) -> Case {
    let ours = em_contender(windows, KalmanExpectation::new(SAMPLES));
    let peer =
        contender("textbook Kalman + RTS EM", windows, |window| vec![textbook_kalman_em(window)]);
    Case::new("EM window, Kalman E-step, 50 iterations, 40 samples", SAME, ours).peer(peer)
}

fn tracker_model(walk: Walk) -> TrackerModel {
    TrackerModel {
        law: Law::Constant,
        noise: NOISE,
        walk,
        prior: Prior {
            speed_std_mps: FIRST_SPEED_STD_MPS,
            scale: PriorScale::OfLaw(Uncertain::new(INITIAL, 0.05)),
        },
    }
}

fn textbook_first(model: &TrackerModel, first: &Observation) -> TextbookFilter<STATES> {
    let Gaussian { mean, covariance } = model.initial(first);
    TextbookFilter::new(mean, covariance)
}

/// A step of the textbook's extended Kalman filter, with the same motion.
fn textbook_step(
    filter: &mut TextbookFilter<STATES>,
    model: &TrackerModel,
    observed: &Observation,
) -> TextbookStep<STATES> {
    let moved = motion::predict(&INPUTS, &model.law, model.walk, &filter.mean);
    let added = motion::process_noise(&model.noise, model.walk, INPUTS.step_s);
    let row = RowVector4::new(1.0, 0.0, 0.0, 0.0);
    let noise = model.noise.measured_distance_m2;
    filter.pass(Some(moved), &added, &row, observed.distance_m, noise)
}

fn window_smoother(windows: &Windows) -> Case {
    let model = tracker_model(Walk::Drift { std_per_s: 0.005, time_s: 20.0 });
    let of_peer = model.clone();
    let lag_s = LAG as f64 * INPUTS.step_s;
    let mut tracker = Tracker::new(model, lag_s, LAG, false);
    let ours = contender("ours", windows, move |window| {
        tracker.start(&window[0]);
        for observation in &window[1..] {
            tracker.step(&INPUTS, observation).expect("a sound window");
        }
        let Uncertain { value, std } = tracker.estimate().expect("it has begun").coefficient;
        vec![value, std * std]
    });
    let peer = contender("textbook Kalman + RTS", windows, move |window| {
        let mut filter = textbook_first(&of_peer, &window[0]);
        let mut forward = vec![TextbookStep {
            predicted: filter,
            filtered: filter,
            transition: nalgebra::SMatrix::identity(),
        }];
        let steps = window[1..].iter().map(|it| textbook_step(&mut filter, &of_peer, it));
        forward.extend(steps);
        let smoothed = smooth(&forward).expect("covariances have inverses");
        let lagged = &smoothed[SAMPLES - 1 - LAG];
        let scale = State::Scale as usize;
        vec![lagged.mean[scale], lagged.covariance[(scale, scale)]]
    });
    Case::new("fixed-lag smoother, window of 40 samples", SAME, ours).peer(peer).aim(20_000.0)
}

fn filter_step() -> Case {
    let data: Windows = std::iter::once(braking(200, 99)).collect();
    let steps = data[0].len() - 1;
    let model = tracker_model(Walk::Scale(1e-6));
    let of_peer = model.clone();
    let mut tracker = Tracker::new(model, 0.0, 0, false);
    let mut ours = contender("ours", &data, move |window| {
        tracker.start(&window[0]);
        for observation in &window[1..] {
            tracker.step(&INPUTS, observation).expect("a sound braking");
        }
        tracker.state().expect("it has begun").mean.iter().take(3).copied().collect()
    });
    let peer = |name: &str, is_joseph: bool| {
        let model = of_peer.clone();
        let mut peer = contender(name, &data, move |window| {
            let first = textbook_first(&model, &window[0]);
            let mut filter = TextbookFilter { is_joseph, ..first };
            for observed in &window[1..] {
                textbook_step(&mut filter, &model, observed);
            }
            filter.mean.iter().take(3).copied().collect()
        });
        peer.updates = steps;
        peer
    };
    ours.updates = steps;
    Case::new("braking EKF step", SAME, ours)
        .peer(peer("textbook EKF", false))
        .peer(peer("textbook EKF, Joseph form", true))
}
