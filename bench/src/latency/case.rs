//! What is measured together with what.

use std::process::Stdio;

use dynocar::config::IdleStrategy;
use dynocar::programs::{LIVE, RECORDING, call};
use dynocar_client::monotonic_now_ns;
use dynocar_shared::PipelineKind;
use dynocar_tests::process::{Process, Site};

use super::link::{Client, Controller, Datagrams, Notifying};
use super::schedule::{Schedule, Slice, await_ready, drive};
use super::sockets::{COMPARED, TRAIN};
#[cfg(feature = "zeromq")]
use super::zeromq::ZeroMq;
use crate::output::{Failure, during};
use crate::rig::cores::{Cores, bind, prioritise};
use crate::rig::motion::Motion;
use crate::rig::pipelines;
use crate::rig::site::{DaemonPlan, ThreadPlan, peer, put_candidates, require, site, stop};
use crate::rig::usage;

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

/// A program that reads what a controller and the daemon write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Companion {
    /// `dynocar record`.
    Recorder,
    /// `dynocar live`, with nobody looking.
    Live,
}

impl Companion {
    /// Its name in a case.
    pub fn name(self) -> &'static str {
        match self {
            Companion::Recorder => "recorder",
            Companion::Live => "live",
        }
    }

    /// Starts it on a site, and waits for its first line: by then its channels are open.
    ///
    /// # Errors
    ///
    /// When it cannot be started.
    pub fn start(self, site: &Site) -> Result<Process, Failure> {
        let (train, file) = (TRAIN.to_string(), site.path().join("run.mcap"));
        let file = file.to_string_lossy();
        let (package, arguments) = match self {
            Companion::Recorder => (RECORDING, vec!["record", "--output", &file]),
            Companion::Live => (LIVE, vec!["--port", "0"]),
        };
        let mut program = call(package);
        // One that is not there is named in words.
        let look = program.arg("--version").stdout(Stdio::null()).status();
        look.map_err(during(package))?;
        let program = program.get_program().to_string_lossy();
        let mut process = site.start(&program, &[&arguments[..], &["--train", &train]].concat());
        process.await_error("\n");
        require(&mut process)?;
        Ok(process)
    }
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
    /// Page faults, own waits and preemptions of the daemon's thread meanwhile; `None` without a daemon.
    pub suffered: Option<[u64; 3]>,
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
pub fn measure(case: &Case, cores: Cores, schedule: &Schedule) -> Result<Outcome, Failure> {
    let site = site();
    let blocks = case.idle == IdleStrategy::Event;
    let mut peer = start(case, &site, cores)?;
    let started: Result<Vec<Process>, Failure> =
        case.companions.iter().map(|it| it.start(&site)).collect();
    // They end with the slice.
    let _companions = started?;
    prioritise(cores.priority);
    let mut controller = match &case.answerer {
        Answerer::Floor if blocks => Controller::new(Notifying::open(&site, TRAIN)?),
        Answerer::Floor => Controller::new(Client::open(&site, TRAIN, PipelineKind::Echo)?),
        Answerer::Daemon { polled, .. } => Controller::new(Client::open(&site, TRAIN, *polled)?),
        Answerer::UnixDatagram => Controller::new(Datagrams::open(&site, blocks)?),
        #[cfg(feature = "zeromq")]
        Answerer::ZeroMq => Controller::new(ZeroMq::open(&site, blocks)?),
    };
    let outcome = run(&mut controller, &mut peer, cores, schedule)?;
    if matches!(case.answerer, Answerer::Daemon { .. }) {
        stop(peer)?;
    }
    Ok(outcome)
}

fn run(
    link: &mut Controller,
    peer: &mut Process,
    cores: Cores,
    schedule: &Schedule,
) -> Result<Outcome, Failure> {
    bind(cores.controller);
    let mut motion = Motion::of(TRAIN, monotonic_now_ns());
    await_ready(link, &mut motion, || require(peer))?;
    drive(link, &mut motion, schedule.rate_hz, schedule.warm_up_s)?;
    let before = usage::of_thread(peer.id(), THREAD);
    let slice = drive(link, &mut motion, schedule.rate_hz, schedule.measure_s)?;
    let after = usage::of_thread(peer.id(), THREAD);
    require(peer)?;
    let since = |(before, after): ([u64; 3], [u64; 3])| {
        std::array::from_fn(|which| after[which] - before[which])
    };
    let suffered = before.zip(after).map(since);
    Ok(Outcome { slice, suffered })
}

fn start(case: &Case, site: &Site, cores: Cores) -> Result<Process, Failure> {
    let kind = match &case.answerer {
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
                count => put_candidates(site, TRAIN, count)?,
            };
            return DaemonPlan { trains: 1, threads: vec![thread], lines }.start(site);
        }
        Answerer::Floor => "echo",
        Answerer::UnixDatagram => "unix-datagram",
        #[cfg(feature = "zeromq")]
        Answerer::ZeroMq => "zeromq",
    };
    let (folder, core) = (site.path().to_string_lossy(), cores.server.to_string());
    let priority = cores.priority.map(|priority| priority.to_string());
    let mut arguments: Vec<&str> = vec![&folder, "--core", &core];
    arguments.extend(priority.iter().flat_map(|priority| ["--priority", priority]));
    arguments.extend((case.idle == IdleStrategy::Event).then_some("--blocks"));
    peer(site, kind, &arguments)
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
