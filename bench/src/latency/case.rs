//! What is measured together with what.

use dynocar::config::IdleStrategy;
use dynocar_client::monotonic_now_ns;
use dynocar_shared::PipelineKind;

use super::companion::Companion;
use super::link::{ClientLink, DatagramLink, Link, NotifyingLink};
use super::schedule::{Schedule, Slice, await_ready, drive};
use super::server::TRAIN;
#[cfg(feature = "zeromq")]
use super::zeromq::ZeroMqLink;
use crate::rig::RigError;
use crate::rig::child::Peer;
use crate::rig::cores::{Cores, bind, prioritise};
use crate::rig::motion::Motion;
use crate::rig::pipelines;
use crate::rig::site::{DaemonPlan, Site, ThreadPlan};
use crate::rig::usage::{self, ThreadUsage};

/// The pipeline that is compared with the floor and the alternatives.
pub const COMPARED: PipelineKind = PipelineKind::RegularisedRls;
/// The daemon's thread in every case.
const THREAD: &str = "measured";

/// Who answers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answerer {
    /// An echo on the daemon's channels, with no daemon and no estimator.
    Floor,
    /// The daemon with these pipelines on one thread, of which one is polled.
    Daemon {
        /// In the order of the configuration.
        pipelines: Vec<PipelineKind>,
        /// The one that counts.
        polled: PipelineKind,
    },
    /// [`COMPARED`] behind a Unix datagram socket.
    UnixDatagram,
    /// [`COMPARED`] behind a ZeroMQ pair socket.
    #[cfg(feature = "zeromq")]
    ZeroMq,
}

/// One line of the result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Case {
    /// `floor`, `dynocar/<pipeline>` or `alternative/<transport>`.
    pub name: String,
    /// What the answering thread does while no sample comes.
    pub idle: IdleStrategy,
    /// Who answers.
    pub answerer: Answerer,
    /// Who reads the same channels.
    pub companions: &'static [Companion],
    /// Candidates that the daemon tries next to its model.
    pub candidates: u32,
}

impl Case {
    fn new(name: impl Into<String>, idle: IdleStrategy, answerer: Answerer) -> Self {
        Case { name: name.into(), idle, answerer, companions: &[], candidates: 0 }
    }

    fn alone(kind: PipelineKind, idle: IdleStrategy) -> Self {
        let answerer = Answerer::Daemon { pipelines: vec![kind], polled: kind };
        Case::new(format!("dynocar/{kind}"), idle, answerer)
    }

    /// The compared pipeline with other readers of its channels.
    fn with_readers(companions: &'static [Companion], idle: IdleStrategy) -> Self {
        let alone = Case::alone(COMPARED, idle);
        let readers: Vec<&str> = companions.iter().map(|it| it.name()).collect();
        Case { name: format!("{}+{}", alone.name, readers.join("+")), companions, ..alone }
    }

    /// The compared pipeline with two candidates on trial in its shadow.
    fn in_shadow(idle: IdleStrategy) -> Self {
        let alone = Case::alone(COMPARED, idle);
        Case { name: format!("{}+two_candidates", alone.name), candidates: 2, ..alone }
    }

    /// The strategy of the floor that this case is compared with: nothing is lower for an
    /// adaptive thread than one that never sleeps.
    pub fn floor_idle(&self) -> IdleStrategy {
        match self.idle {
            IdleStrategy::Event => IdleStrategy::Event,
            IdleStrategy::Busy | IdleStrategy::Adaptive => IdleStrategy::Busy,
        }
    }
}

/// Every case, or the ones that a quick check runs.
pub fn cases(is_quick: bool) -> Vec<Case> {
    use IdleStrategy::{Adaptive, Busy, Event};
    let all_fast = |polled: PipelineKind, is_first: bool| {
        let mut pipelines = pipelines::fast();
        pipelines.retain(|&kind| kind != polled);
        pipelines.insert(if is_first { 0 } else { pipelines.len() }, polled);
        Answerer::Daemon { pipelines, polled }
    };
    let mut cases = vec![
        Case::new("floor", Busy, Answerer::Floor),
        Case::alone(COMPARED, Busy),
        Case::alone(COMPARED, Adaptive),
        Case::new("dynocar/all_fast", Busy, all_fast(COMPARED, true)),
        Case::new("alternative/unix_datagram", Busy, Answerer::UnixDatagram),
        Case::new("floor", Event, Answerer::Floor),
        Case::alone(COMPARED, Event),
        Case::new("alternative/unix_datagram", Event, Answerer::UnixDatagram),
        #[cfg(feature = "zeromq")]
        Case::new("alternative/zeromq", Event, Answerer::ZeroMq),
    ];
    if !is_quick {
        cases.push(Case::new("dynocar/all_fast_last", Busy, all_fast(COMPARED, false)));
        cases.push(Case::alone(PipelineKind::Echo, Busy));
        let others = pipelines::fast().into_iter().filter(|&kind| kind != COMPARED);
        cases.extend(others.map(|kind| Case::alone(kind, Busy)));
    }
    cases
}

/// The cases with other readers, for whoever has built their programs.
pub fn cases_with_readers() -> Vec<Case> {
    use Companion::{Live, Recorder};
    let all: [&[Companion]; 3] = [&[Recorder], &[Live], &[Recorder, Live]];
    let of = |idle| all.map(|companions| Case::with_readers(companions, idle));
    [of(IdleStrategy::Event), of(IdleStrategy::Busy)].concat()
}

