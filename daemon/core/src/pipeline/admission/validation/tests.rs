//! The validator on good and bad samples.

use std::sync::Arc;

use dynocar_model::force::ForceResolver;
use dynocar_model::train::{Davis, TrainModel};
use dynocar_shared::ParameterSnapshot;

use super::*;
use crate::pipeline::Echo;
use crate::pipeline::admission::Admission;

const TRAIN: TrainId = TrainId(3);

fn validator() -> Validator {
    Validator::new(TRAIN, 100_000.0)
}

/// Returns a train at a steady 20 m/s, five samples a second.
fn cruising(index: u64) -> TrainSample {
    let mut sample = TrainSample::empty(TRAIN)
        .with(SampleField::Speed, 20.0)
        .with(SampleField::Position, 4.0 * index as f64)
        .with(SampleField::TractionForce, 5_000.0)
        .with(SampleField::BrakeForce, 0.0);
    sample.time_ns = index as i64 * 200_000_000;
    sample.sequence = index + 1;
    sample
}

#[test]
fn steady_motion_passes_in_one_segment() {
    let mut validator = validator();
    for index in 0..50 {
        let sample = cruising(index);
        let valid = validator.check(&sample).unwrap();
        assert_eq!(valid.segment, 1);
        assert_eq!(valid.step_s, if index == 0 { 0.0 } else { 0.2 });
    }
    assert_eq!(validator.lost(), 0);
}

#[test]
fn a_bad_value_is_refused_with_its_reason() {
    let cases = [
        (cruising(1).with(SampleField::Speed, f64::NAN), RejectionReason::NotFinite),
        (cruising(1).with(SampleField::Speed, 400.0), RejectionReason::SpeedOutOfRange),
        (cruising(1).with(SampleField::Speed, -1.0), RejectionReason::SpeedOutOfRange),
        (cruising(1).with(SampleField::Speed, 72.0), RejectionReason::SpeedJump),
        (cruising(1).with(SampleField::Position, 900.0), RejectionReason::PositionJump),
        (cruising(1).with(SampleField::BrakeForce, -4.0), RejectionReason::ForceOutOfRange),
        (cruising(1).with(SampleField::TractionForce, 5e6), RejectionReason::ForceOutOfRange),
        (cruising(1).with(SampleField::Mass, 100.0), RejectionReason::MassOutOfRange),
        (cruising(1).with(SampleField::Gradient, 400.0), RejectionReason::OutOfRange),
    ];
    for (sample, reason) in cases {
        let mut validator = validator();
        validator.check(&cruising(0)).unwrap();
        assert_eq!(validator.check(&sample), Err(reason));
        assert!(validator.check(&cruising(2)).is_ok(), "{reason}: the next good one passes");
    }
}

#[test]
fn a_position_off_the_line_is_refused_where_its_length_is_known() {
    let at = |position_m: f64| cruising(0).with(SampleField::Position, position_m);
    let checked = |validator: &mut Validator, position_m| validator.check(&at(position_m)).err();
    assert_eq!(checked(&mut validator(), 5_300.0), None, "no line is known");
    for (position_m, expected) in [
        (5_240.0, None),
        (5_260.0, Some(RejectionReason::PositionJump)),
        (-240.0, None),
        (-260.0, Some(RejectionReason::PositionJump)),
    ] {
        let mut validator = validator();
        validator.keep_on_line(5_000.0, 100.0);
        assert_eq!(checked(&mut validator, position_m), expected, "{position_m} m");
    }
}

#[test]
fn repeated_and_reversed_samples_are_refused() {
    let mut validator = validator();
    validator.check(&cruising(5)).unwrap();
    let repeated = Err(RejectionReason::Repeated);
    assert_eq!(validator.check(&cruising(5)), repeated, "its number, too");
    let again = |index, sequence| TrainSample { sequence, ..cruising(index) };
    assert_eq!(validator.check(&again(5, 7)), repeated);
    let other = again(5, 8).with(SampleField::TractionForce, 5_001.0);
    assert_eq!(validator.check(&other), Err(RejectionReason::TimeNotIncreasing), "no copy");
    assert_eq!(validator.check(&TrainSample { sequence: 9, ..other }), repeated);
    assert_eq!(validator.check(&again(5, 10)), repeated, "another one came between");
    let mut reversed = again(6, 11);
    reversed.time_ns = cruising(3).time_ns;
    assert_eq!(validator.check(&reversed), Err(RejectionReason::TimeNotIncreasing));
}

#[test]
fn missing_sequence_numbers_count_as_lost() {
    let mut validator = validator();
    validator.check(&cruising(0)).unwrap();
    validator.check(&cruising(4)).unwrap();
    assert_eq!(validator.lost(), 3);
}

#[test]
fn what_came_before_the_first_sample_is_lost_from_where_the_count_begins() {
    for (counted_from, lost) in [(0, 9), (4, 5), (9, 0), (30, 0)] {
        let mut validator = validator();
        validator.count_from(counted_from);
        validator.check(&cruising(9)).unwrap();
        assert_eq!(validator.lost(), lost, "counted from {counted_from}");
        validator.check(&cruising(10)).unwrap();
        assert_eq!(validator.lost(), lost);
    }
}

