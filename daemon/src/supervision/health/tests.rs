//! The verdict on a train, and its words.

use dynocar_shared::vocabulary::EffectKind;

use super::*;

#[test]
fn good_brakes_on_a_good_rail_are_no_degradation() {
    let waiting = |reason| Verdict::new(Status::Unestimated, Some(reason));
    assert_eq!(waiting(Reason::OnlyLowerBound), Verdict::Ok);
    assert_eq!(waiting(Reason::EstimateStale), Verdict::Ok);
    assert_eq!(waiting(Reason::BadInput), Verdict::Degraded, "samples that are refused");
    let large = Verdict::new(Status::Degraded, Some(Reason::InnovationsTooLarge));
    assert_eq!(large, Verdict::Degraded);
    let silent = PipelineHealth { is_stale: true, ..pipeline(Reason::DaemonSilent) };
    assert_eq!(silent.verdict(), Verdict::Stale);
}

#[test]
fn a_train_that_learns_nothing_for_lack_of_a_quantity_is_degraded() {
    let waiting = |reason| PipelineHealth { status: Status::Unestimated, ..pipeline(reason) };
    let known = PipelineHealth { status: Status::Estimated, ..pipeline(Reason::None) };
    let starved = || waiting(Reason::MissingQuantity);
    assert_eq!(verdict_of(&[starved(), waiting(Reason::TooFewSamples)]), Verdict::Degraded);
    assert_eq!(verdict_of(&[starved(), known]), Verdict::Ok, "a brake without a pressure sensor");
    assert_eq!(verdict_of(&[waiting(Reason::TooFewSamples)]), Verdict::Ok, "a train that stands");
    let words = PipelineHealth {
        uses: vec![(Quantity::Mass, UseState::Learning, "missing_quantity")],
        ..starved()
    };
    assert!(
        words
            .in_words()
            .ends_with("(missing_quantity): samples with a position and a brake force end it")
    );
}

fn pipeline(reason: Reason) -> PipelineHealth {
    PipelineHealth {
        index: 0,
        kind: "adhesion_law",
        status: Status::Degraded,
        reason: Some(reason),
        uses: Vec::new(),
        age_ms: 0,
        is_stale: false,
        sample_age_s: Some(0.02),
        suspicion: None,
        refused: Vec::new(),
    }
}

#[test]
fn each_quantity_says_whether_it_may_be_used_why_and_what_ends_it() {
    let held_back = PipelineHealth {
        status: Status::Estimated,
        uses: vec![
            (Quantity::Resistance, UseState::Usable, "none"),
            (Quantity::Mass, UseState::Confirming, "confirming"),
        ],
        ..pipeline(Reason::None)
    };
    let words = held_back.in_words();
    assert!(words.starts_with("estimated; resistance usable; mass confirming: "), "{words}");
    assert!(words.ends_with("up to 10 min"), "{words}");
    let waiting = PipelineHealth {
        status: Status::Unestimated,
        uses: vec![(Quantity::Adhesion, UseState::Learning, "only_lower_bound")],
        ..pipeline(Reason::OnlyLowerBound)
    };
    let words = waiting.in_words();
    assert!(
        words.ends_with("; adhesion learning (only_lower_bound): wheels that slide end it"),
        "{words}"
    );
}

#[test]
fn what_to_do_follows_what_is_known_best() {
    let train = |verdict, pipelines| {
        let (daemon, controller_process) = (None, Some(7));
        let train = TrainId(1);
        TrainHealth { train, verdict, daemon, controller_process, pipelines }.remedy()
    };
    let mut snapshot = dynocar_shared::ParameterSnapshot::empty();
    snapshot.suspected_effect = EffectKind::DraggingBrake as u32;
    let monitor = PipelineHealth {
        suspicion: Suspicion::from_snapshot(&snapshot),
        ..pipeline(Reason::InnovationsNotWhite)
    };
    let refusing = PipelineHealth {
        refused: vec![(RejectionReason::WheelSlide, 9), (RejectionReason::SpeedJump, 4)],
        ..pipeline(Reason::BadInput)
    };
    let large = pipeline(Reason::InnovationsTooLarge);
    let degraded = |pipelines| train(Verdict::Degraded, pipelines);
    assert!(degraded(vec![large.clone(), monitor.clone()]).contains("every brake releases"));
    assert!(degraded(vec![large.clone(), refusing.clone()]).contains("speed sensor"));
    let both = vec![monitor.clone(), refusing.clone()];
    assert!(degraded(both).contains("speed sensor"), "a suspicion may follow from refusals");
    let refused = vec![(RejectionReason::Repeated, 99), (RejectionReason::NotFinite, 9)];
    let copied = PipelineHealth { refused, ..refusing.clone() };
    assert!(degraded(vec![copied]).contains("leave the bit out"), "copies do no harm");
    let unfit = PipelineHealth { refused: vec![(RejectionReason::Outlier, 9)], ..refusing };
    assert!(degraded(vec![unfit, monitor]).contains("every brake releases"));
    assert!(degraded(vec![pipeline(Reason::BadInput)]).contains("mend the samples"));
    let fine = PipelineHealth { status: Status::Unestimated, ..pipeline(Reason::OnlyLowerBound) };
    let faults = PipelineHealth {
        suspicion: Suspicion::from_snapshot(&snapshot),
        ..pipeline(Reason::ImplausibleForces)
    };
    assert!(degraded(vec![fine, faults]).contains("unit, sign, order and age"));
    let starved =
        PipelineHealth { status: Status::Unestimated, ..pipeline(Reason::MissingQuantity) };
    assert!(degraded(vec![starved]).contains("send what the pipeline needs"));
    let parked = PipelineHealth { sample_age_s: Some(34.0), ..large.clone() };
    assert!(train(Verdict::Ok, vec![parked]).contains("does the controller run"));
    assert_eq!(train(Verdict::Ok, vec![large]), "nothing");
    assert!(train(Verdict::NoDaemon, vec![]).contains("dynocar run"));
}
