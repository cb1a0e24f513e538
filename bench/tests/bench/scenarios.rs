//! Ordinary driving with ordinary mistakes: usable answers are right, and usability changes seldom.

use std::sync::Arc;

use dynocar_bench::scenarios::scenario_train::ScenarioTrain;
use dynocar_bench::scenarios::table::{self, NamedScenario, Plan};
use dynocar_bench::scenarios::world::{Mistakes, World};
use dynocar_core::pipeline::Pipeline;
use dynocar_estimators::EstimatorSettings;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{ParameterSnapshot, PipelineKind, Status, TrainId};

fn named(names: &[&str]) -> Vec<NamedScenario> {
    let mut rows = table::scenarios();
    rows.retain(|(own, _)| names.contains(&own.join(", ").as_str()));
    assert_eq!(rows.len(), names.len());
    rows
}

#[test]
fn in_an_hour_of_ordinary_driving_what_may_be_used_is_right_and_changes_seldom() {
    let scenarios = named(&[
        "metro, weighed 2 % wrong",
        "metro, load changes at stops",
        "EMU, load unknown",
        "EMU, forces jump",
        "high speed, weighed 5 % wrong",
    ]);
    let lines = table::run(&Plan {
        scenarios: &scenarios,
        kinds: &[PipelineKind::TrainKalman],
        seeds: 4,
        first_seed: 501,
        hours: 1.0,
        mistakes: Mistakes::USUAL,
        threads: 2,
    })
    .unwrap();
    assert_eq!(lines.len(), 2 * scenarios.len());
    for line in lines {
        println!("{line:?}");
        let of = |name: &str| line.value(name).expect(name);
        assert!(of("usable_percent") > 80.0, "{line:?}");
        assert!(of("changes_per_h") <= 6.0, "{line:?}");
        assert!(of("longest_wrong_s") <= 1.0, "{line:?}");
        assert!(of("coverage_percent") > 90.0, "{line:?}");
    }
}

#[test]
fn a_strong_wind_on_a_train_of_more_air_resistance_than_declared_stays_in_the_interval() {
    // Drawn so: 3.6 m/s of wind and a c two thirds above the declared one, all the way in one direction.
    let scenarios = named(&["EMU, weighed 2 % wrong"]);
    let world = World::draw(scenarios[0].1, Mistakes::USUAL, 30_028);
    let c_share = world.truth.resistance.c / world.declared.resistance.c;
    assert!(world.wind_mps.abs() > 3.5 && c_share > 1.6, "{} {c_share}", world.wind_mps);
    let kinds = &[PipelineKind::TrainKalman];
    let plan = Plan {
        scenarios: &scenarios,
        kinds,
        seeds: 1,
        first_seed: 30_028,
        hours: 1.0,
        mistakes: Mistakes::USUAL,
        threads: 1,
    };
    for line in table::run(&plan).unwrap() {
        let of = |name: &str| line.value(name).expect(name);
        assert!(of("usable_percent") > 80.0 && of("longest_wrong_s") <= 1.0, "{line:?}");
    }
}

#[test]
fn a_changed_load_is_known_sooner_where_the_cylinder_pressure_is_reported() {
    let mut rows = table::brakes();
    let names = ["friction, late and weak, map 0.1 ‰", "with pressure, map 0.1 ‰"];
    rows.retain(|(own, _)| own[0] == "tram" && names.contains(&own[1].as_str()));
    let lines = table::run(&Plan {
        scenarios: &rows,
        kinds: &[PipelineKind::TrainKalman],
        seeds: 2,
        first_seed: 501,
        hours: 0.5,
        mistakes: Mistakes::USUAL,
        threads: 2,
    })
    .unwrap();
    // The drives are the same; the second and the fourth line are those of the mass.
    let of = |line: usize, name: &str| lines[line].value(name).expect(name);
    assert!(of(3, "known_again_s") < 0.8 * of(1, "known_again_s"), "{lines:?}");
    assert!((0..4).all(|it| of(it, "longest_wrong_s") <= 1.0), "{lines:?}");
}

/// Every snapshot of the recommended pipelines over an hour of a healthy train.
fn each_snapshot(mut look: impl FnMut(f64, &ParameterSnapshot)) {
    let mut scenario = named(&["EMU, load exact"])[0].1;
    scenario.position_noise_m = 0.5;
    let world = World::draw(scenario, Mistakes::default(), 77);
    let train = Arc::new(world.declared.clone());
    let kinds = [
        PipelineKind::TrainKalman,
        PipelineKind::AdhesionLaw,
        PipelineKind::AdhesionSmoother,
        PipelineKind::ResidualMonitor,
    ];
    let mut pipelines = kinds.map(|kind| {
        let estimator = EstimatorSettings::default_of(kind).unwrap().build(&train).unwrap();
        Pipeline::new(TrainId(1), 0, Arc::clone(&train), None, estimator)
    });
    let mut drive = ScenarioTrain::new(world);
    for cycle in 0..36_000_u32 {
        let moment = drive.advance();
        for pipeline in &mut pipelines {
            look(0.1 * f64::from(cycle), pipeline.process(&moment.sample));
        }
    }
}

#[test]
fn no_pipeline_of_a_healthy_train_is_degraded_by_noise_of_its_position() {
    let mut degraded_s = 0.0;
    each_snapshot(|time_s, snapshot| {
        let kind = snapshot.pipeline_kind().unwrap();
        if matches!(snapshot.status(), Status::Degraded | Status::Invalid) {
            degraded_s += 0.1;
            println!("{time_s:.1} s: {kind} {:?} {:?}", snapshot.status(), snapshot.reason());
        }
        let suspect = EffectKind::from_number(snapshot.suspected_effect);
        assert_eq!(suspect, Some(EffectKind::None), "{kind} at {time_s} s");
    });
    // White noise is beyond four standard deviations of its own statistics now and then.
    assert!(degraded_s < 10.0, "degraded for {degraded_s:.1} s");
}
