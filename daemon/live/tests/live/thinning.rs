//! How many samples viewers get.

use dynocar_live::thinning::Thinning;

fn let_through(per_second: u32, moments_ns: impl Iterator<Item = i64>) -> usize {
    let mut thinning = Thinning::to(per_second);
    moments_ns.filter(|&at| thinning.lets_through(at)).count()
}

#[test]
fn of_a_thousand_a_second_fifty_go_on_and_what_is_slower_goes_on_whole() {
    let second = |hz: i64| (0..hz).map(move |k| 1_000_000_000 * k / hz);
    assert_eq!(let_through(50, second(1000)), 50);
    assert_eq!(let_through(50, second(60)), 50);
    assert_eq!(let_through(50, second(20)), 20);
    assert_eq!(let_through(0, second(1000)), 1000);
}

#[test]
fn a_clock_that_is_set_back_silences_nobody() {
    let moments = [0, 1_000_000_000, 5_000_000, 10_000_000, 30_000_000];
    assert_eq!(let_through(50, moments.into_iter()), 4);
}
