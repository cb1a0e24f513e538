//! The measurements that the documentation names are commands that `dynocar-bench` takes.

use dynocar_tests::documents::{Shown, pages};

#[test]
fn every_measurement_that_a_page_shows_is_one_that_the_bench_takes() {
    let shown: Vec<Shown> =
        pages().iter().flat_map(|page| page.commands("dynocar-bench")).collect();
    assert!(shown.len() > 20, "the commands are found: {}", shown.len());
    let refusals: Vec<String> =
        shown.iter().filter_map(|it| it.refusal(dynocar_bench::cli::command())).collect();
    assert!(refusals.is_empty(), "{}", refusals.join("\n"));
}
