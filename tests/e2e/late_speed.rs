//! A late speed sensor is reported as such, and its errors on gradients are not reported as places.

use dynocar_analysis::explain::answer::{ExplainAnswer, ParameterValue, Verdict};
use dynocar_analysis::explain::explain;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::dataset_writer::{FileText, dataset_files, read_files};
use dynocar_tests::simulator::oracle::score;
use dynocar_tests::simulator::{
    EffectRequest, SimulatedDataset, SimulatorSettings, TrainType, TrueEffect, simulate,
};

fn answer(files: &[FileText]) -> ExplainAnswer {
    explain(&read_files(files), &|_, _| {}).expect("usable runs").answer
}

/// Returns every kind that an answer names, the found ones first.
fn named(answer: &ExplainAnswer) -> Vec<&str> {
    let found = answer.effects.iter().map(|effect| effect.kind);
    found.chain(answer.ambiguous_with.iter().copied()).collect()
}

/// Returns a parameter of the late speed and its standard deviation.
fn number_of(answer: &ExplainAnswer, name: &str) -> [f64; 2] {
    let effect = answer.effects.iter().find(|effect| effect.kind == "speed_delay").expect("found");
    [&effect.parameters, &effect.std].map(|all| match all[name] {
        ParameterValue::Number(value) => value,
        ref other => panic!("{name}: a number, not {other:?}"),
    })
}

fn simulated(seed: u64, effect: TrueEffect, is_level_and_straight: bool) -> SimulatedDataset {
    simulate(&SimulatorSettings {
        train_type: Some(if seed.is_multiple_of(2) {
            TrainType::Metro
        } else {
            TrainType::Regional
        }),
        is_level_and_straight,
        ..SimulatorSettings::new(seed, EffectRequest::Exactly(vec![effect]))
    })
}

#[test]
fn a_late_speed_is_named_whether_dead_time_or_lag_and_no_place_is_made_up() {
    let cases = [(9201, 0.4, 0.0), (9202, 0.8, 0.0), (9203, 0.0, 0.8), (9204, 0.5, 0.5)];
    for (seed, delay_s, lag_s) in cases {
        let dataset = simulated(seed, TrueEffect::SpeedDelay { delay_s, lag_s }, false);
        let answer = answer(&dataset_files(&dataset));
        let named = named(&answer);
        assert!(named.contains(&"speed_delay"), "{seed}: {}", answer.statement);
        assert!(
            named.iter().all(|kind| ["speed_delay", "actuator_delay"].contains(kind)),
            "{seed}: {}",
            answer.statement
        );
        for (name, truth) in [("delay_s", delay_s), ("lag_s", lag_s)] {
            let [found, std] = number_of(&answer, name);
            assert!((found - truth).abs() < 3.0 * std, "{seed}: {name} {found} ± {std}, {truth}");
        }
        // The remaining error is compared with that of the true model, which is noise.
        let left_mps = answer.rmse_after.unwrap();
        let true_mps = score(&dataset).full_run.true_mps;
        assert!(left_mps < 1.5 * true_mps.max(0.05), "{seed}: {left_mps}, {true_mps} at best");
    }
}

#[test]
fn on_a_level_line_a_position_of_its_own_shows_and_forces_that_act_late_stay_ambiguous() {
    let late_speed = TrueEffect::SpeedDelay { delay_s: 0.8, lag_s: 0.0 };
    let explained = answer(&dataset_files(&simulated(9202, late_speed, true)));
    assert_eq!(explained.verdict, Verdict::Effect, "{}", explained.statement);
    assert_eq!(named(&explained), ["speed_delay"], "{}", explained.statement);

    let late_force = TrueEffect::ActuatorDelay { delay_s: 0.8, lag_s: 0.0 };
    let open = answer(&dataset_files(&simulated(9202, late_force, true)));
    assert_eq!(open.verdict, Verdict::Ambiguous, "{}", open.statement);
    let mut kinds = named(&open);
    kinds.sort_unstable();
    assert_eq!(kinds, ["actuator_delay", "speed_delay"], "{}", open.statement);
    assert!(open.experiment.unwrap().contains("position of its own"));
}

#[test]
fn without_a_position_nothing_shows_a_late_speed_from_late_forces() {
    let late_speed = TrueEffect::SpeedDelay { delay_s: 0.8, lag_s: 0.0 };
    let mut files = dataset_files(&simulated(9202, late_speed, true));
    let (_, manifest) = files.iter_mut().find(|(path, _)| path == "dataset.toml").unwrap();
    let kept = manifest.lines().filter(|line| !line.starts_with("position"));
    *manifest = kept.map(|line| format!("{line}\n")).collect();
    let open = answer(&files);
    assert_eq!(open.verdict, Verdict::Ambiguous, "{}", open.statement);
    assert_eq!(named(&open), ["actuator_delay", "speed_delay"], "{}", open.statement);
    let why = open.considered.iter().find(|it| it.kind == EffectKind::SpeedDelay.name()).unwrap();
    assert!(why.reason.contains("integrated from the speed"), "{}", why.reason);
}
