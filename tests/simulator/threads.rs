//! The answer is the same to the last digit for any number of threads.

use std::path::PathBuf;

use dynocar_analysis::dataset::{Dataset, DatasetFiles, FileProblem};
use dynocar_analysis::explain::explain;
use rayon::ThreadPoolBuilder;

/// A folder of this project.
struct Folder(PathBuf);

impl DatasetFiles for Folder {
    fn read(&self, path: &str) -> Result<String, FileProblem> {
        std::fs::read_to_string(self.0.join(path)).map_err(|_| FileProblem::Missing)
    }
}

#[test]
fn the_answer_is_the_same_on_one_two_and_three_threads() {
    let demo = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../config/demo");
    let mut dataset = Dataset::load(&Folder(demo)).expect("the demonstration runs");
    // The forces are those of a heavier train, so that an effect is found, in several rounds of the search.
    for sample in dataset.runs.iter_mut().flat_map(|run| &mut run.samples) {
        let pulled_n = sample.get(dynocar_shared::SampleField::TractionForce);
        if let Some(pulled_n) = pulled_n {
            sample.set(dynocar_shared::SampleField::TractionForce, 1.06 * pulled_n);
        }
    }
    let on = |threads: usize| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        let explained = pool.install(|| explain(&dataset, &|_, _| {})).expect("usable runs");
        let theta: Vec<u64> = explained.outcome.fit.theta.iter().map(|it| it.to_bits()).collect();
        (format!("{:?}", explained.answer), theta)
    };
    let one = on(1);
    assert!(one.1.len() > 3, "an effect is found: {}", one.0);
    for threads in [2, 3] {
        assert_eq!(on(threads), one, "{threads} threads");
    }
}
