//! Railways recorded once a second, with forces of an instant, held from stamp to stamp, or averaged: the time offset
//! that a survey finds, and the subsequent explanation.

use dynocar::dataset;
use dynocar_analysis::dataset::Dataset;
use dynocar_analysis::explain::explain;
use dynocar_tests::simulator::dataset_writer::write_dataset;
use dynocar_tests::simulator::{
    EffectRequest, ForceSampling, GnssReceiver, SimulatorSettings, TrainType, simulate,
};
use dynocar_workshop::survey::survey_folder;

/// Seeds that were not used to choose any setting.
const SEEDS: std::ops::Range<u64> = 65_000..65_002;

/// Largest error in m/s over 60 s on a known line, however forces are recorded.
const KNOWN_LINE_MAX_MPS: f64 = 0.2;

fn settings(seed: u64, force_sampling: ForceSampling) -> SimulatorSettings {
    SimulatorSettings {
        train_type: Some(TrainType::Metro),
        duration_s: 1200.0,
        sample_period_s: 1.0,
        force_sampling,
        ..SimulatorSettings::new(seed, EffectRequest::none())
    }
}

/// Returns the effects found and the error in m/s over 60 s on runs held out.
fn explained(dataset: &Dataset) -> (Vec<&'static str>, f64) {
    let explained = explain(dataset, &|_, _| ()).unwrap();
    let kinds = explained.answer.effects.iter().map(|effect| effect.kind).collect();
    (kinds, explained.score.holdout_window60[1].rmse_mps().unwrap())
}

/// Seconds by which forces are stamped late, by a survey, for each seed.
fn late_s(force_sampling: ForceSampling) -> Vec<f64> {
    SEEDS
        .map(|seed| {
            let gnss = Some(GnssReceiver::USUAL);
            let raw = tempfile::tempdir().unwrap();
            let out = tempfile::tempdir().unwrap();
            let settings = SimulatorSettings { gnss, ..settings(seed, force_sampling) };
            write_dataset(&simulate(&settings), raw.path()).unwrap();
            let answer = survey_folder(raw.path(), None, out.path()).unwrap().answer;
            let late = &answer.learned.as_ref().unwrap().force_late_s;
            eprintln!(
                "seed {seed} {force_sampling:?} surveyed: late {:.3} ± {:.3} s",
                late.value,
                1.96 * late.std
            );
            let known = tempfile::tempdir().unwrap();
            let settings = SimulatorSettings { gnss: None, ..settings };
            write_dataset(&simulate(&settings), known.path()).unwrap();
            let (kinds, error_mps) = explained(&dataset::load(known.path()).unwrap());
            let is_right = match force_sampling {
                ForceSampling::Held => kinds == ["actuator_delay"],
                _ => kinds.is_empty(),
            };
            assert!(
                is_right && error_mps < KNOWN_LINE_MAX_MPS,
                "{seed}: {kinds:?}, {error_mps} m/s"
            );
            eprintln!(
                "seed {seed} {force_sampling:?} on a known line: {kinds:?}, {error_mps:.3} m/s"
            );
            late.value
        })
        .collect()
}

#[test]
fn a_survey_shows_forces_of_an_instant_held_ones_and_averages_apart() {
    for (sampling, expected_s) in
        [(ForceSampling::Instant, 0.0), (ForceSampling::Held, -0.5), (ForceSampling::Averaged, 0.5)]
    {
        for late_s in late_s(sampling) {
            assert!((late_s - expected_s).abs() < 0.1, "{sampling:?}: {late_s} s");
        }
    }
}
