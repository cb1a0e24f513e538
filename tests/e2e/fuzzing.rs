//! A short run of the fuzzer on every target; `dynocar-soak fuzz` runs it for as long as one likes.

use dynocar_tests::fuzz::{Target, run};

#[test]
fn mutated_bytes_make_no_reader_panic_and_no_snapshot_unsound() {
    for target in Target::ALL {
        // The slow readers less often.
        let rounds = match target {
            Target::Sample => 400,
            Target::Logger => 1_000,
            _ => 4_000,
        };
        let accepted = run(target, rounds, 1);
        println!("{target:?}: {accepted} of {rounds} accepted");
        assert!(accepted > 0, "{target:?}: the corpus itself reaches no further than the door");
    }
}
