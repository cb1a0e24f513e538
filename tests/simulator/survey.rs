//! Survey and explanation of a simulated railway with GNSS and without a line file.

use dynocar::dataset;
use dynocar_analysis::explain::answer::Verdict;
use dynocar_analysis::explain::{Explanation, explain};
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::dataset_writer::write_dataset;
use dynocar_tests::simulator::{
    EffectRequest, GnssReceiver, SimulatedDataset, SimulatorSettings, TrainType, TrueEffect,
    simulate,
};
use dynocar_workshop::survey::SurveyAnswer;
use dynocar_workshop::survey::survey_folder;

/// A regional railway of about 30 km: six runs to fit and two held out, each over the whole line.
fn railway(seed: u64, effects: EffectRequest) -> SimulatorSettings {
    SimulatorSettings {
        train_type: Some(TrainType::Regional),
        duration_s: 2400.0,
        gnss: Some(GnssReceiver::USUAL),
        ..SimulatorSettings::new(seed, effects)
    }
}

/// A simulated railway with its survey and explanation.
struct Case {
    truth: SimulatedDataset,
    answer: SurveyAnswer,
    explanation: Explanation,
}

impl Case {
    fn of(settings: &SimulatorSettings) -> Self {
        let truth = simulate(settings);
        let folder = tempfile::tempdir().unwrap();
        let (raw, out) = (folder.path().join("raw"), folder.path().join("surveyed"));
        write_dataset(&truth, &raw).unwrap();
        let answer = survey_folder(&raw, None, &out).unwrap().answer;
        let explanation = explain(&dataset::load(&out).unwrap(), &|_, _| ()).unwrap();
        let case = Case { truth, answer, explanation };
        eprintln!(
            "seed {}: {} m, {} trips, {:.3} m/s before and {:.3} m/s after: {}",
            settings.seed,
            case.answer.line.length_m.round(),
            case.answer.trips.len(),
            case.rmse60_mps(0),
            case.rmse60_mps(1),
            case.explanation.answer.statement
        );
        case
    }

    /// Open-loop error in m/s over 60 s on the runs held out, before (0) or after (1) effects.
    fn rmse60_mps(&self, side: usize) -> f64 {
        self.explanation.score.holdout_window60[side].rmse_mps().unwrap()
    }
}

#[test]
fn six_passes_in_both_directions_give_a_line_that_predicts_as_a_null() {
    let case = Case::of(&railway(11, EffectRequest::none()));
    assert_eq!(case.explanation.answer.verdict, Verdict::None);
    assert!(case.rmse60_mps(1) <= 0.10, "{} m/s", case.rmse60_mps(1));
    // Runs begin and end where they will: the line reaches as far as several of them do.
    let places_m = || case.truth.runs.iter().flat_map(|run| &run.states).map(|it| it.position_m);
    let (low, high) = (places_m().fold(f64::INFINITY, f64::min), places_m().fold(0.0, f64::max));
    let driven_m = case.truth.runs.iter().map(|run| run.states[run.states.len() - 1].distance_m);
    let (longest_m, length_m) = (driven_m.fold(0.0, f64::max), case.answer.line.length_m);
    assert!(length_m > 0.9 * longest_m && length_m < 1.002 * (high - low), "{length_m} m");
    assert_eq!(case.answer.trips.len(), 8);
}

#[test]
fn six_passes_in_one_direction_give_a_line_that_predicts_as_a_null() {
    let settings =
        SimulatorSettings { is_one_direction: true, ..railway(12, EffectRequest::none()) };
    let case = Case::of(&settings);
    assert_eq!(case.explanation.answer.verdict, Verdict::None);
    assert!(case.rmse60_mps(1) <= 0.10, "{} m/s", case.rmse60_mps(1));
    assert!(case.answer.cannot_tell.iter().any(|open| open.contains("mean gradient")));
}

#[test]
fn a_wheel_that_is_one_percent_off_is_found() {
    let effect = TrueEffect::WheelDiameter { speed_scale: 1.01 };
    let case = Case::of(&railway(13, EffectRequest::Exactly(vec![effect])));
    let scale = &case.answer.learned.as_ref().unwrap().speed_scale;
    assert!((scale.value - 1.01).abs() < 3.0 * scale.std + 5e-4, "{scale:?}");
    let kinds: Vec<&str> =
        case.explanation.answer.effects.iter().map(|effect| effect.kind).collect();
    assert_eq!(kinds, [EffectKind::WheelDiameter.name()]);
    assert!(case.rmse60_mps(1) <= 0.10, "{} m/s", case.rmse60_mps(1));
}