#[test]
fn what_will_not_come_any_more_is_lost_and_counted_once() {
    let mut validator = validator();
    validator.count_up_to(2);
    assert_eq!(validator.lost(), 2, "before the first sample");
    validator.check(&cruising(2)).unwrap();
    validator.count_up_to(8);
    validator.count_up_to(8);
    validator.count_up_to(5);
    assert_eq!(validator.lost(), 7);
    let mut next = cruising(300);
    (next.run, next.sequence) = (9, 9);
    validator.check(&next).unwrap();
    assert_eq!(validator.lost(), 7, "the next controller counts on");
}

#[test]
fn one_wrong_sequence_number_is_taken_back_when_the_count_goes_on_without_it() {
    let mut validator = validator();
    validator.check(&cruising(0)).unwrap();
    let mut wrong = cruising(1);
    wrong.sequence = u64::MAX;
    assert!(validator.check(&wrong).is_ok(), "nothing says yet that it is wrong");
    assert_eq!(validator.lost(), u64::MAX - 2);
    let refused = Err(RejectionReason::SequenceNotIncreasing);
    for index in 2..7 {
        assert_eq!(validator.check(&cruising(index)), refused);
    }
    assert_eq!(validator.check(&cruising(5)), refused, "it does not go on");
    for index in 7..12 {
        assert_eq!(validator.check(&cruising(index)), refused);
    }
    assert!(validator.check(&cruising(12)).is_ok());
    assert_eq!(validator.lost(), 5, "only the five that a repeat cost more");
    validator.check(&cruising(20)).unwrap();
    assert_eq!(validator.lost(), 12);
}

#[test]
fn a_restarted_controller_starts_a_new_segment_and_its_own_count() {
    let mut validator = validator();
    for index in 0..10 {
        validator.check(&cruising(index)).unwrap();
    }
    let mut restarted = cruising(300);
    (restarted.run, restarted.sequence) = (9, 2);
    let valid = validator.check(&restarted).unwrap();
    assert_eq!((valid.segment, valid.step_s), (2, 0.0));
    assert_eq!(validator.lost(), 1, "its first sample never came");
}

#[test]
fn a_long_gap_starts_a_new_segment() {
    let mut validator = validator();
    validator.check(&cruising(0)).unwrap();
    let mut late = cruising(50);
    late.sequence = 2;
    assert_eq!(validator.check(&late).unwrap().segment, 2);
    assert_eq!(validator.lost(), 0);
}

#[test]
fn a_clock_set_back_is_refused_a_few_times_and_then_believed() {
    let mut validator = validator();
    for index in 1000..1010 {
        validator.check(&cruising(index)).unwrap();
    }
    let results: Vec<_> = (0..8)
        .map(|index| {
            let mut sample = cruising(index);
            sample.sequence = 1011 + index;
            validator.check(&sample).map(|valid| valid.segment)
        })
        .collect();
    assert!(results[..5].iter().all(|r| *r == Err(RejectionReason::TimeNotIncreasing)));
    assert_eq!(results[5], Ok(2));
    assert!(results[6].is_ok());
}

#[test]
fn a_clock_set_back_is_believed_where_each_sample_comes_twice() {
    let mut validator = validator();
    validator.check(&cruising(1000)).unwrap();
    for copy in 0..12 {
        let sample = TrainSample { sequence: 1002 + copy, ..cruising(copy / 2) };
        let checked = validator.check(&sample).map(|valid| valid.segment);
        match (copy / 2, copy % 2) {
            (_, 1) => assert_eq!(checked, Err(RejectionReason::Repeated)),
            (5, _) => assert_eq!(checked, Ok(2)),
            _ => assert_eq!(checked, Err(RejectionReason::TimeNotIncreasing)),
        }
    }
}

#[test]
fn a_sender_that_is_stuck_is_refused_as_one_whose_clock_stands() {
    let mut validator = validator();
    validator.check(&cruising(0)).unwrap();
    let refused = |sequence| {
        let sample = TrainSample { sequence, ..cruising(0) };
        validator.check(&sample).unwrap_err()
    };
    let refusals: Vec<_> = (2..200).map(refused).collect();
    let of_clock = refusals.iter().position(|it| *it == RejectionReason::TimeNotIncreasing);
    assert_eq!(of_clock, Some(100));
    assert!(refusals[100..].iter().all(|it| *it == RejectionReason::TimeNotIncreasing));
}

#[test]
fn copies_say_nothing_against_the_samples_and_other_values_of_the_same_time_do() {
    let train = Arc::new(TrainModel::bare("t", 100e3, Davis { a: 1.5, b: 0.0, c: 0.0 }));
    for (more_n, is_doubted) in [(0.0, false), (500.0, true)] {
        let mut admission = Admission::new(TRAIN, Arc::clone(&train));
        let mut resolver = ForceResolver::new(Arc::clone(&train), None);
        let mut sequence = 0;
        let mut echo = Echo;
        for index in 0..2000 {
            for copy in 0..1 + u32::from(index % 4 == 0) {
                sequence += 1;
                let force_n = 5_000.0 + more_n * f64::from(copy);
                let sample = cruising(index).with(SampleField::TractionForce, force_n);
                let sample = TrainSample { sequence, ..sample };
                admission.take(&sample, &mut resolver, &mut echo);
            }
        }
        let known = admission.write(&echo, &mut ParameterSnapshot::empty());
        assert_eq!(known.is_none(), is_doubted, "{more_n} N more in every fifth sample");
    }
}

#[test]
fn another_train_is_refused() {
    let mut sample = cruising(0);
    sample.train_id = 4;
    assert_eq!(validator().check(&sample), Err(RejectionReason::WrongTrain));
}
