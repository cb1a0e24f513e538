//! Recordings of traction alone whose gradients an accelerometer feels, at a scale that nobody knows.

use dynocar_analysis::dataset::{Dataset, GradientSource, PositionSource};
use dynocar_analysis::explain::answer::{ExplainAnswer, Verdict};
use dynocar_analysis::explain::explain;
use dynocar_shared::SampleField;
use dynocar_shared::resistance::STANDARD_GRAVITY_MPS2;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::dataset_writer::{dataset_files, read_files};
use dynocar_tests::simulator::random::{SimulatorRandom, Stream};
use dynocar_tests::simulator::true_run::{TRUE_STEP_S, TrueState};
use dynocar_tests::simulator::{EffectRequest, SimulatorSettings, TrainType, TrueEffect, simulate};

/// Share of a gradient that the accelerometer shows.
const SHARE: f64 = 0.75;
/// Standard deviation of its noise.
const NOISE_MPS2: f64 = 0.02;

/// Returns the specific force at a state that is followed by another one.
fn felt_mps2(now: &TrueState, next: &TrueState) -> f64 {
    let gradient = now.resistance.gradient_n / (now.mass_kg * STANDARD_GRAVITY_MPS2);
    (next.speed_mps - now.speed_mps) / TRUE_STEP_S + SHARE * STANDARD_GRAVITY_MPS2 * gradient
}

/// Returns a dataset without line, positions and brakes, of a train that reports `gain` times its traction force.
fn felt(seed: u64, gain: f64) -> Dataset {
    let effects = EffectRequest::Exactly(vec![TrueEffect::TractionGain { gain }]);
    let train_type = Some(TrainType::Regional);
    let simulated =
        simulate(&SimulatorSettings { train_type, ..SimulatorSettings::new(seed, effects) });
    let mut dataset = read_files(&dataset_files(&simulated));
    dataset.track = None;
    let mut random = SimulatorRandom::new(seed, Stream::Driver(99));
    for (run, truth) in dataset.runs.iter_mut().zip(&simulated.runs) {
        let first_ns = run.samples.first().map_or(0, |sample| sample.time_ns);
        for sample in &mut run.samples {
            let at = ((sample.time_ns - first_ns) as f64 * 1e-9 / TRUE_STEP_S).round() as usize;
            let at = at.min(truth.states.len() - 2);
            let specific_mps2 = felt_mps2(&truth.states[at], &truth.states[at + 1]);
            sample.valid &= !(SampleField::Position.bit() | SampleField::Gradient.bit());
            sample.set(SampleField::SpecificForce, specific_mps2 + NOISE_MPS2 * random.gaussian());
        }
        run.position_source = PositionSource::IntegratedSpeed;
        run.gradient_source = GradientSource::SpecificForce;
    }
    dataset.keep_traction_only();
    dataset
}

fn has(answer: &ExplainAnswer, kind: EffectKind) -> bool {
    answer.effects.iter().any(|effect| effect.kind == kind.name())
}

#[test]
fn inertia_and_traction_look_alike_where_only_an_accelerometer_feels_the_gradient() {
    for seed in [9_950_001, 9_950_002, 9_950_003] {
        let answer = explain(&felt(seed, 1.12), &|_, _| ()).unwrap().answer;
        eprintln!("{}", answer.statement);
        let alike = [EffectKind::RotatingMass, EffectKind::TractionGain];
        let found = alike.map(|kind| has(&answer, kind));
        assert_eq!(found.iter().filter(|it| **it).count(), 1, "{seed}: {}", answer.statement);
        assert_eq!(answer.verdict, Verdict::Ambiguous, "{seed}: {}", answer.statement);
        let other = alike[usize::from(found[0])].name();
        assert!(answer.ambiguous_with.contains(&other), "{seed}: {:?}", answer.ambiguous_with);
    }
}
