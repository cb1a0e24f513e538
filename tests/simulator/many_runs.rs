//! Of many runs the search holds some, and each other is read once: work and memory do not grow faster than the data.

use std::sync::atomic::{AtomicUsize, Ordering};

use dynocar_analysis::dataset::{Dataset, Role, Run};
use dynocar_analysis::explain::evidence::{RunData, RunDataError};
use dynocar_analysis::explain::many::{Held, Many};
use dynocar_analysis::explain::{Explanation, explain_many};
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::dataset_writer::{dataset_files, read_files};
use dynocar_tests::simulator::{EffectRequest, SimulatorSettings, simulate};

/// Ten runs with a tunnel's drag, two of them held out, one after the other so many times.
fn repeated(times: usize) -> Dataset {
    let settings = SimulatorSettings {
        runs: 10,
        holdout_runs: 2,
        duration_s: 300.0,
        ..SimulatorSettings::new(41, EffectRequest::Kinds(vec![EffectKind::TunnelDrag]))
    };
    let own = read_files(&dataset_files(&simulate(&settings)));
    let run = |index: usize| {
        let run = own.runs[index % own.runs.len()].clone();
        Run { file: format!("{index}.csv"), number: index as u32 + 1, ..run }
    };
    Dataset { runs: (0..times * own.runs.len()).map(run).collect(), ..own.without_runs() }
}

/// An explanation of which only the held runs are in memory, with how often others were read.
fn explained(all: &Dataset) -> (Explanation, usize) {
    let held = Held::of(all.runs.iter().map(|run| run.role)).expect("many runs");
    let mut known = all.clone();
    let whole: Vec<Run> = known.runs.iter_mut().map(Run::split_off_samples).collect();
    let chosen = whole.into_iter().enumerate().filter(|(index, _)| held.holds(*index));
    let chosen = Dataset { runs: chosen.map(|it| it.1).collect(), ..all.without_runs() };
    let reads = AtomicUsize::new(0);
    let read = |index: usize| -> Result<Run, RunDataError> {
        reads.fetch_add(1, Ordering::Relaxed);
        Ok(all.runs[index].clone())
    };
    let many = Many { dataset: &known, held: &held, read: &read };
    let explanation = explain_many(chosen, many, &|_, _| ()).expect("usable runs");
    (explanation, reads.into_inner())
}

#[test]
fn what_is_held_has_a_bound_and_every_run_is_read_once_more() {
    let samples = |runs: &[RunData]| runs.iter().map(|run| run.samples().len()).sum::<usize>();
    let mut held_samples = Vec::new();
    for times in [16, 32] {
        let all = repeated(times);
        let (explanation, reads) = explained(&all);
        let fit = all.with_role(Role::Fit).count();
        assert!(reads <= all.runs.len(), "{reads} reads of {} runs", all.runs.len());
        assert!(
            explanation.problem.runs.len() < fit / 2,
            "{} runs",
            explanation.problem.runs.len()
        );
        assert_eq!(explanation.score.holdout_runs.len(), all.runs.len() - fit);
        held_samples.push(samples(&explanation.problem.runs) + samples(&explanation.holdout));
        assert!(explanation.answer.statement.contains(&format!("of {fit} fit runs")));
    }
    // Twice the runs, no more in memory: which of them are held moves it by a little.
    assert!(held_samples[1] < held_samples[0] * 11 / 10, "{held_samples:?}");
}

#[test]
fn more_runs_say_the_same_more_surely() {
    let of = |times: usize| {
        let (explanation, _) = explained(&repeated(times));
        let effect = &explanation.answer.effects[0];
        assert_eq!(effect.kind, "tunnel_drag", "{}", explanation.answer.statement);
        let parameter = explanation.outcome.fit.effect_parameters(0)[0];
        (parameter, explanation.deviations.std[3])
    };
    let (few, many) = (of(5), of(40));
    assert!((few.0 - many.0).abs() < 3.0 * few.1, "{few:?} {many:?}");
    assert!(many.1 < few.1, "{few:?} {many:?}");
}
