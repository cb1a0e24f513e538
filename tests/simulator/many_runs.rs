//! Of many runs the search holds some, thinned, and each is read once: work and memory grow no faster than the data.

use std::collections::BTreeMap;
use std::sync::Mutex;

use dynocar_analysis::dataset::{Dataset, Run};
use dynocar_analysis::explain::evidence::{RunData, RunDataError};
use dynocar_analysis::explain::explain_many;
use dynocar_analysis::explain::many::{Held, Many};
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::dataset_writer::{dataset_files, read_files};
use dynocar_tests::simulator::{EffectRequest, SimulatorSettings, simulate};

#[test]
fn of_many_runs_some_are_held_and_each_is_read_once() {
    let settings = SimulatorSettings {
        runs: 64,
        holdout_runs: 16,
        duration_s: 300.0,
        ..SimulatorSettings::new(9101, EffectRequest::Kinds(vec![EffectKind::TunnelDrag]))
    };
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
