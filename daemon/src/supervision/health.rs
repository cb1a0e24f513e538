//! One verdict on the daemon of a train, seen as a controller sees it.

use std::time::{Duration, Instant};

use dynocar_client::Reading;
use dynocar_core::remedy::{of_reason, of_refusal};
use dynocar_model::named;
use dynocar_shared::vocabulary::KindRow;
use dynocar_shared::{PipelineKind, Quantity, Reason, RejectionReason, Status, TrainId, UseState};
use dynocar_transport::{ChannelError, Host, Peer, Role, monotonic_now_ns};

use crate::observing::{ObservedTrain, sample_age_s};
use crate::operator::{SILENT_S, Suspicion, newest_sample_words, refusals};

/// How long to wait for a first snapshot; a daemon vouches for its snapshots every 0.1 s.
const PATIENCE: Duration = Duration::from_millis(1_500);

named! {
    /// How well a train is served; the worse, the greater.
    #[derive(PartialOrd, Ord)]
    Verdict ("in words") {
        /// Every pipeline is vouched for, and none has a reservation.
        Ok "ok";
        /// A pipeline is degraded or invalid, or fed with samples that cannot be true.
        Degraded "degraded";
        /// There is a daemon, but one of its pipelines, or all, have given no sign of life lately.
        Stale "stale";
        /// The daemon there shares no memory format with this program.
        Incompatible "incompatible";
        /// There is no daemon.
        NoDaemon "no daemon";
    }
}

impl Verdict {
    /// Returns the verdict on a pipeline that is vouched for.
    pub const fn new(status: Status, reason: Option<Reason>) -> Self {
        match (status, reason) {
            (Status::Degraded | Status::Invalid, _) => Verdict::Degraded,
            (_, Some(Reason::BadInput)) => Verdict::Degraded,
            (_, Some(reason)) if reason.is_implausible_input() => Verdict::Degraded,
            (Status::Estimated | Status::Unestimated, _) => Verdict::Ok,
        }
    }

    /// Returns the remedy for the verdict, independent of the pipelines' reasons.
    pub const fn remedy(self) -> &'static str {
        match self {
            Verdict::Ok => "nothing",
            Verdict::Degraded => "look at the reasons of the pipelines in docs/guides/reading.md",
            Verdict::Stale => "the daemon hangs or was stopped: look at its log, and restart it",
            Verdict::Incompatible => {
                "install the same release of Dynocar everywhere, and restart what is older; containers \
                 have to share one /dev/shm"
            }
            Verdict::NoDaemon => "start it: `dynocar run --config FILE`; its log says why it ended",
        }
    }

    /// Returns the exit status of `dynocar health`.
    pub const fn exit_status(self) -> u8 {
        match self {
            Verdict::Ok => 0,
            Verdict::Degraded => 3,
            Verdict::Stale => 4,
            Verdict::Incompatible => 5,
            Verdict::NoDaemon => 6,
        }
    }
}

/// One pipeline as a client sees it.
#[derive(Clone, Debug, PartialEq)]
pub struct PipelineHealth {
    /// Number in the daemon's configuration.
    pub index: u32,
    /// The kind's name.
    pub kind: &'static str,
    /// The status; invalid while the daemon is silent.
    pub status: Status,
    /// Why.
    pub reason: Option<Reason>,
    /// The quantities that it answers, each with its state of use and why, in one word.
    pub uses: Vec<(Quantity, UseState, &'static str)>,
    /// Since the daemon last vouched for it, in ms.
    pub age_ms: i64,
    /// True when that is too long ago.
    pub is_stale: bool,
    /// Since the newest sample was published, in s; `None` before the first.
    pub sample_age_s: Option<f64>,
    /// Suspicion of the pipeline.
    pub suspicion: Option<Suspicion>,
    /// Why it refused samples, the most frequent first.
    pub refused: Vec<(RejectionReason, u32)>,
}

impl PipelineHealth {
    /// Returns status and reason, then each quantity with its state of use and the event that ends this state.
    pub fn in_words(&self) -> String {
        let reason = match self.reason {
            Some(Reason::None) => String::new(),
            reason => format!(" ({})", reason.map_or("unknown", Reason::name)),
        };
        let of_quantity = |quantity: Quantity, state: UseState, why: &str| match state {
            UseState::Usable => format!("; {quantity} usable"),
            _ if why == state.name() => {
                format!("; {quantity} {state}: {}", state.ends(self.reason))
            }
            _ => format!("; {quantity} {state} ({why}): {}", state.ends(self.reason)),
        };
        let uses =
            self.uses.iter().map(|&(quantity, state, why)| of_quantity(quantity, state, why));
        format!("{}{reason}{}", self.status, uses.collect::<String>())
    }

