//! A declared gradient that is wrong along the line: identified by the direction of travel.

use dynocar_analysis::dataset::Dataset;
use dynocar_analysis::explain::answer::{ParameterValue, Verdict};
use dynocar_analysis::explain::explain;
use dynocar_model::track::{LinearProfile, StepProfile};
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::dataset_writer::{dataset_files, read_files};
use dynocar_tests::simulator::{EffectRequest, SimulatorSettings, TrainType, TrueEffect, simulate};

#[test]
fn a_wrong_gradient_is_found_with_its_profile_and_ambiguous_where_all_runs_go_one_way() {
    let simulated = simulate(&SimulatorSettings {
        train_type: Some(TrainType::Regional),
        // Enough runs in either direction alone.
        runs: 16,
        holdout_runs: 4,
        ..SimulatorSettings::new(9001, EffectRequest::Kinds(vec![EffectKind::GradientError]))
    });
    let [TrueEffect::GradientError { profile }] = &simulated.effects[..] else {
        panic!("{:?}", simulated.effects)
    };
    let truth = LinearProfile::new(profile.clone()).expect("a profile");
    let dataset = read_files(&dataset_files(&simulated));

    let answer = explain(&dataset, &|_, _| {}).expect("usable runs").answer;
    assert_eq!(answer.verdict, Verdict::Effect, "{}", answer.statement);
    let kinds: Vec<&str> = answer.effects.iter().map(|effect| effect.kind).collect();
    assert_eq!(kinds, ["gradient_error"], "{}", answer.statement);
    let found = &answer.effects[0];
    let (Some(ParameterValue::Profile(values)), Some(ParameterValue::Profile(deviations))) =
        (found.parameters.get("profile"), found.std.get("profile"))
    else {
        panic!("{found:?}")
    };
    let held = values.iter().zip(deviations).filter(|([at_m, permille], [_, std])| {
        // A node between which the truth bends stands for a stretch, not for a point.
        (permille - truth.at(*at_m)).abs() < 3.0 * std + 0.25
    });
    assert!(10 * held.count() >= 9 * values.len(), "{values:?}");

    let one_way = Dataset {
        runs: dataset.runs.iter().filter(|run| run.direction == 1).cloned().collect(),
        ..dataset
    };
    let answer = explain(&one_way, &|_, _| {}).expect("usable runs").answer;
    assert_eq!(answer.verdict, Verdict::Ambiguous, "{}", answer.statement);
    assert_eq!(answer.effects[0].kind, "gradient_error", "{}", answer.statement);
    assert!(answer.ambiguous_with.contains(&"local_resistance"), "{}", answer.statement);
}

#[test]
fn a_line_declared_level_is_found_to_climb() {
    let simulated = simulate(&SimulatorSettings {
        train_type: Some(TrainType::Regional),
        ..SimulatorSettings::new(9002, EffectRequest::none())
    });
    let mut files = dataset_files(&simulated);
    let (_, track) = files.iter_mut().find(|(path, _)| path == "track.toml").expect("a line");
    let mut document: toml::Table = track.parse().expect("the line's file");
    let line = document["track"].as_table_mut().expect("a table");
    let declared: Vec<(f64, f64)> =
        line["gradient"].clone().try_into().expect("a list of chainages and gradients");
    line.insert("gradient".into(), toml::Value::from(vec![vec![0.0, 0.0]]));
    *track = document.to_string();
    let dataset = read_files(&files);

    let answer = explain(&dataset, &|_, _| {}).expect("usable runs").answer;
    let kinds: Vec<&str> = answer.effects.iter().map(|effect| effect.kind).collect();
    assert_eq!(kinds, ["gradient_error"], "{}", answer.statement);
    let (before, after) = (answer.rmse_before.unwrap(), answer.rmse_after.unwrap());
    assert!(after < 0.25 * before, "{before} to {after} m/s");
    let Some(ParameterValue::Profile(found)) = answer.effects[0].parameters.get("profile") else {
        panic!("{:?}", answer.effects)
    };
    // Of the climb that a straight line between the nodes can follow, most.
    let truth = StepProfile::new(&declared).expect("the simulator's line");
    let apart_m = found[1][0] - found[0][0];
    let (mut squares, mut left) = (0.0, 0.0);
    for [at_m, permille] in found {
        let true_permille = truth.mean_around(*at_m, apart_m);
        squares += true_permille.powi(2);
        left += (permille - true_permille).powi(2);
    }
    assert!(left < 0.25 * squares, "{left} of {squares}");
}
