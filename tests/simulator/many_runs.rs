//! Datasets of many runs: the search holds some of them, with thinned samples, and reads each run once, so that work
//! and memory grow no faster than the data.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Mutex;

use dynocar_analysis::dataset::{Dataset, Role, Run};
use dynocar_analysis::explain::answer::{EffectAnswer, ParameterValue};
use dynocar_analysis::explain::evidence::{RunData, RunDataError};
use dynocar_analysis::explain::many::{Held, Many};
use dynocar_analysis::explain::{explain, explain_many};
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::dataset_writer::{dataset_files, read_files};
use dynocar_tests::simulator::run_maker::RunPlan;
use dynocar_tests::simulator::{EffectRequest, SimulatorSettings, TrueDeviations, simulate};
use serde_json::Value;

/// Returns settings for many runs with these kinds of effects.
fn months_of(seed: u64, kinds: Vec<EffectKind>) -> SimulatorSettings {
    SimulatorSettings {
        runs: 64,
        holdout_runs: 16,
        duration_s: 300.0,
        ..SimulatorSettings::new(seed, EffectRequest::Kinds(kinds))
    }
}

fn number(values: &BTreeMap<String, ParameterValue>, name: &str) -> f64 {
    match values.get(name) {
        Some(ParameterValue::Number(value)) => *value,
        other => panic!("{name}: {other:?}"),
    }
}

fn found(effects: &[EffectAnswer], kind: EffectKind) -> &EffectAnswer {
    effects.iter().find(|effect| effect.kind == kind.name()).expect("it is found")
}

#[test]
fn a_dead_time_and_a_lag_of_many_runs_are_separated_as_recorded() {
    for seed in 9201..9204 {
        let simulated = simulate(&months_of(seed, vec![EffectKind::ActuatorDelay]));
        let truth = simulated.effects[0].parameters(0.0);
        let explained = explain(&read_files(&dataset_files(&simulated)), &|_, _| ()).unwrap();
        let effect = found(&explained.answer.effects, EffectKind::ActuatorDelay);
        for name in ["delay_s", "lag_s"] {
            let away_s = number(&effect.parameters, name) - truth[name].as_f64().unwrap();
            assert!(away_s.abs() < 0.1, "{seed}: {name} {away_s:+.3} s off, {truth}");
            assert!(number(&effect.std, name) < 0.2, "{seed}: {name} {:?}", effect.std);
        }
    }
}

#[test]
fn runs_held_out_confirm_an_effect_or_say_that_it_is_not_in_them() {
    let tunnel = EffectKind::TunnelDrag;
    let simulated = simulate(&months_of(9101, vec![tunnel]));
    let dataset = read_files(&dataset_files(&simulated));
    let explained = explain(&dataset, &|_, _| ()).unwrap().answer;
    let effect = found(&explained.effects, tunnel);
    let held_out = effect.held_out.as_ref().expect("16 runs go through tunnels");
    assert_eq!(held_out.runs, 16);
    let truth = simulated.effects[0].parameters(0.0)["c_factor"].as_f64().unwrap();
    let away = number(&held_out.parameters, "c_factor") - truth;
    let std = number(&held_out.std, "c_factor");
    assert!(away.abs() < 3.0 * std && std < 0.2 * (truth - 1.0), "{away} of {truth} ± {std}");
    assert!(explained.statement.contains("which agrees with the fit runs"));

    // The same days without the effect are held out.
    let without = read_files(&dataset_files(&simulate(&months_of(9101, Vec::new()))));
    let runs = dataset.runs.iter().zip(without.runs);
    let runs = runs.map(|(with, without)| match with.role {
        Role::Fit => with.clone(),
        Role::Holdout => without,
    });
    let mixed = Dataset { runs: runs.collect(), ..dataset.without_runs() };
    let explained = explain(&mixed, &|_, _| ()).unwrap().answer;
    let held_out = found(&explained.effects, tunnel).held_out.as_ref().unwrap();
    assert!(held_out.p_value < 1e-6, "{held_out:?}");
    assert!((number(&held_out.parameters, "c_factor") - 1.0).abs() < 0.2 * (truth - 1.0));
    assert!(explained.statement.contains("which is not what the fit runs say"));
}

#[test]
fn a_wheel_that_wears_is_shown_over_the_runs_where_its_mean_is_as_declared() {
    let settings = SimulatorSettings {
        runs: 24,
        holdout_runs: 6,
        ..SimulatorSettings::new(5_330_003, EffectRequest::Kinds(Vec::new()))
    };
    let mut dataset = read_files(&dataset_files(&simulate(&settings)));
    // By 1 % from the first run to the last, about the declared diameter.
    let scale_of = |run: usize| 0.995 + 0.01 * run as f64 / 23.0;
    for (index, run) in dataset.runs.iter_mut().enumerate() {
        for sample in &mut run.samples {
            sample.speed_mps *= scale_of(index);
        }
    }
    let answer = explain(&dataset, &|_, _| ()).unwrap().answer;
    assert!(answer.effects.is_empty(), "{}", answer.statement);
    let changing = "over the runs changes a wrong wheel diameter";
    assert!(answer.statement.contains(changing), "{}", answer.statement);
    let parts = &answer.over_time["wheel_diameter"][0].parts;
    let growth = parts.last().unwrap().value - parts[0].value;
    assert!((growth - 0.0088).abs() < 0.0015, "{parts:?}");
}

