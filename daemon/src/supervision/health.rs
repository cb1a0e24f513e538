//! One verdict on the daemon of a train, seen as a controller sees it.

use std::fmt;
use std::time::{Duration, Instant};

use dynocar_client::{ChannelError, Host, Peer, Role, SnapshotReader, monotonic_now_ns};
use dynocar_shared::{PipelineKind, Reason, Status, TrainId};

/// How long a first snapshot is waited for; a daemon vouches for its snapshots each 0.1 s.
const PATIENCE: Duration = Duration::from_millis(1_500);

/// How well a train is served; the worse, the greater.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// Every pipeline is vouched for, none with a reservation.
    Ok,
    /// A pipeline is degraded or invalid, or fed with samples that cannot be true.
    Degraded,
    /// There is a daemon, but a pipeline, or all, have not been heard of lately.
    Stale,
    /// The daemon there shares no memory format with this program.
    Incompatible,
    /// There is no daemon.
    NoDaemon,
}

impl Verdict {
    /// The exit status of `dynocar health`.
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

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Verdict::Ok => "ok",
            Verdict::Degraded => "degraded",
            Verdict::Stale => "stale",
            Verdict::Incompatible => "incompatible",
            Verdict::NoDaemon => "no daemon",
        })
    }
}

/// One pipeline as a client sees it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PipelineHealth {
    /// Number in the daemon's configuration.
    pub index: u32,
    /// The kind's name.
    pub kind: &'static str,
    /// The status; invalid while the daemon is silent.
    pub status: Status,
    /// Why.
    pub reason: Option<Reason>,
    /// Since the daemon last vouched for it, in ms.
    pub age_ms: i64,
    /// True when that is too long ago.
    pub is_stale: bool,
}

/// A train's daemon with its pipelines.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TrainHealth {
    /// The train.
    pub train: TrainId,
    /// The worst of all that was seen.
    pub verdict: Verdict,
    /// What the daemon says of itself.
    pub daemon: Option<String>,
    /// Its pipelines.
    pub pipelines: Vec<PipelineHealth>,
}

/// Looks at the daemon of a train.
///
/// # Errors
///
/// When the run-time directory or the channel cannot be used.
pub fn look_at(host: &Host, train: TrainId) -> Result<TrainHealth, ChannelError> {
    let (verdict, daemon) = match Peer::look_up(host, train, Role::Daemon)? {
        Peer::Absent => (Verdict::NoDaemon, None),
        Peer::Incompatible(peer) => (Verdict::Incompatible, Some(peer.to_string())),
        Peer::Compatible(peer) => (Verdict::Ok, Some(peer.to_string())),
    };
    if verdict != Verdict::Ok {
        return Ok(TrainHealth { train, verdict, daemon, pipelines: Vec::new() });
    }
    let pipelines = pipelines_of(&mut SnapshotReader::open(host, train)?);
    let verdict = pipelines.iter().map(verdict_of).max().unwrap_or(Verdict::Stale);
    Ok(TrainHealth { train, verdict, daemon, pipelines })
}

/// A bound of adhesion, or adhesion of an earlier braking, is what every train has that brakes well on
/// a good rail: nothing is amiss.
fn verdict_of(it: &PipelineHealth) -> Verdict {
    match (it.status, it.reason) {
        _ if it.is_stale => Verdict::Stale,
        (Status::Degraded, Some(Reason::OnlyLowerBound | Reason::EstimateStale)) => Verdict::Ok,
        (Status::Degraded | Status::Invalid, _) => Verdict::Degraded,
        (_, Some(reason)) if reason.is_implausible_input() => Verdict::Degraded,
        (Status::Estimated | Status::Unestimated, _) => Verdict::Ok,
    }
}

/// The pipelines that speak up within [`PATIENCE`]; all of them do within a heartbeat.
fn pipelines_of(reader: &mut SnapshotReader) -> Vec<PipelineHealth> {
    let start = Instant::now();
    let mut first_heard = None;
    while start.elapsed() < PATIENCE {
        reader.poll();
        let is_fresh = reader.readings(monotonic_now_ns()).any(|reading| !reading.is_stale);
        if is_fresh && first_heard.is_none() {
            first_heard = Some(Instant::now());
        }
        // The others have a heartbeat's time.
        if first_heard.is_some_and(|heard| heard.elapsed() > Duration::from_millis(150)) {
            break;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    let of_reading = |reading: dynocar_client::Reading<'_>| PipelineHealth {
        index: reading.snapshot.pipeline_index,
        kind: reading.snapshot.pipeline_kind().map_or("unknown", PipelineKind::name),
        status: reading.status(),
        reason: reading.reason(),
        age_ms: reading.age_ns / 1_000_000,
        is_stale: reading.is_stale,
    };
    reader.readings(monotonic_now_ns()).map(of_reading).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn good_brakes_on_a_good_rail_are_no_degradation() {
        let verdict = |status, reason, is_stale| {
            let (reason, age_ms) = (Some(reason), 0);
            let kind = "adhesion_law";
            verdict_of(&PipelineHealth { index: 0, kind, status, reason, age_ms, is_stale })
        };
        let degraded = Status::Degraded;
        assert_eq!(verdict(degraded, Reason::OnlyLowerBound, false), Verdict::Ok);
        assert_eq!(verdict(degraded, Reason::EstimateStale, false), Verdict::Ok);
        assert_eq!(verdict(degraded, Reason::InnovationsTooLarge, false), Verdict::Degraded);
        assert_eq!(verdict(Status::Invalid, Reason::DaemonSilent, true), Verdict::Stale);
    }
}
