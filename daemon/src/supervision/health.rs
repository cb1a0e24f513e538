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
        let ends = |state: UseState| state.ends(self.reason, PipelineKind::from_name(self.kind));
        let of_quantity = |quantity: Quantity, state: UseState, why: &str| match state {
            UseState::Usable => format!("; {quantity} usable"),
            _ if why == state.name() => format!("; {quantity} {state}: {}", ends(state)),
            _ => format!("; {quantity} {state} ({why}): {}", ends(state)),
        };
        let uses =
            self.uses.iter().map(|&(quantity, state, why)| of_quantity(quantity, state, why));
        format!("{}{reason}{}", self.status, uses.collect::<String>())
    }

    /// Returns the reason for most of the refusals that ask for something to be done, as a remedy. Repetitions come
    /// last: most do no harm.
    fn remedy_of_refusals(&self) -> Option<&'static str> {
        let is_repeated = |reason: RejectionReason| reason == RejectionReason::Repeated;
        let refused = || self.refused.iter().map(|it| it.0);
        let others = refused().filter(|&it| !is_repeated(it));
        others.chain(refused().filter(|&it| is_repeated(it))).find_map(of_refusal)
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

    /// The first of the things to be mended: samples that cannot be true, then samples that are refused, since a suspicion
    /// may follow from either. A suspect says more than that the model lacks something, and a reason for refusals more
    /// than that the input is bad.
    fn remedy_of_pipelines(&self) -> &'static str {
        let with = |is: fn(Reason) -> bool| {
            self.pipelines.iter().filter(move |it| it.reason.is_some_and(is))
        };
        let implausible = with(Reason::is_implausible_input).find_map(|it| it.reason);
        if let Some(reason) = implausible {
            return of_reason(reason);
        }
        let refusing = || with(|reason| reason == Reason::BadInput);
        if let Some(remedy) = refusing().find_map(PipelineHealth::remedy_of_refusals) {
            return remedy;
        }
        let suspect = self.pipelines.iter().find_map(|it| it.suspicion?.effect);
        if let Some(effect) = suspect {
            return KindRow::of(effect).to_do;
        }
        let is_amiss = |it: &&PipelineHealth| it.verdict() == Verdict::Degraded;
        let starved = || self.pipelines.iter().find(|it| it.is_starved());
        let first = self.pipelines.iter().find(is_amiss).or_else(starved);
        first.map_or(Verdict::Degraded.remedy(), |it| of_reason(it.reason.unwrap_or(Reason::None)))
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
mod tests;
