//! Lines as estimators see them: means along a train.

use super::*;

fn line() -> Track {
    Track::new(
        "test".into(),
        Some(3000.0),
        Some(&[(0.0, 4.0), (1000.0, -2.0)]),
        Some(vec![TrackCurve { start_m: 500.0, end_m: 600.0, radius_m: 400.0 }]),
        Some(vec![Tunnel { start_m: 2000.0, end_m: 2500.0 }]),
    )
    .unwrap()
}

#[test]
fn gradient_is_averaged_along_the_train() {
    let track = line();
    assert_eq!(track.gradient_permille(500.0, 200.0), Some(4.0));
    assert_eq!(track.gradient_permille(1000.0, 200.0), Some(1.0));
    assert_eq!(track.gradient_permille(1050.0, 200.0), Some(-0.5));
    assert_eq!(track.gradient_permille(9999.0, 200.0), Some(-2.0));
    assert_eq!(track.gradient_permille(-50.0, 200.0), Some(4.0));
}

#[test]
fn trains_the_other_way_round_may_have_a_gradient_of_their_own() {
    let falling = StepProfile::new(&[(0.0, 7.0)]).unwrap();
    let gradient_falling = Some(falling);
    let survey = TrackSurvey { gradient_falling, ..Default::default() };
    let track = Track { survey, ..line() };
    assert_eq!(track.gradient_towards_permille(1.0, 500.0, 200.0), Some(4.0));
    assert_eq!(track.gradient_towards_permille(-1.0, 500.0, 200.0), Some(7.0));
    assert_eq!(line().gradient_towards_permille(-1.0, 500.0, 200.0), Some(4.0));
}

#[test]
fn the_gradients_error_averages_out_over_long_segments_only() {
    let gradient_std_permille = Some(StepProfile::new(&[(0.0, 0.8)]).unwrap());
    let survey = TrackSurvey { gradient_std_permille, ..Default::default() };
    let track = Track { survey, ..line() };
    assert_eq!(track.gradient_std_permille(100.0, 200.0), Some(0.8));
    assert!((track.gradient_std_permille(100.0, 900.0).unwrap() - 0.4).abs() < 1e-12);
    assert_eq!(line().gradient_std_permille(100.0, 200.0), None);
}

#[test]
fn a_curve_shorter_than_the_train_acts_on_the_part_inside() {
    let curvature = line().curvature_per_m(550.0, 200.0).unwrap();
    assert!((curvature - 0.5 / 400.0).abs() < 1e-15);
}

#[test]
fn tunnel_share_grows_as_the_train_enters() {
    let track = line();
    assert_eq!(track.tunnel_share(1900.0, 200.0), Some(0.0));
    assert_eq!(track.tunnel_share(2000.0, 200.0), Some(0.5));
    assert_eq!(track.tunnel_share(2200.0, 200.0), Some(1.0));
    assert_eq!(track.tunnel_length_m(2200.0, 200.0), Some(500.0));
}

#[test]
fn an_absent_list_is_unknown_and_an_empty_one_is_none_there() {
    let unknown = Track::new("u".into(), None, None, None, None).unwrap();
    assert_eq!(unknown.gradient_permille(0.0, 100.0), None);
    assert_eq!(unknown.tunnel_share(0.0, 100.0), None);
    let empty = Track::new("e".into(), None, None, Some(vec![]), Some(vec![])).unwrap();
    assert_eq!(empty.curvature_per_m(0.0, 100.0), Some(0.0));
    assert!(empty.knows_tunnels());
}

#[test]
fn overlapping_and_reversed_intervals_are_refused_with_their_number() {
    let curve = |start_m, end_m, radius_m| TrackCurve { start_m, end_m, radius_m };
    let with = |curves| Track::new("x".into(), None, None, Some(curves), None).unwrap_err();
    assert!(matches!(
        with(vec![curve(0.0, 100.0, 300.0), curve(50.0, 150.0, 300.0)]),
        TrackError::Overlap { list: "curves", index: 2, .. }
    ));
    assert!(matches!(
        with(vec![curve(100.0, 0.0, 300.0)]),
        TrackError::BadInterval { index: 1, .. }
    ));
    assert!(matches!(with(vec![curve(0.0, 1.0, 0.0)]), TrackError::BadRadius { .. }));
    assert!(matches!(with(vec![curve(0.0, 1.0, 1e-320)]), TrackError::BadRadius { .. }));
    assert!(matches!(with(vec![curve(1e300, 2e300, 9.0)]), TrackError::BadInterval { .. }));
}

#[test]
fn touching_curves_are_one_after_the_other() {
    let curves = vec![
        TrackCurve { start_m: 0.0, end_m: 100.0, radius_m: 200.0 },
        TrackCurve { start_m: 100.0, end_m: 200.0, radius_m: 400.0 },
    ];
    let track = Track::new("t".into(), None, None, Some(curves), None).unwrap();
    let curvature = track.curvature_per_m(100.0, 100.0).unwrap();
    assert!((curvature - (0.5 / 200.0 + 0.5 / 400.0)).abs() < 1e-15);
}
