//! Recordings of traction alone whose gradients an accelerometer feels, at a scale that nobody knows.

use dynocar_analysis::dataset::{Dataset, GradientSource, PositionSource};
use dynocar_analysis::explain::answer::{ExplainAnswer, Verdict};
use dynocar_analysis::explain::explain;
use dynocar_shared::SampleField;
use dynocar_shared::resistance::GRAVITY_MPS2;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::dataset_writer::{dataset_files, read_files};
use dynocar_tests::simulator::random::{SimulatorRandom, Stream};
use dynocar_tests::simulator::true_run::{TRUE_STEP_S, TrueState};
use dynocar_tests::simulator::{EffectRequest, SimulatorSettings, TrainType, TrueEffect, simulate};

/// Share of a gradient that a bad accelerometer shows.
const BAD_SHARE: f64 = 0.75;
/// Standard deviation of its noise.
const NOISE_MPS2: f64 = 0.02;

/// Returns the specific force at a state that is followed by another one, with a share of the gradient.
fn felt_mps2(now: &TrueState, next: &TrueState, share: f64) -> f64 {
    let gradient = now.resistance.gradient_n / (now.mass_kg * GRAVITY_MPS2);
    (next.speed_mps - now.speed_mps) / TRUE_STEP_S + share * GRAVITY_MPS2 * gradient
}

/// Returns a dataset without line and positions, with a share of the gradients; with brakes where they are kept.
fn felt(seed: u64, effect: TrueEffect, share: f64, keeps_brakes: bool) -> Dataset {
    let effects = EffectRequest::Exactly(vec![effect]);
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
            let specific_mps2 = felt_mps2(&truth.states[at], &truth.states[at + 1], share);
            sample.valid &= !(SampleField::Position.bit() | SampleField::Gradient.bit());
            sample.set(SampleField::SpecificForce, specific_mps2 + NOISE_MPS2 * random.gaussian());
        }
        run.position_source = PositionSource::IntegratedSpeed;
        run.gradient_source = GradientSource::SpecificForce;
    }
    if !keeps_brakes {
        dataset.keep_traction_only();
    }
    dataset
}

fn has(answer: &ExplainAnswer, kind: EffectKind) -> bool {
    answer.effects.iter().any(|effect| effect.kind == kind.name())
}

/// The kinds that look alike.
const ALIKE: [EffectKind; 2] = [EffectKind::RotatingMass, EffectKind::TractionGain];

#[test]
fn inertia_and_traction_look_alike_where_only_an_accelerometer_feels_the_gradient() {
    let gain = TrueEffect::TractionGain { gain: 1.12 };
    let inertia = TrueEffect::RotatingMass { rotating_mass_factor: 0.2 };
    for (seed, effect) in [(9_950_001, gain.clone()), (9_950_002, gain), (9_950_003, inertia)] {
        let answer = explain(&felt(seed, effect, BAD_SHARE, false), &|_, _| ()).unwrap().answer;
        let found = ALIKE.map(|kind| has(&answer, kind));
        assert_eq!(found.iter().filter(|it| **it).count(), 1, "{seed}: {}", answer.statement);
        assert_eq!(answer.verdict, Verdict::Ambiguous, "{seed}: {}", answer.statement);
        let other = ALIKE[usize::from(found[0])].name();
        assert!(answer.ambiguous_with.contains(&other), "{seed}: {:?}", answer.ambiguous_with);
    }
}

#[test]
fn braking_separates_inertia_and_traction_also_where_the_gradient_is_felt() {
    let gain = TrueEffect::TractionGain { gain: 1.12 };
    let answer = explain(&felt(9_950_001, gain, 1.0, true), &|_, _| ()).unwrap().answer;
    assert_eq!(ALIKE.map(|kind| has(&answer, kind)), [false, true], "{}", answer.statement);
    assert!(!answer.ambiguous_with.contains(&ALIKE[0].name()), "{}", answer.statement);
}
