//! Masses on a line whose gradient was learned from the forces of two passes.

use std::path::Path;

use dynocar::dataset;
use dynocar_analysis::dataset::{Dataset, Role, Run};
use dynocar_analysis::identify::identify;
use dynocar_estimators::EstimatorSettings;
use dynocar_shared::{Parameter, PipelineKind, SampleField, TrainSample};
use dynocar_tests::simulator::dataset_writer::write_dataset;
use dynocar_tests::simulator::{
    EffectRequest, GnssReceiver, SimulatorSettings, TrainType, simulate,
};
use dynocar_workshop::survey::survey_folder;

/// Number of samples, at 5 Hz, of a piece of a run.
const PIECE: usize = 600;
/// Seeds of the lines.
const SEEDS: std::ops::Range<u64> = 31..34;

/// Estimators of masses.
const KINDS: [PipelineKind; 2] = [PipelineKind::MassKalman, PipelineKind::JointLeastSquares];

/// Returns the errors of the masses from pieces of held-out runs, in reported standard deviations, by estimator: with
/// the gradient's uncertainty stated in the line's file, and without it.
fn errors() -> [[Vec<f64>; KINDS.len()]; 2] {
    let mut both = [const { [const { Vec::new() }; KINDS.len()] }; 2];
    for seed in SEEDS {
        let settings = SimulatorSettings {
            train_type: Some(TrainType::Regional),
            duration_s: 1800.0,
            runs: 4,
            holdout_runs: 2,
            gnss: Some(GnssReceiver::USUAL),
            ..SimulatorSettings::new(seed, EffectRequest::none())
        };
        let truth = simulate(&settings);
        let folder = tempfile::tempdir().unwrap();
        let (raw, out) = (folder.path().join("raw"), folder.path().join("surveyed"));
        write_dataset(&truth, &raw).unwrap();
        survey_folder(&raw, None, &out).unwrap();
        for errors in &mut both {
            let surveyed = dataset::load(&out).unwrap();
            for (run, simulated) in surveyed.runs.iter().zip(&truth.runs) {
                if run.role == Role::Holdout {
                    for (kind, errors) in KINDS.into_iter().zip(&mut *errors) {
                        errors.extend(of_run(&surveyed, run, kind, simulated.plan.mass_kg));
                    }
                }
            }
            forget_uncertainty(&out.join("track.toml"));
        }
    }
    both
}

/// Removes the gradient's uncertainty from a line's file.
fn forget_uncertainty(file: &Path) {
    let mut document: toml::Table = std::fs::read_to_string(file).unwrap().parse().unwrap();
    document["track"].as_table_mut().unwrap().remove("gradient_std");
    std::fs::write(file, document.to_string()).unwrap();
}

fn of_run(dataset: &Dataset, run: &Run, kind: PipelineKind, true_kg: f64) -> Vec<f64> {
    let settings = EstimatorSettings::default_of(kind).unwrap();
    let piece = |own: &[TrainSample]| {
        let samples: Vec<TrainSample> = own
            .iter()
            .map(|sample| TrainSample { valid: sample.valid & !SampleField::Mass.bit(), ..*sample })
            .collect();
        let said = identify(dataset, &samples, &settings).unwrap().estimate();
        let std_t = said.std(Parameter::Mass)?;
        Some((said.value(Parameter::Mass)? - 1e-3 * true_kg) / std_t)
    };
    run.samples.chunks_exact(PIECE).filter_map(piece).collect()
}

fn rms(errors: &[f64]) -> f64 {
    (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt()
}

#[test]
fn masses_on_a_surveyed_line_are_as_sure_as_they_say() {
    let [stated, unstated] = errors();
    for (kind, (stated, unstated)) in KINDS.into_iter().zip(stated.iter().zip(&unstated)) {
        let (stated, count, unstated) = (rms(stated), stated.len(), rms(unstated));
        eprintln!("{kind:?}: {count} pieces, {stated:.2}, {unstated:.2} where nothing is stated");
        assert!((0.7..1.3).contains(&stated), "{kind:?}: {stated} of its own standard deviations");
        assert!(unstated > 1.1 * stated, "{kind:?}: the line's uncertainty changes nothing");
    }
}
