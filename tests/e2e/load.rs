//! Eight trains at 200 Hz with faults, for seconds; `dynocar-soak load` runs it for hours.

use dynocar_tests::soak::{Programs, load};

#[test]
fn eight_trains_with_faults_keep_memory_flat_and_account_for_every_sample() {
    let programs = Programs {
        dynocar: env!("CARGO_BIN_EXE_dynocar-under-test").into(),
        peer: env!("CARGO_BIN_EXE_dynocar-test-peer").into(),
    };
    let report = load::run(&programs, 12, 1);
    println!("{report:#?}");
    assert!(report.offered > 2_000 && report.faults > 2, "{report:?}");
}