#[test]
fn another_mass_in_almost_half_of_many_runs_is_found_in_all_of_them() {
    let settings = SimulatorSettings {
        runs: 32,
        holdout_runs: 8,
        deviations: TrueDeviations::ROUGH,
        ..SimulatorSettings::new(5_310_001, EffectRequest::Kinds(vec![EffectKind::MassChange]))
    };
    let simulated = simulate(&settings);
    let answer = explain(&read_files(&dataset_files(&simulated)), &|_, _| ()).unwrap().answer;
    let written = serde_json::to_value(&answer).unwrap();
    let of = |values: &Value| -> BTreeSet<String> {
        let windows = values["windows"].as_array().expect("windows of runs");
        windows.iter().map(|it| it["run"].as_str().unwrap().to_owned()).collect()
    };
    let effects = written["effects"].as_array().unwrap();
    let own = effects.iter().find(|it| it["kind"] == "mass_change").expect("it is found");
    let plans = simulated.runs.iter().map(|run| &run.plan);
    let fitted: BTreeSet<String> = plans.filter(|it| !it.is_holdout).map(RunPlan::file).collect();
    let changed = of(&simulated.effects[0].parameters(0.0));
    let expected: BTreeSet<String> = changed.intersection(&fitted).cloned().collect();
    assert!(expected.len() > 10, "{expected:?}");
    assert_eq!(of(&own["parameters"]), expected);
}

#[test]
fn of_many_runs_one_on_another_line_counts_for_nothing() {
    let all = read_files(&dataset_files(&simulate(&months_of(9101, vec![EffectKind::TunnelDrag]))));
    let held = Held::of(all.runs.iter().map(|run| run.role)).expect("many runs");
    let mut elsewhere = all.clone();
    for role in [Role::Fit, Role::Holdout] {
        let mut own = elsewhere.runs.iter_mut().enumerate();
        let other = own.find(|(index, run)| run.role == role && !held.holds(*index)).unwrap().1;
        for sample in &mut other.samples {
            sample.position_m += 1e6;
        }
    }
    let [kinds, moved] = [all, elsewhere].map(|dataset| {
        let effects = explain(&dataset, &|_, _| ()).expect("usable runs").answer.effects;
        effects.iter().map(|effect| effect.kind).collect::<Vec<_>>()
    });
    assert_eq!(kinds, moved);
}

#[test]
fn of_many_runs_some_are_held_and_each_is_read_once() {
    let settings = months_of(9101, vec![EffectKind::TunnelDrag]);
    let all = read_files(&dataset_files(&simulate(&settings)));
    let held = Held::of(all.runs.iter().map(|run| run.role)).expect("many runs");
    let mut known = all.clone();
    let whole: Vec<Run> = known.runs.iter_mut().map(Run::split_off_samples).collect();
    assert!(known.runs.iter().all(|run| run.samples.is_empty() && run.extras.is_empty()));
    let chosen = whole.into_iter().enumerate().filter(|(index, _)| held.holds(*index));
    let chosen = Dataset { runs: chosen.map(|it| it.1).collect(), ..all.without_runs() };
    let reads: Mutex<BTreeMap<usize, usize>> = Mutex::default();
    let read = |index: usize| -> Result<Run, RunDataError> {
        *reads.lock().unwrap().entry(index).or_default() += 1;
        Ok(all.runs[index].clone())
    };
    let many = Many { dataset: &known, held: &held, read: &read };
    let explanation = explain_many(chosen, many, &|_, _| ()).expect("usable runs");
    let reads = reads.into_inner().unwrap();
    assert!(reads.values().all(|count| *count == 1), "{reads:?}");
    let is_common = explanation
        .answer
        .effects
        .iter()
        .all(|effect| effect.place.windows.is_none() && effect.place.runs.is_none());
    if is_common {
        // The held ones are read as they were recorded, too.
        assert_eq!(reads.len(), all.runs.len());
        assert_eq!(explanation.score.holdout_runs.len(), settings.holdout_runs);
    }
    let (fit, holdout) = (&explanation.problem.runs, &explanation.holdout);
    assert_eq!((fit.len(), holdout.len()), (12, 6), "a quarter of 48, and six of 16");
    let samples = |runs: &[RunData]| runs.iter().map(|run| run.samples().len()).sum::<usize>();
    let recorded: usize = all.runs.iter().map(|run| run.samples.len()).sum();
    let in_memory = samples(fit) + samples(holdout);
    assert!(in_memory < recorded / 10, "{in_memory} of {recorded} samples");
    assert!(explanation.answer.statement.contains("12 of 48 fit runs"));
}
