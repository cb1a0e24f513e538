//! The model in force and its rivals over simulated trips.

use std::sync::Arc;

use dynocar_model::simulate::motion::{SimulatedMotion, advance};
use dynocar_model::train::{Davis, TrainModel};
use dynocar_shared::{SampleField, TrainId, TrainSample};

use super::evidence::RivalEvidence;
use super::{Ledger, ModelTrials, OpenLoop, Rival};

const TRAIN: TrainId = TrainId(1);
const MASS_KG: f64 = 100e3;

fn train(a: f64) -> TrainModel {
    TrainModel::bare("simulated", MASS_KG, Davis { a, b: 0.0, c: 0.0 })
}

fn rival(model: u64, a: f64) -> Rival {
    let open_loop = OpenLoop::new(Arc::new(train(a)), None);
    Rival::new(model, open_loop, Vec::new(), (RivalEvidence::new(0.1), Ledger::default()))
}

/// Five minutes of accelerating, coasting and braking on level track, every 0.2 s.
fn trip(run: u32, a: f64, sequence: &mut u64) -> Vec<TrainSample> {
    let step_s = 0.2;
    let w0_n = TrainModel::weight_kn(MASS_KG) * a;
    let mut motion = SimulatedMotion { distance_m: 0.0, speed_mps: 0.0 };
    let mut samples = Vec::new();
    for k in 0..1500_u32 {
        let (traction_n, brake_n) = match k {
            0..200 => (50e3, 0.0),
            200..1300 => (0.0, 0.0),
            _ => (0.0, 60e3),
        };
        *sequence += 1;
        let sample = TrainSample {
            time_ns: i64::from(k) * 200_000_000,
            sequence: *sequence,
            run,
            direction: 1,
            ..TrainSample::empty(TRAIN)
        };
        samples.push(
            sample
                .with(SampleField::Speed, motion.speed_mps)
                .with(SampleField::Position, 5000.0 + motion.distance_m)
                .with(SampleField::TractionForce, traction_n)
                .with(SampleField::BrakeForce, brake_n)
                .with(SampleField::Gradient, 0.0),
        );
        motion = advance(motion, step_s, |_, at| {
            let held_n = if at.speed_mps > 0.0 { w0_n + brake_n } else { 0.0 };
            (traction_n - held_n) / MASS_KG
        });
    }
    samples
}

#[test]
fn a_rival_that_is_right_wins_and_the_day_and_the_place_of_the_errors_are_known() {
    let mut trials = ModelTrials::new(TRAIN, rival(1, 2.0), vec![rival(2, 3.0)]);
    let (mut sequence, mut compared) = (0, 0);
    for run in 0..40 {
        for sample in trip(run, 3.0, &mut sequence) {
            compared += u32::from(trials.take(&sample, 86_400.0 * f64::from(run / 20)));
        }
    }
    assert_eq!(compared, 39, "the last trip goes on");
    let [wrong, right] = [&trials.in_force, &trials.rivals[0]];
    assert_eq!(right.evidence.trips(), 39);
    assert!(right.evidence.e_value() > 1e4, "{}", right.evidence.e_value());
    assert!(right.evidence.error_ratio().unwrap()[1] < 0.6);
    let error = |it: &Rival| it.ledger.all.rmse_mps().unwrap();
    assert!(error(wrong) > 0.1 && error(right) < 0.05, "{} {}", error(wrong), error(right));
    assert_eq!(wrong.ledger.days.keys().copied().collect::<Vec<_>>(), [0, 1]);
    assert!(wrong.ledger.places.keys().all(|place| (5..11).contains(place)));
}

#[test]
fn a_rival_with_the_right_wheels_wins_by_the_way() {
    let worn = |speed_scale: f64, a: f64| {
        let mut train = train(a);
        train.corrections.speed_scale = speed_scale;
        train
    };
    let rival = |model: u64, train: TrainModel| {
        let open_loop = OpenLoop::new(Arc::new(train), None);
        Rival::new(model, open_loop, Vec::new(), (RivalEvidence::new(0.1), Ledger::default()))
    };
    let rivals = vec![rival(2, worn(1.02, 3.0))];
    let mut trials = ModelTrials::new(TRAIN, rival(1, train(3.0)), rivals);
    let mut sequence = 0;
    for run in 0..30 {
        for mut sample in trip(run, 3.0, &mut sequence) {
            let speed_mps = sample.speed_mps;
            sample.set(SampleField::Speed, 1.02 * speed_mps);
            trials.take(&sample, 0.0);
        }
    }
    let [_, high] = trials.rivals[0].evidence.error_ratio().unwrap();
    assert!(high < 0.7, "{high}");
}

#[test]
fn a_rival_that_comes_in_mid_trip_is_compared_from_the_next_one_on() {
    let mut trials = ModelTrials::new(TRAIN, rival(1, 2.0), Vec::new());
    let mut sequence = 0;
    let first = trip(1, 3.0, &mut sequence);
    for (k, sample) in first.iter().enumerate() {
        if k == 1000 {
            trials.rivals.push(rival(2, 3.0));
        }
        trials.take(sample, 0.0);
    }
    for run in [2, 3] {
        for sample in trip(run, 3.0, &mut sequence) {
            trials.take(&sample, 0.0);
        }
    }
    assert_eq!(trials.rivals[0].evidence.trips(), 1);
}

#[test]
fn after_a_change_the_comparison_begins_anew_with_the_roles_exchanged() {
    let mut trials = ModelTrials::new(TRAIN, rival(1, 2.0), vec![rival(2, 3.0)]);
    let mut sequence = 0;
    for run in 0..4 {
        for sample in trip(run, 3.0, &mut sequence) {
            trials.take(&sample, 0.0);
        }
    }
    trials.change(0);
    assert_eq!((trials.in_force.model, trials.rivals[0].model), (2, 1));
    assert_eq!(trials.rivals[0].evidence.trips(), 0);
    for run in 4..30 {
        for sample in trip(run, 3.0, &mut sequence) {
            trials.take(&sample, 0.0);
        }
    }
    assert!(trials.rivals[0].evidence.e_value() < 6.0, "the old model is no better");
    assert!(trials.rivals[0].evidence.error_ratio().unwrap()[0] > 1.0);
}

#[test]
fn a_controller_that_counts_no_trips_is_compared_all_the_same() {
    let mut trials = ModelTrials::new(TRAIN, rival(1, 2.0), vec![rival(2, 3.0)]);
    let (mut sequence, mut start_ns) = (0, 0);
    for _ in 0..20 {
        for sample in trip(0, 3.0, &mut sequence) {
            let time_ns = start_ns + sample.time_ns;
            trials.take(&TrainSample { time_ns, ..sample }, 0.0);
        }
        start_ns += 600_000_000_000;
    }
    let trips = trials.rivals[0].evidence.trips();
    assert!((2..=4).contains(&trips), "{trips}");
}
