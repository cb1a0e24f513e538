//! An hour of eight trains in accelerated time; `dynocar-soak day` runs all twenty-four.

use dynocar_tests::soak::{Programs, day};

#[test]
fn an_hour_of_trouble_with_clocks_disks_and_trains_keeps_memory_accounts_and_states() {
    let programs = Programs {
        dynocar: env!("CARGO_BIN_EXE_dynocar-under-test").into(),
        peer: env!("CARGO_BIN_EXE_dynocar-test-peer").into(),
    };
    let hours = day::run(&programs, 1, 1);
    println!("{}", day::hours::table(&hours));
    let [used, rejected, lost] = hours[0].account;
    assert!(used > 100_000 && rejected > 0 && lost > 0, "{hours:?}");
}
