//! A short run of the fuzzer on every target; `dynocar-soak fuzz` runs it for as long as one likes.

use dynocar_tests::fuzz::{Target, run};

#[test]
fn mutated_bytes_make_no_reader_panic_and_no_snapshot_unsound() {
    for target in Target::ALL {
        let rounds = if target == Target::Sample { 600 } else { 5_000 };
        let accepted = run(target, rounds, 1);
        println!("{target:?}: {accepted} of {rounds} accepted");
        assert!(accepted > 0, "{target:?}: the corpus itself reaches no further than the door");
    }
}
