//! The load across stops and weighings, and the masses that a train can have.

use dynocar_model::force::ResolvedSample;
use dynocar_model::train::{Davis, TrainModel};

use super::TrainKalmanSettings;
use super::learned_state::*;
use super::weigher::LoadChange;

const SECOND_NS: i64 = 1_000_000_000;

fn train(full_mass_kg: Option<f64>) -> TrainModel {
    TrainModel { full_mass_kg, ..TrainModel::bare("t", 100e3, Davis { a: 1.0, b: 0.0, c: 0.0 }) }
}

/// Returns the changes by a train that stands from 10 to 40 s, with the mass that its samples carry.
fn changes(
    settings: &TrainKalmanSettings,
    mass_kg: impl Fn(i64) -> Option<f64>,
) -> Vec<LoadChange> {
    let mut load = LoadWatch::new(settings, &train(None));
    let seen = (0..60).filter_map(|second| {
        let mass = mass_kg(second);
        load.see(&ResolvedSample {
            time_ns: second * SECOND_NS,
            speed_mps: if (10..40).contains(&second) { 0.0 } else { 15.0 },
            mass_kg: mass.unwrap_or(100e3),
            is_mass_measured: mass.is_some(),
            ..ResolvedSample::coasting()
        })
    });
    seen.collect()
}

#[test]
fn a_load_is_opened_at_a_stop_and_anew_where_it_was_weighed_again() {
    let settings = TrainKalmanSettings::default();
    let (weighed, declared) = (LoadChange::Weighed, LoadChange::Anew(1.0, 0.15 * 0.15));
    let open = |by, variance| LoadChange::Opened { by, mean: 1.0, variance };
    let opened = open(0.1 * 0.1, 0.15 * 0.15);
    let weighed_again = open(2.0 * 0.03 * 0.03, 0.03 * 0.03);
    let same = |one: &[LoadChange], other: &[LoadChange]| {
        assert_eq!(one.len(), other.len(), "{one:?}");
        for pair in one.iter().zip(other) {
            let (a, b) = match pair {
                (LoadChange::Anew(one, a), LoadChange::Anew(other, b)) => {
                    assert_eq!(one, other, "{pair:?}");
                    (a, b)
                }
                (LoadChange::Weighed, LoadChange::Weighed) => continue,
                (
                    LoadChange::Opened { by: a, variance, .. },
                    LoadChange::Opened { by: b, variance: same, .. },
                ) => {
                    assert!((variance / same - 1.0).abs() < 1e-12, "{pair:?}");
                    (a, b)
                }
                _ => panic!("{pair:?}"),
            };
            assert!((a / b - 1.0).abs() < 1e-12, "{pair:?}");
        }
    };
    same(&changes(&settings, |_| None), &[declared, opened]);
    same(&changes(&settings, |_| Some(100e3)), &[weighed, weighed_again]);
    let boarded = |second| Some(if second < 20 { 100e3 } else { 108e3 });
    same(&changes(&settings, boarded), &[weighed, weighed_again, weighed]);
}

#[test]
fn a_mass_that_is_exact_is_never_opened() {
    let exact = TrainKalmanSettings { mass_std_percent: 0.0, ..Default::default() };
    assert_eq!(changes(&exact, |_| Some(100e3)), [LoadChange::Weighed]);
}

#[test]
fn between_tare_and_full_load_any_mass_is_as_likely() {
    let load = LoadWatch::new(&TrainKalmanSettings::default(), &train(Some(140e3)));
    let (mean, variance) = load.prior();
    assert!((mean - 100.0 / 120.0).abs() < 1e-12);
    let std_share = 40.0 / 12_f64.sqrt() / 120.0;
    assert!((variance.sqrt() / mean - std_share).abs() < 1e-12);
}

#[test]
fn a_mass_is_allowed_between_tare_and_full_near_the_weighed_one_or_a_wide_way_off() {
    let settings = TrainKalmanSettings::default();
    let allowed = |train: &TrainModel, weighed_kg: Option<f64>| {
        let mut load = LoadWatch::new(&settings, train);
        load.see(&ResolvedSample {
            mass_kg: weighed_kg.unwrap_or(100e3),
            is_mass_measured: weighed_kg.is_some(),
            ..ResolvedSample::coasting()
        });
        let (least_kg, most_kg) = load.allowed_kg();
        [least_kg, most_kg].map(|it| (1e-3 * it).round() as u32)
    };
    assert_eq!(allowed(&train(Some(140e3)), None), [88, 157]);
    assert_eq!(allowed(&train(Some(140e3)), Some(120e3)), [96, 144]);
    assert_eq!(allowed(&train(None), None), [63, 250]);
    assert_eq!(allowed(&train(None), Some(120e3)), [96, 144]);
    assert_eq!(allowed(&train(None), Some(500e3)), [400, 600], "more wagons than declared");
}

#[test]
fn a_load_is_opened_while_the_train_stands() {
    let mut load = LoadWatch::new(&TrainKalmanSettings::default(), &train(None));
    let opened_at: Vec<i64> = (0..60)
        .filter(|&second| {
            let speed_mps = if (10..40).contains(&second) { 0.0 } else { 15.0 };
            let time_ns = second * SECOND_NS;
            let sample = ResolvedSample { time_ns, speed_mps, ..ResolvedSample::coasting() };
            matches!(load.see(&sample), Some(LoadChange::Opened { .. }))
        })
        .collect();
    assert_eq!(opened_at, [11]);
}

#[test]
fn noise_of_a_weigher_under_way_is_no_other_load() {
    // 2 t of passengers board at the stop; the weigher shows every second another 0.3 t.
    let noisy = |second: i64| {
        let boarded_kg = if second < 20 { 100e3 } else { 102e3 };
        Some(boarded_kg + if second % 2 == 0 { 0.0 } else { 300.0 })
    };
    let changes = changes(&TrainKalmanSettings::default(), noisy);
    let shown = changes.iter().filter_map(|change| match change {
        LoadChange::ShownAs(factor) => Some(*factor),
        _ => None,
    });
    let shown: Vec<f64> = shown.collect();
    assert!(shown.len() > 20 && shown.iter().all(|it| (it - 1.0).abs() < 0.004), "{shown:?}");
    let weighed = changes.len() - shown.len();
    assert!((20..=34).contains(&weighed), "{changes:?}");
}

#[test]
fn another_load_under_way_is_weighed_anew() {
    let coupled = |second: i64| Some(if second < 50 { 100e3 } else { 130e3 });
    let changes = changes(&TrainKalmanSettings::default(), coupled);
    assert!(matches!(changes[..], [.., LoadChange::Weighed]), "{changes:?}");
}