    fn verdict(&self) -> Verdict {
        if self.is_stale { Verdict::Stale } else { Verdict::new(self.status, self.reason) }
    }

    /// Returns whether nothing was learned, for lack of something in the samples.
    fn is_starved(&self) -> bool {
        self.status == Status::Unestimated && self.reason.is_some_and(Reason::is_of_input)
    }
}

/// Returns the verdict on a train's pipelines. A pipeline that lacks a quantity is no fault, since not every train
/// measures all, unless no other one learns anything.
fn verdict_of(pipelines: &[PipelineHealth]) -> Verdict {
    let worst = pipelines.iter().map(PipelineHealth::verdict).max().unwrap_or(Verdict::Stale);
    let learns_none = pipelines.iter().all(|it| it.status == Status::Unestimated);
    match learns_none && pipelines.iter().any(PipelineHealth::is_starved) {
        true => worst.max(Verdict::Degraded),
        false => worst,
    }
}

/// A train's daemon with its pipelines.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainHealth {
    /// The train.
    pub train: TrainId,
    /// The worst of all that was seen.
    pub verdict: Verdict,
    /// Statement of the daemon about itself.
    pub daemon: Option<String>,
    /// The process of the train's controller; `None` without one.
    pub controller_process: Option<u32>,
    /// Its pipelines.
    pub pipelines: Vec<PipelineHealth>,
}

impl TrainHealth {
    /// Returns the remedy, in one plain line.
    pub fn remedy(&self) -> &'static str {
        match self.verdict {
            Verdict::Ok if !self.has_samples() => {
                "the daemon waits for samples: does the controller run, under this train's number?"
            }
            Verdict::Degraded => self.remedy_of_pipelines(),
            verdict => verdict.remedy(),
        }
    }

    /// Since the newest sample of all pipelines was published, in s; `None` before the first.
    fn sample_age_s(&self) -> Option<f64> {
        self.pipelines.iter().filter_map(|it| it.sample_age_s).reduce(f64::min)
    }

    fn has_samples(&self) -> bool {
        self.sample_age_s().is_some_and(|age_s| age_s < SILENT_S)
    }

    /// Returns the age of the newest sample, and who sends samples.
    pub fn samples_in_words(&self) -> String {
        newest_sample_words(self.sample_age_s(), self.controller_process)
    }

    /// Samples that cannot be true come first: a suspect may follow from them. A suspect says more than that the model lacks
    /// something, and a reason for refusals more than that the input is bad.
    fn remedy_of_pipelines(&self) -> &'static str {
        let is_implausible = |reason: &Reason| reason.is_implausible_input();
        let implausible = self.pipelines.iter().find_map(|it| it.reason.filter(is_implausible));
        if let Some(reason) = implausible {
            return of_reason(reason);
        }
        let suspect = self.pipelines.iter().find_map(|it| it.suspicion?.effect);
        if let Some(effect) = suspect {
            return KindRow::of(effect).to_do;
        }
        let is_amiss = |it: &&PipelineHealth| it.verdict() == Verdict::Degraded;
        let starved = || self.pipelines.iter().find(|it| it.is_starved());
        let first = self.pipelines.iter().find(is_amiss).or_else(starved);
        let Some(first) = first else { return Verdict::Degraded.remedy() };
        match first.reason {
            Some(Reason::BadInput) => {
                let refusal = first.refused.iter().find_map(|it| of_refusal(it.0));
                refusal.unwrap_or(of_reason(Reason::BadInput))
            }
            reason => of_reason(reason.unwrap_or(Reason::None)),
        }
    }
}

