//! Runs from stop to stop: from the last sample at rest to the next.

use std::ops::Range;

use dynocar_model::simulate::{Recording, STANDING_MPS, departs};

/// A run that moves for less time in s is a shunt in a queue, and says little.
const STOP_RUN_MOVING_MIN_S: f64 = 10.0;

/// The runs from stop to stop that can be simulated from departure to standstill: first sample,
/// at rest, and one past the last, at rest again.
pub fn stop_runs(recording: &Recording) -> Vec<Range<usize>> {
    let (samples, time_s) = (recording.samples(), recording.time_s());
    let mut runs = Vec::new();
    let mut from = None;
    for index in 0..samples.len() {
        let is_lost = !recording.is_simulated(index) || (index > 0 && recording.starts(index));
        if is_lost {
            from = None;
        } else if let Some(start) = from
            && samples[index].speed_mps <= STANDING_MPS
        {
            let moving = |at: &usize| samples[*at].speed_mps > STANDING_MPS;
            let moving_s: f64 =
                (start + 1..=index).filter(moving).map(|at| time_s[at] - time_s[at - 1]).sum();
            if moving_s >= STOP_RUN_MOVING_MIN_S {
                runs.push(start..index + 1);
            }
            from = None;
        }
        if departs(samples, index) && recording.is_simulated(index) {
            from = Some(index);
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use dynocar_model::force::ResolvedSample;
    use dynocar_model::simulate::{BridgeLimits, Prediction, QuadraticForces, Restart, SpeedError};
    use dynocar_model::train::Davis;

    use super::*;
    use crate::explain::evidence::coasting;

    fn recorded(samples: Vec<ResolvedSample>) -> Recording {
        Recording::new(samples, BridgeLimits::default()).unwrap()
    }

    fn predict(recording: &Recording, restart: Restart) -> Prediction {
        let mut prediction = Prediction::new();
        let davis = Davis { a: 1.5, b: 0.02, c: 0.004 };
        prediction.simulate(recording, &QuadraticForces::declared(recording, davis), restart);
        prediction
    }

    #[test]
    fn a_run_from_stop_to_stop_is_predicted_from_its_departure() {
        // Two runs of a minute between stands; a force of 1 kN too much is reported in the second.
        let pulled = |k: usize| {
            let second = k as f64 * 0.2;
            let within_s = second % 120.0;
            let (traction_n, brake_n) = match within_s {
                ..20.0 => (0.0, 60e3),
                ..50.0 => (60e3, 0.0),
                ..60.0 => (0.0, 0.0),
                _ => (0.0, 60e3),
            };
            let forces = (Some(traction_n), Some(brake_n));
            ResolvedSample {
                traction_force_n: forces.0,
                brake_force_n: forces.1,
                speed_mps: 0.0,
                time_ns: (second * 1e9).round() as i64,
                ..coasting()
            }
        };
        let made = recorded((0..1200).map(pulled).collect());
        let true_mps = predict(&made, Restart::FullRun).speed_mps().to_vec();
        let with = |gain: f64| {
            let samples = (0..1200).map(|k| {
                let sample = ResolvedSample { speed_mps: true_mps[k], ..pulled(k) };
                let gain = if k >= 600 { gain } else { 1.0 };
                let traction_force_n = sample.traction_force_n.map(|force| gain * force);
                ResolvedSample { traction_force_n, ..sample }
            });
            recorded(samples.collect())
        };
        let wrong = with(1.1);
        let runs = stop_runs(&wrong);
        assert_eq!(runs.len(), 2, "{runs:?}");
        for run in &runs {
            assert!(true_mps[run.start] <= 0.3 && true_mps[run.start + 1] > 0.3);
            assert!(true_mps[run.end - 1] <= 0.3 && true_mps[run.end - 2] > 0.3);
        }
        let prediction = predict(&wrong, Restart::AtDepartures);
        let error = |run| SpeedError::within(&wrong, &prediction, run).rmse_mps().unwrap();
        let errors_mps: Vec<f64> = runs.into_iter().map(error).collect();
        assert!(errors_mps[0] < 0.01 && errors_mps[1] > 0.3, "{errors_mps:?}");
        // A run that starts in motion or ends in it is none, nor is one with a gap of the forces.
        let mut gap: Vec<_> = with(1.0).samples().to_vec();
        for sample in &mut gap[150..180] {
            sample.traction_force_n = None;
        }
        assert_eq!(stop_runs(&recorded(gap)).len(), 1);
        assert_eq!(stop_runs(&recorded(with(1.0).samples()[150..600].to_vec())), Vec::new());
    }
}
