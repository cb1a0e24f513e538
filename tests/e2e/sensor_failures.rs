//! Failures of sensors are as frequent as was asked for.

use dynocar_shared::{SampleField, TrainId, TrainSample};
use dynocar_tests::sensor_failures::SensorFailure;

fn good() -> Vec<TrainSample> {
    let sample = |index: u64| {
        let mut sample = TrainSample::empty(TrainId(1))
            .with(SampleField::Speed, 10.0 + (index as f64 * 0.01).sin())
            .with(SampleField::Position, 2.0 * index as f64)
            .with(SampleField::TractionForce, 3e4 + index as f64)
            .with(SampleField::BrakeForce, 7.0);
        (sample.sequence, sample.time_ns) = (index + 1, index as i64 * 200_000_000);
        sample
    };
    (0..20_000).map(sample).collect()
}

#[test]
fn every_failure_changes_about_the_share_asked_for() {
    let good = good();
    for failure in SensorFailure::ALL {
        for rate in [0.001, 0.01, 0.5] {
            let spoiled = failure.apply(&good, rate, 5);
            let arrived = spoiled.samples.len() as u64;
            assert_eq!(arrived + spoiled.dropped, good.len() as u64, "{failure:?}");
            let changed = match failure {
                SensorFailure::Dropouts => spoiled.dropped as usize,
                _ => {
                    // NaN differs from itself as well.
                    good.iter().zip(&spoiled.samples).filter(|(a, b)| a != b).count()
                }
            };
            let share = changed as f64 / good.len() as f64;
            let expected = 0.2 * rate..=1.6 * rate;
            assert!(expected.contains(&share), "{failure:?} at {rate}: {share}");
        }
    }
}
