//! Declarations that are far off where the simulated runs have no effect: the load of single runs, and the resistance.

use std::path::Path;

use dynocar::dataset;
use dynocar_analysis::explain::answer::{ExplainAnswer, ParameterValue, Verdict};
use dynocar_analysis::explain::explain;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::dataset_writer::write_dataset;
use dynocar_tests::simulator::{EffectRequest, SimulatorSettings, TrainType, simulate};
use toml::{Table, Value};

/// A train type with stops on the way, and a seed.
const TRAINS: [(TrainType, u64); 3] =
    [(TrainType::Regional, 73_001), (TrainType::Regional, 73_002), (TrainType::Freight, 73_003)];

/// Writes six runs without an effect, of which two are held out.
fn write((train_type, seed): (TrainType, u64), folder: &Path) {
    let settings = SimulatorSettings {
        train_type: Some(train_type),
        runs: 6,
        holdout_runs: 2,
        ..SimulatorSettings::new(seed, EffectRequest::none())
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
