//! Forces whose laws the library of effects lacks: `explain` calls them unknown but reports their form, and the model
//! with that form predicts nearly as well as the true one.

use dynocar_analysis::explain::answer::{ExplainAnswer, Verdict};
use dynocar_analysis::explain::explain;
use dynocar_model::terms::ModelEntry;
use dynocar_model::terms::extra::{Covariate, ExtraResistance, Form};
use dynocar_tests::simulator::dataset_writer::{dataset_files, read_files};
use dynocar_tests::simulator::oracle::score;
use dynocar_tests::simulator::{
    EffectRequest, Law, SimulatedDataset, SimulatorSettings, TrueEffect, Unlisted, simulate,
};

/// A dataset with a force by a law drawn from the seed.
fn simulated(seed: u64) -> (SimulatedDataset, Law) {
    let simulated = simulate(&SimulatorSettings::new(seed, EffectRequest::AnyLaw));
    let [TrueEffect::Unlisted(Unlisted { law, .. })] = simulated.effects[..] else {
        panic!("the simulator was asked for a law outside the library");
    };
    (simulated, law)
}

/// Returns the answer, which must call the force unknown, the forms of the force that it reports, and the error of the
/// explained model divided by that of the true model.
fn explained(simulated: &SimulatedDataset) -> (ExplainAnswer, Vec<ExtraResistance>, f64) {
    let dataset = read_files(&dataset_files(simulated));
    let explanation = explain(&dataset, &|_, _| {}).expect("usable runs");
    let answer = explanation.answer;
    assert_eq!(answer.verdict, Verdict::Unknown, "{}", answer.statement);
    let grown = explanation.outcome.fit;
    let entries = grown.model.effects.iter().enumerate().flat_map(|(index, effect)| {
        effect.entries(grown.effect_parameters(index)).expect("a form that files can hold")
    });
    let extra = entries.filter_map(|entry| match entry {
        ModelEntry::Extra(extra) => Some(extra),
        _ => None,
    });
    let left = answer.rmse_after.expect("runs are held out") / score(simulated).full_run.true_mps;
    (answer, extra.collect(), left)
}

#[test]
fn the_edge_of_a_force_is_reported_with_an_interval() {
    let (simulated, law) = simulated(51_007);
    let Law::FastLater { from_s, .. } = law else { panic!("{law:?}") };
    let (answer, extra, left) = explained(&simulated);
    let [ExtraResistance { n_per_kn, factors }] = &extra[..] else {
        panic!("{}", answer.statement)
    };
    let [speed, time] = factors[..] else { panic!("{}", answer.statement) };
    assert_eq!((speed.of, speed.form), (Covariate::Speed, Form::Power));
    assert!((speed.numbers[1] - 1.0).abs() < 0.05, "{}", answer.statement);
    assert_eq!(time.of, Covariate::TimeSinceStart);
    let known = answer.effects[0].place.uncertainty_95.as_ref().and_then(|it| it.range);
    // More from the edge on is less up to it with another b.
    let ([low_s, high_s], is_more) = match (time.form, known.expect("an edge")) {
        (Form::From, [Some(edge), None]) => (edge, *n_per_kn > 0.0),
        (Form::UpTo, [None, Some(edge)]) => (edge, *n_per_kn < 0.0),
        other => panic!("{other:?}"),
    };
    assert!(is_more, "{n_per_kn} N/kN: {}", answer.statement);
    assert!(low_s <= from_s && from_s <= high_s, "{from_s} in {low_s} to {high_s} s");
    assert!(high_s - low_s < 10.0, "{low_s} to {high_s} s");
    assert!(left < 1.2, "{left} of the true model's error");
}

#[test]
fn a_force_in_the_cold_is_reported_where_a_library_kind_runs_to_its_bound() {
    let (simulated, law) = simulated(41_014);
    assert!(matches!(law, Law::FastInCold { .. }), "{law:?}");
    let (answer, extra, left) = explained(&simulated);
    let [ExtraResistance { factors, .. }] = &extra[..] else { panic!("{}", answer.statement) };
    let of: Vec<Covariate> = factors.iter().map(|factor| factor.of).collect();
    assert_eq!(of, [Covariate::Speed, Covariate::Temperature], "{}", answer.statement);
    assert!(left < 1.3, "{left} of the true model's error");
}

#[test]
fn a_force_that_rises_to_a_level_is_reported_though_no_basic_resistance_may_hold_the_level() {
    let (simulated, law) = simulated(51_006);
    assert!(matches!(law, Law::Levelling { .. }), "{law:?}");
    let (answer, extra, left) = explained(&simulated);
    let [ExtraResistance { factors, .. }] = &extra[..] else { panic!("{}", answer.statement) };
    assert_eq!((factors[0].of, factors[0].form), (Covariate::Speed, Form::Rise));
    assert!(left < 1.2, "{left} of the true model's error");
}

#[test]
fn a_force_that_the_noise_would_hold_is_reported() {
    let (simulated, law) = simulated(71_005);
    assert!(matches!(law, Law::FastLater { .. }), "{law:?}");
    let (answer, _, left) = explained(&simulated);
    assert!(left < 1.3, "{left} of the true model's error: {}", answer.statement);
}
