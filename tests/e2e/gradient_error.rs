//! A declared gradient that is wrong along the line: told by the direction of travel.

use dynocar_core::dataset::Dataset;
use dynocar_core::explain::answer::{ParameterValue, Verdict};
use dynocar_core::explain::explain;
use dynocar_core::track::LinearProfile;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::dataset_writer::dataset_files;
use dynocar_tests::simulator::{Effect, EffectRequest, SimulatorSettings, TrainType, simulate};

#[test]
fn a_wrong_gradient_is_found_with_its_profile_and_ambiguous_where_all_runs_go_one_way() {
    let simulated = simulate(&SimulatorSettings {
        train_type: Some(TrainType::Regional),
        // Enough of them in either direction alone.
        runs: 20,
        holdout_runs: 4,
        ..SimulatorSettings::new(9001, EffectRequest::Kinds(vec![EffectKind::GradientError]))
    });
    let [Effect::GradientError { profile }] = &simulated.effects[..] else {
        panic!("{:?}", simulated.effects)
    };
    let truth = LinearProfile::new(profile.clone()).expect("a profile");
    let files = dataset_files(&simulated);
    let texts: Vec<(&str, &str)> =
        files.iter().map(|(path, text)| (path.as_str(), text.as_str())).collect();
    let dataset = Dataset::load(&texts[..]).expect("a simulated dataset");

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
