//! Short runs of `dynocar-soak`: eight trains with faults, an hour of them in accelerated time, mutated bytes on every
//! reader, and months of one train.

use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::fuzz::{Target, run};
use dynocar_tests::soak::months::story::StorySpan;
use dynocar_tests::soak::months::table::{HEADER, line};
use dynocar_tests::soak::months::{Life, LifeOutcome, LifeSettings, Story, mistakes};
use dynocar_tests::soak::{Programs, day, load};

fn programs() -> Programs {
    Programs {
        dynocar: env!("CARGO_BIN_EXE_dynocar-under-test").into(),
        peer: env!("CARGO_BIN_EXE_dynocar-test-peer").into(),
    }
}

#[test]
fn eight_trains_with_faults_keep_memory_flat_and_account_for_every_sample() {
    let report = load::run(&programs(), 12, 1);
    println!("{report:#?}");
    assert!(report.offered > 2_000 && report.faults > 2, "{report:?}");
}

#[test]
fn an_hour_of_trouble_with_clocks_disks_and_trains_keeps_memory_accounts_and_states() {
    let hours = day::run(&programs(), 1, 1);
    println!("{}", day::hours::table(&hours));
    let [used, rejected, lost] = hours[0].account;
    assert!(used > 100_000 && rejected > 0 && lost > 0, "{hours:?}");
}

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

/// A life of some days of twelve trips; a mistake in a thousand trips is let pass, so that a day or
/// two of them are evidence enough.
fn lived(story: Story, span: StorySpan, days: usize) -> LifeOutcome {
    let settings = LifeSettings {
        story,
        span,
        seed: 7,
        days,
        trips: 12,
        recorded: 4,
        trips_between_mistakes: 1000.0,
    };
    let folder = tempfile::tempdir().expect("a temporary folder");
    Life::begin(settings, folder.path()).live()
}

#[test]
fn an_undeclared_tunnel_is_adopted_within_days_and_the_error_falls() {
    let span = StorySpan { onset: 2, end: 12 };
    let outcome = lived(Story::Appears(EffectKind::TunnelDrag), span, 12);
    let printed = format!("{HEADER}{}", line(&outcome));
    let adopted = outcome.first_change(span.onset..span.end, false);
    assert!(adopted.is_some_and(|day| day <= 10), "{printed}");
    assert!(outcome.adoptions[0].adds.contains("tunnel drag"), "{printed}");
    assert_eq!(outcome.mistakes(), 0, "{printed}");
    let before = outcome.error_mps(span.onset..span.onset + 2).unwrap();
    assert!(outcome.error_mps(11..12).unwrap() < 0.6 * before, "{printed}");
}

#[test]
fn what_is_over_is_taken_back() {
    let span = StorySpan { onset: 2, end: 10 };
    let outcome = lived(Story::Winter, span, 16);
    let printed = format!("{HEADER}{}", line(&outcome));
    assert!(outcome.first_change(span.onset..span.end, false).is_some(), "{printed}");
    assert!(outcome.first_change(span.end..16, true).is_some(), "{printed}");
    assert_eq!(outcome.mistakes(), 0, "{printed}");
}

#[test]
fn a_brake_that_drags_for_a_day_is_a_maintenance_event_and_no_model() {
    let outcome = lived(Story::BrakeDrags, StorySpan { onset: 2, end: 3 }, 6);
    let printed = format!("{HEADER}{}", line(&outcome));
    assert!(outcome.events.iter().any(|kind| kind == "dragging_brake"), "{printed}");
    assert!(outcome.adoptions.is_empty(), "{printed}");
}

#[test]
fn a_model_that_is_no_better_is_adopted_no_oftener_than_configured() {
    let (trains, years, between) = (3, 27, 20_000.0);
    let found = mistakes::measure(trains, years, 400, between);
    assert!(found.rivals >= 6, "{found:?}");
    // Ten thousand trips a year: the configuration allows one adoption in two years of each train.
    assert!((found.adopted as f64) <= found.train_years / 2.0, "{found:?}");
}