/// Looks at the daemon of a train.
///
/// # Errors
///
/// When the run-time directory or the channel cannot be used.
pub fn look_at(host: &Host, train: TrainId) -> Result<TrainHealth, ChannelError> {
    let (verdict, daemon) = match Peer::look_up(host, train, Role::Daemon)? {
        Peer::Absent => (Verdict::NoDaemon, None),
        Peer::Incompatible(peer) => {
            let words = match ChannelError::of_peer(train, peer.clone(), Role::Controller) {
                error @ ChannelError::SeparateMemory { .. } => error.to_string(),
                _ => peer.to_string(),
            };
            (Verdict::Incompatible, Some(words))
        }
        Peer::Compatible(peer) => (Verdict::Ok, Some(peer.to_string())),
    };
    let controller_process = match Peer::look_up(host, train, Role::Controller)? {
        Peer::Compatible(peer) | Peer::Incompatible(peer) => Some(peer.process_id),
        Peer::Absent => None,
    };
    let pipelines = match verdict {
        Verdict::Ok => pipelines_of(&mut ObservedTrain::open(host, train)?),
        _ => Vec::new(),
    };
    let verdict = if verdict == Verdict::Ok { verdict_of(&pipelines) } else { verdict };
    Ok(TrainHealth { train, verdict, daemon, controller_process, pipelines })
}

/// Returns the pipelines that speak up within [`PATIENCE`]; all of them do within a heartbeat.
fn pipelines_of(observed: &mut ObservedTrain) -> Vec<PipelineHealth> {
    let start = Instant::now();
    let mut first_heard = None;
    while start.elapsed() < PATIENCE {
        observed.poll();
        let is_fresh = observed.readings(monotonic_now_ns()).any(|reading| !reading.is_stale);
        if is_fresh && first_heard.is_none() {
            first_heard = Some(Instant::now());
        }
        // The others have a heartbeat's time.
        if first_heard.is_some_and(|heard| heard.elapsed() > Duration::from_millis(150)) {
            break;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    let now_ns = monotonic_now_ns();
    let of_reading = |reading: Reading<'_>| PipelineHealth {
        index: reading.snapshot.pipeline_index,
        kind: reading.snapshot.pipeline_kind().map_or("unknown", PipelineKind::name),
        status: reading.status(),
        reason: reading.reason(),
        uses: Quantity::ALL
            .iter()
            .filter(|&&quantity| reading.snapshot.answers(quantity))
            .map(|&quantity| {
                let asked = Reading { quantity: Some(quantity), ..reading };
                (quantity, asked.use_state(), asked.why())
            })
            .collect(),
        age_ms: reading.age_ns / 1_000_000,
        is_stale: reading.is_stale,
        sample_age_s: sample_age_s(reading.snapshot, now_ns),
        suspicion: Suspicion::from_snapshot(reading.snapshot),
        refused: refusals(&reading.snapshot.rejected_by_reason),
    };
    observed.readings(now_ns).map(of_reading).collect()
}

#[cfg(test)]
mod tests {
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
        assert_eq!(
            verdict_of(&[starved(), known]),
            Verdict::Ok,
            "a brake without a pressure sensor"
        );
        assert_eq!(
            verdict_of(&[waiting(Reason::TooFewSamples)]),
            Verdict::Ok,
            "a train that stands"
        );
        let words = PipelineHealth {
            uses: vec![(Quantity::Mass, UseState::Learning, "missing_quantity")],
            ..starved()
        };
        assert!(words.in_words().ends_with("(missing_quantity): it ends with its reason"));
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
        assert!(degraded(vec![large.clone(), monitor]).contains("every brake releases"));
        assert!(degraded(vec![large.clone(), refusing]).contains("explain"), "the first");
        assert!(degraded(vec![pipeline(Reason::BadInput)]).contains("mend the samples"));
        let fine =
            PipelineHealth { status: Status::Unestimated, ..pipeline(Reason::OnlyLowerBound) };
        let faults = PipelineHealth {
            suspicion: Suspicion::from_snapshot(&snapshot),
            ..pipeline(Reason::ImplausibleForces)
        };
        assert!(degraded(vec![fine, faults]).contains("unit, sign and order"));
        let starved =
            PipelineHealth { status: Status::Unestimated, ..pipeline(Reason::MissingQuantity) };
        assert!(degraded(vec![starved]).contains("send what the pipeline needs"));
        let parked = PipelineHealth { sample_age_s: Some(34.0), ..large.clone() };
        assert!(train(Verdict::Ok, vec![parked]).contains("does the controller run"));
        assert_eq!(train(Verdict::Ok, vec![large]), "nothing");
        assert!(train(Verdict::NoDaemon, vec![]).contains("dynocar run"));
    }
}
