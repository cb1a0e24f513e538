//! Declarations that are far off: the load of single runs, the load of all of them, the whole mass, and the resistance.

use std::path::Path;

use dynocar::dataset;
use dynocar_analysis::explain::answer::{ExplainAnswer, ParameterValue, Verdict};
use dynocar_analysis::explain::explain;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::dataset_writer::write_dataset;
use dynocar_tests::simulator::{EffectRequest, SimulatorSettings, TrainType, TrueEffect, simulate};
use toml::{Table, Value};

/// A train type with stops on the way, and a seed.
const TRAINS: [(TrainType, u64); 3] =
    [(TrainType::Regional, 73_001), (TrainType::Regional, 73_002), (TrainType::Freight, 73_003)];

/// Writes six runs without an effect, of which two are held out.
fn write(train: (TrainType, u64), folder: &Path) {
    write_with(train, EffectRequest::none(), folder);
}

fn write_with((train_type, seed): (TrainType, u64), effects: EffectRequest, folder: &Path) {
    let settings = SimulatorSettings {
        train_type: Some(train_type),
        runs: 6,
        holdout_runs: 2,
        ..SimulatorSettings::new(seed, effects)
    };
    write_dataset(&simulate(&settings), folder).unwrap();
}

/// Changes one of the files that describe a dataset.
fn change(folder: &Path, file: &str, with: impl FnOnce(&mut Table)) {
    let path = folder.join(file);
    let mut table: Table = std::fs::read_to_string(&path).unwrap().parse().unwrap();
    with(&mut table);
    std::fs::write(path, table.to_string()).unwrap();
}

fn answer(folder: &Path) -> ExplainAnswer {
    explain(&dataset::load(folder).unwrap(), &|_, _| ()).unwrap().answer
}

#[test]
fn a_load_that_one_run_does_not_declare_is_found_in_it_and_nowhere_else() {
    for train in TRAINS {
        let folder = tempfile::tempdir().unwrap();
        write(train, folder.path());
        let mut file = String::new();
        change(folder.path(), "dataset.toml", |dataset| {
            let runs = dataset["runs"].as_array_mut().unwrap();
            let fitted = runs.iter_mut().filter(|run| run["role"].as_str() == Some("fit"));
            let run = fitted.last().unwrap();
            file = run["file"].as_str().unwrap().to_owned();
            let mass_t = run["mass_t"].as_float().unwrap();
            run["mass_t"] = Value::Float(mass_t / 1.1);
        });
        let answer = answer(folder.path());
        let [effect] = &answer.effects[..] else { panic!("{train:?}: {}", answer.statement) };
        assert_eq!(effect.kind, EffectKind::MassChange.name(), "{train:?}: {}", answer.statement);
        let windows = effect.parameters.values().filter_map(|value| match value {
            ParameterValue::Windows(windows) => Some(windows),
            _ => None,
        });
        let windows: Vec<_> = windows.flatten().collect();
        assert!(!windows.is_empty(), "{train:?}: {}", answer.statement);
        for it in windows {
            assert_eq!(it.window.run, file, "{train:?}");
            assert!((it.mass_factor - 1.1).abs() < 0.03, "{train:?}: {}", it.mass_factor);
        }
    }
}

#[test]
fn a_resistance_declared_far_too_small_or_large_is_refitted_and_no_effect() {
    for train in TRAINS {
        for factor in [0.35, 0.5, 2.5] {
            let folder = tempfile::tempdir().unwrap();
            write(train, folder.path());
            change(folder.path(), "train.toml", |described| {
                let resistance = described["resistance"].as_table_mut().unwrap();
                for coefficient in ["a", "b", "c"] {
                    let declared = resistance[coefficient].as_float().unwrap();
                    resistance[coefficient] = Value::Float(factor * declared);
                }
            });
            let answer = answer(folder.path());
            let statement = &answer.statement;
            assert_eq!(answer.verdict, Verdict::None, "{train:?} times {factor}: {statement}");
        }
    }
}

/// Declares tare and full load about the mass of the train's file, and the load of no run.
fn declare_a_range(folder: &Path) {
    change(folder, "train.toml", |described| {
        let train = described["train"].as_table_mut().unwrap();
        let mass_t = train["mass_t"].as_float().unwrap();
        train["mass_t"] = Value::Float(0.8 * mass_t);
        train.insert("mass_full_t".into(), Value::Float(1.3 * mass_t));
    });
    change(folder, "dataset.toml", |dataset| {
        for run in dataset["runs"].as_array_mut().unwrap() {
            run.as_table_mut().unwrap().remove("mass_t");
        }
    });
}

#[test]
fn an_unweighed_load_between_tare_and_full_is_no_effect_and_hides_no_weak_brake() {
    for train in TRAINS {
        let folder = tempfile::tempdir().unwrap();
        write(train, folder.path());
        declare_a_range(folder.path());
        let own = answer(folder.path());
        assert_eq!(own.verdict, Verdict::None, "{train:?}: {}", own.statement);
        assert!(own.statement.contains("No sample weighs the load"), "{}", own.statement);

        let folder = tempfile::tempdir().unwrap();
        write_with(train, EffectRequest::Kinds(vec![EffectKind::BrakeGain]), folder.path());
        let gain = |answer: &ExplainAnswer| {
            let [effect] = &answer.effects[..] else { panic!("{train:?}: {}", answer.statement) };
            assert_eq!(effect.kind, EffectKind::BrakeGain.name(), "{}", answer.statement);
            let ParameterValue::Number(gain) = effect.parameters["gain"] else {
                panic!("a number")
            };
            gain
        };
        let weighed = gain(&answer(folder.path()));
        declare_a_range(folder.path());
        let unweighed = gain(&answer(folder.path()));
        assert!((unweighed - weighed).abs() < 0.03, "{train:?}: {unweighed} for {weighed}");
    }
}

#[test]
fn a_brake_a_little_off_is_no_other_mass_with_another_scale_of_the_traction() {
    for train in TRAINS {
        for gain in [0.97, 1.03] {
            let folder = tempfile::tempdir().unwrap();
            let brake = TrueEffect::BrakeGain { gain };
            write_with(train, EffectRequest::Exactly(vec![brake]), folder.path());
            let answer = answer(folder.path());
            assert!(answer.effects.is_empty(), "{train:?}, {gain}: {}", answer.statement);
        }
    }
}

#[test]
fn a_mass_declared_twice_or_half_the_true_one_is_a_changed_mass() {
    for train in TRAINS {
        for factor in [0.45, 2.2] {
            let folder = tempfile::tempdir().unwrap();
            write(train, folder.path());
            change(folder.path(), "dataset.toml", |dataset| {
                for run in dataset["runs"].as_array_mut().unwrap() {
                    let mass_t = run["mass_t"].as_float().unwrap();
                    run["mass_t"] = Value::Float(factor * mass_t);
                }
            });
            let answer = answer(folder.path());
            let [effect] = &answer.effects[..] else { panic!("{train:?}: {}", answer.statement) };
            assert_eq!(
                effect.kind,
                EffectKind::MassChange.name(),
                "{train:?}: {}",
                answer.statement
            );
        }
    }
}
