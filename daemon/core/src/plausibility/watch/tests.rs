//! The watch on a train that goes forth and back.

use dynocar_model::train::Davis;
use dynocar_shared::TrainId;

use super::*;
use crate::plausibility::{InputFault, diagnose};

const MASS_KG: f64 = 100e3;
/// Time in s from sample to sample.
const STEP_S: f64 = 0.5;

/// A train on a line with gradients, and its watch.
struct Drive {
    watch: PlausibilityWatch,
    time_s: f64,
    position_m: f64,
    speed_mps: f64,
}

impl Drive {
    fn new() -> Self {
        let train = TrainModel::bare("t", MASS_KG, Davis { a: 2.0, b: 0.0, c: 0.0 });
        let watch = PlausibilityWatch::new(Arc::new(train));
        Drive { watch, time_s: 0.0, position_m: 0.0, speed_mps: 15.0 }
    }

    /// Drives some m in a true direction, with another declared one and a gradient by chainage or along the travel.
    fn on(&mut self, way_m: f64, direction: i8, declared: i8, is_along_travel: bool) {
        let signed = f64::from(direction);
        let end_m = self.position_m + signed * way_m;
        while signed * (end_m - self.position_m) > 0.0 {
            let gradient_permille = 8.0 * (self.position_m / 700.0).sin();
            let climb_mps2 = 1e-3 * GRAVITY_MPS2 * signed * gradient_permille;
            let wanted_mps = 15.0 + 6.0 * (self.time_s / 40.0).sin();
            let driving_mps2 = 0.3 * (wanted_mps - self.speed_mps);
            self.speed_mps += STEP_S * (driving_mps2 - climb_mps2 - 0.02);
            self.position_m += STEP_S * signed * self.speed_mps;
            self.time_s += STEP_S;
            let mut sample = TrainSample::empty(TrainId(1))
                .with(SampleField::Speed, self.speed_mps)
                .with(SampleField::Position, self.position_m)
                .with(SampleField::TractionForce, MASS_KG * driving_mps2.max(0.0))
                .with(SampleField::BrakeForce, MASS_KG * (-driving_mps2).max(0.0));
            (sample.time_ns, sample.direction) = ((1e9 * self.time_s) as i64, declared);
            let sent = if is_along_travel { signed * gradient_permille } else { gradient_permille };
            self.watch.take(&sample, true, Some(f64::from(declared) * sent));
        }
    }

    fn faults(&self) -> Vec<InputFault> {
        diagnose(&self.watch.figures()).iter().map(|it| it.fault).collect()
    }
}

#[test]
fn a_direction_that_is_not_turned_is_named_at_once_on_the_way_back_and_no_longer_than_it_lasts() {
    let mut drive = Drive::new();
    drive.on(8_000.0, 1, 1, false);
    assert!(drive.faults().is_empty());
    drive.on(200.0, -1, 1, false);
    assert_eq!(drive.faults(), [InputFault::DirectionReversed]);
    drive.on(7_000.0, -1, 1, false);
    assert_eq!(drive.faults()[0], InputFault::DirectionReversed);
    drive.on(200.0, 1, 1, false);
    assert!(!drive.faults().contains(&InputFault::DirectionReversed));
}

#[test]
fn gradients_along_the_travel_are_named_on_the_way_back_and_those_along_the_chainage_are_not() {
    for is_along_travel in [false, true] {
        let mut drive = Drive::new();
        for _ in 0..3 {
            drive.on(6_000.0, 1, 1, is_along_travel);
            drive.on(6_000.0, -1, -1, is_along_travel);
        }
        let expected: &[InputFault] =
            if is_along_travel { &[InputFault::GradientAlongTravel] } else { &[] };
        assert_eq!(drive.faults(), expected);
    }
}
