//! The rate at which a model that is no better is adopted, over hundreds of train years.
//!
//! For each of many simulated trains without an effect, some hundred trips are driven and predicted by the declared
//! model and by rival models that are no better. Years are then made of these trips, drawn with replacement: this
//! measures the judgement on realistic scores.

use std::sync::Arc;

use dynocar_core::trial::evidence::RivalEvidence;
use dynocar_core::trial::{Ledger, ModelTrials, OpenLoop, Rival};
use dynocar_model::train::TrainModel;
use dynocar_shared::{TrainId, TrainSample};

use crate::simulator::random::{SimulatorRandom, Stream};
use crate::simulator::{EffectRequest, SimulatedWorld, SimulatorSettings, TrainType};

const TRAIN: TrainId = TrainId(1);
/// As in the configuration by default.
const LEAST_GAIN: f64 = 0.1;
/// Number of simulated trips of each train.
const DRIVEN: usize = 150;
/// Trips of a year.
const TRIPS_A_YEAR: usize = 10_000;

/// Counts of wrong adoptions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MonthsMistakes {
    /// Years of all trains together.
    pub train_years: f64,
    /// Rivals that take away less than the least gain, whose adoption is a mistake.
    pub rivals: usize,
    /// Rivals that take away more, by chance of the declaration; they are left out.
    pub better: usize,
    /// Adoptions of rivals that are no better.
    pub adopted: usize,
}

/// Trains of seeds from `seed` on, each for some years, while no rival is taken for better before
/// `trips_between_mistakes` trips on average.
pub fn measure(
    trains: u64,
    years: usize,
    seed: u64,
    trips_between_mistakes: f64,
) -> MonthsMistakes {
    let mut found = MonthsMistakes::default();
    for seed in seed..seed + trains {
        let all = scores(seed);
        let mean = |scores: &[f64]| scores.iter().sum::<f64>() / scores.len() as f64;
        let asked = dynocar_core::trial::evidence::score(1.0, (1.0 - LEAST_GAIN).powi(2));
        let (worse, better): (Vec<_>, Vec<_>) = all.iter().partition(|it| mean(it) < asked);
        found.better += better.len();
        found.rivals += worse.len();
        found.train_years += years as f64;
        let mut random = SimulatorRandom::new(seed, Stream::Effects);
        let level = trips_between_mistakes * all.len() as f64;
        let mut evidence = vec![RivalEvidence::new(LEAST_GAIN); worse.len()];
        for _ in 0..years * TRIPS_A_YEAR {
            let trip = random.integer(0, all[0].len() - 1);
            for (evidence, scores) in evidence.iter_mut().zip(&worse) {
                evidence.take(scores[trip]);
                if evidence.e_value() >= level {
                    found.adopted += 1;
                    *evidence = RivalEvidence::new(LEAST_GAIN);
                }
            }
        }
    }
    found
}

/// Returns the scores of each rival, trip by trip.
fn scores(seed: u64) -> Vec<Vec<f64>> {
    let settings = SimulatorSettings {
        runs: DRIVEN,
        holdout_runs: 0,
        duration_s: 600.0,
        train_type: Some(TrainType::ALL[seed as usize % TrainType::ALL.len()]),
        ..SimulatorSettings::new(seed, EffectRequest::none())
    };
    let world = SimulatedWorld::from_settings(&settings);
    let declared = &world.train.declared;
    let track = Arc::new(world.line.track.clone());
    let rival = |change: &dyn Fn(&mut TrainModel)| {
        let mut train = declared.clone();
        change(&mut train);
        let open_loop = OpenLoop::new(Arc::new(train), Some(Arc::clone(&track)));
        Rival::new(0, open_loop, Vec::new(), (RivalEvidence::new(LEAST_GAIN), Ledger::default()))
    };
    let rivals = vec![
        rival(&|it| it.resistance.a *= 1.02),
        rival(&|it| it.resistance.a *= 0.98),
        rival(&|it| it.corrections.traction_gain *= 1.005),
        rival(&|it| it.corrections.wind_plus_mps += 0.5),
    ];
    let mut trials = ModelTrials::new(TRAIN, rival(&|_| {}), rivals);
    let mut scores = vec![Vec::new(); trials.rivals.len()];
    let mut sequence = 0;
    for plan in &world.plans {
        let run = world.run(plan.clone(), &[]);
        for sample in &run.samples {
            sequence += 1;
            let run = run.plan.number as u32;
            let sample = TrainSample { sequence, run, train_id: TRAIN.0, ..*sample };
            if trials.take(&sample, 0.0) {
                for (scores, rival) in scores.iter_mut().zip(&trials.rivals) {
                    scores.extend(rival.newest_score);
                }
            }
        }
    }
    // Short trips are compared together with the next.
    let compared = scores[0].len();
    assert!(compared >= DRIVEN / 5 && scores.iter().all(|it| it.len() == compared), "{compared}");
    scores
}
