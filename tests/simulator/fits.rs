//! Fits that go on from another, and effects that act block by block, against the same from the start and at once.

use dynocar_analysis::explain::effects::{Candidate, LIBRARY, Proposal};
use dynocar_analysis::explain::evidence::{SampleForces, Whitener};
use dynocar_analysis::explain::hypothesis::Past;
use dynocar_analysis::explain::selection::Search;
use dynocar_analysis::explain::{Explanation, explain};
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::dataset_writer::{dataset_files, read_files};
use dynocar_tests::simulator::{Deviations, EffectRequest, SimulatorSettings, simulate};

/// What the library proposes for a train with late forces beside a, b and c alone.
fn proposed(look: impl Fn(&Explanation, Vec<Candidate>)) {
    let simulated = simulate(&SimulatorSettings {
        deviations: Deviations::ROUGH,
        ..SimulatorSettings::new(77_001, EffectRequest::Kinds(vec![EffectKind::ActuatorDelay]))
    });
    let dataset = read_files(&dataset_files(&simulated));
    let explanation = explain(&dataset, &|_, _| ()).unwrap();
    let search = Search {
        problem: &explanation.problem,
        holdout: &explanation.holdout,
        train: &dataset.train,
        track: dataset.track.as_ref(),
        progress: &|_, _| (),
    };
    let scan = search.scan(&explanation.base).unwrap();
    let candidates = LIBRARY.iter().flat_map(|kind| match kind.propose(&scan) {
        Proposal::Candidates(candidates) => candidates,
        Proposal::NotTestable(_) => Vec::new(),
    });
    look(&explanation, candidates.collect());
}

#[test]
fn a_fit_that_goes_on_from_another_ends_where_one_from_the_start_does() {
    proposed(|Explanation { problem, base, .. }, candidates| {
        let mut compared = 0;
        for candidate in candidates {
            let kind = candidate.hypothesis.kind().name();
            let (effect, start) = candidate.from_none();
            if start.iter().any(|value| *value != effect.none()) {
                continue;
            }
            let on = problem.grown(base, [(effect.clone(), start.clone())]);
            let model = base.model.with(effect);
            let anew = problem.fit(&model, [&base.theta[..], &start].concat(), base.noise);
            let away = (on.cost - anew.cost).abs();
            assert!(away < 0.02, "{kind}: {} and {}", on.cost, anew.cost);
            let std = on.factor().unwrap().inverse().diagonal().map(f64::sqrt);
            for (i, (on, anew)) in on.theta.iter().zip(&anew.theta).enumerate() {
                assert!((on - anew).abs() < 0.05 * std[i], "{kind} {i}: {on} and {anew}");
            }
            compared += 1;
        }
        assert!(compared > 6, "only {compared} kinds start from none");
    });
}

#[test]
fn what_looks_back_does_the_same_block_by_block() {
    proposed(|Explanation { problem, .. }, candidates| {
        let looking_back: Vec<Candidate> =
            candidates.into_iter().filter(|it| it.hypothesis.looks_back()).collect();
        assert_eq!(looking_back.len(), 2, "late forces and a late speed");
        for (Candidate { hypothesis, .. }, run) in
            looking_back.iter().zip([&problem.runs[0], &problem.runs[1]])
        {
            let parameters = [0.37, 0.6];
            let mut at_once: Vec<SampleForces> = run.declared.all().collect();
            hypothesis.apply(&parameters, run, 0, &mut at_once);
            // What a run before left is forgotten.
            let mut past = Past::default();
            for run in [&problem.runs[2], run] {
                let declared: Vec<SampleForces> = run.declared.all().collect();
                let mut by_blocks = declared.clone();
                for (number, block) in by_blocks.chunks_mut(100).enumerate() {
                    hypothesis.apply_after(&mut past, &parameters, run, 100 * number, block);
                }
                assert!(run.file != problem.runs[2].file || by_blocks != declared);
                assert!(run.file == problem.runs[2].file || by_blocks == at_once, "{}", run.file);
            }
        }
    });
}

#[test]
fn what_is_local_is_whitened_until_it_is_forgotten() {
    proposed(|Explanation { problem, base, .. }, _| {
        let run = &problem.runs[0];
        let whitener = Whitener::new(run, base.noise);
        let gained_mps = |bin: usize| 0.01 * bin.saturating_sub(49).min(10) as f64;
        let series: Vec<f64> = (0..run.bins.len()).map(gained_mps).collect();
        let (mut all, mut local) = (Vec::new(), Vec::new());
        whitener.whiten(&series, &mut all);
        whitener.whiten_local(50..60, gained_mps, &mut local);
        let until = 50 + local.len();
        assert!(until > 60 && until < all.len(), "{until} of {}", all.len());
        assert_eq!(local, all[50..until]);
        let most = local.iter().fold(0.0_f64, |most, it| most.max(it.abs()));
        let forgotten = all[until..].iter().all(|it| it.abs() < 1e-4 * most);
        assert!(all[..50].iter().all(|it| *it == 0.0) && forgotten);
    });
}