/// The cases with models on trial.
pub fn cases_in_shadow() -> Vec<Case> {
    [IdleStrategy::Event, IdleStrategy::Busy].map(Case::in_shadow).into()
}

/// What one slice brought.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Its latencies.
    pub slice: Slice,
    /// What the daemon's thread suffered meanwhile; `None` without a daemon.
    pub suffered: Option<ThreadUsage>,
}

/// Measures one slice of a case with processes of its own; binds the calling thread.
///
/// ZeroMQ has threads of its own in both processes; they are started before the binding and after
/// the priority, so that they have the same and may run on either core. A busy case of it would
/// leave them none: the measuring thread and the answering one take both.
///
/// # Errors
///
/// When a process or a transport fails.
pub fn measure(case: &Case, cores: Cores, schedule: &Schedule) -> Result<Outcome, RigError> {
    let site = Site::new()?;
    let blocks = case.idle == IdleStrategy::Event;
    let mut peer = start(case, &site, cores)?;
    let started: Result<Vec<Peer>, RigError> =
        case.companions.iter().map(|it| it.start(&site)).collect();
    // They end with the slice.
    let _companions = started?;
    prioritise(cores.priority);
    match (&case.answerer, blocks) {
        (Answerer::Floor, true) => {
            let mut link = NotifyingLink::open(&site, TRAIN)?;
            run(&mut link, &mut peer, cores, schedule)
        }
        (Answerer::Floor, false) => {
            let mut link = ClientLink::open(&site, TRAIN, PipelineKind::Echo)?;
            run(&mut link, &mut peer, cores, schedule)
        }
        (Answerer::Daemon { polled, .. }, _) => {
            let mut link = ClientLink::open(&site, TRAIN, *polled)?;
            let outcome = run(&mut link, &mut peer, cores, schedule)?;
            peer.stop()?;
            Ok(outcome)
        }
        (Answerer::UnixDatagram, _) => {
            let mut link = DatagramLink::open(&site, blocks)?;
            run(&mut link, &mut peer, cores, schedule)
        }
        #[cfg(feature = "zeromq")]
        (Answerer::ZeroMq, _) => {
            let mut link = ZeroMqLink::open(&site, blocks)?;
            run(&mut link, &mut peer, cores, schedule)
        }
    }
}

fn run(
    link: &mut impl Link,
    peer: &mut Peer,
    cores: Cores,
    schedule: &Schedule,
) -> Result<Outcome, RigError> {
    bind(cores.controller);
    let mut motion = Motion::of(TRAIN, monotonic_now_ns());
    await_ready(link, &mut motion, || peer.require())?;
    drive(link, &mut motion, schedule.rate_hz, schedule.warm_up_s)?;
    let before = usage::of_thread(peer.process_id(), THREAD);
    let slice = drive(link, &mut motion, schedule.rate_hz, schedule.measure_s)?;
    let after = usage::of_thread(peer.process_id(), THREAD);
    peer.require()?;
    let suffered = before.zip(after).map(|(before, after)| after.since(&before));
    Ok(Outcome { slice, suffered })
}

fn start(case: &Case, site: &Site, cores: Cores) -> Result<Peer, RigError> {
    let folder = site.path().to_string_lossy().into_owned();
    let core = cores.server.to_string();
    let priority = cores.priority.map(|priority| priority.to_string());
    let mut arguments: Vec<&str> = match &case.answerer {
        Answerer::Daemon { pipelines, .. } => {
            let thread = ThreadPlan {
                name: THREAD,
                core: Some(cores.server),
                idle: case.idle,
                priority: cores.priority,
                pipelines: pipelines.clone(),
            };
            let lines = match case.candidates {
                0 => String::new(),
                count => site.put_candidates(TRAIN, count)?,
            };
            let plan = DaemonPlan { trains: 1, threads: vec![thread], lines };
            let config = site.write_config(&plan)?;
            return Peer::start(site, &["daemon", &config.to_string_lossy()]);
        }
        Answerer::Floor if case.idle == IdleStrategy::Event => vec!["listening-echo", &folder],
        Answerer::Floor => vec!["echo", &folder],
        Answerer::UnixDatagram => vec!["unix-datagram", &folder],
        #[cfg(feature = "zeromq")]
        Answerer::ZeroMq => vec!["zero-mq", &folder],
    };
    arguments.extend(["--core", &core]);
    if let Some(priority) = &priority {
        arguments.extend(["--priority", priority]);
    }
    if case.idle == IdleStrategy::Event {
        arguments.push("--blocks");
    }
    Peer::start(site, &arguments)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_case_has_a_floor_and_a_name_of_the_contract() {
        for is_quick in [false, true] {
            let cases = [cases(is_quick), cases_with_readers(), cases_in_shadow()].concat();
            for case in &cases {
                let floor =
                    cases.iter().find(|it| it.name == "floor" && it.idle == case.floor_idle());
                assert!(floor.is_some(), "{}", case.name);
                let is_named = case.name == "floor"
                    || case.name.starts_with("dynocar/")
                    || case.name.starts_with("alternative/");
                assert!(is_named, "{}", case.name);
            }
        }
    }

    #[test]
    fn no_case_is_measured_twice() {
        let cases = [cases(false), cases_with_readers(), cases_in_shadow()].concat();
        for (index, case) in cases.iter().enumerate() {
            let same = |it: &Case| (&it.name, it.idle) == (&case.name, case.idle);
            assert_eq!(cases.iter().position(same), Some(index));
        }
    }
}
