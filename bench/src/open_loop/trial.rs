//! One trial: several trains at one rate against one answerer, with processes of its own.

use std::process::Stdio;
use std::sync::atomic::AtomicBool;

use dynocar::config::IdleStrategy;
use dynocar::programs::{LIVE, RECORDING, call};
use dynocar_shared::{PipelineKind, TrainId};
use dynocar_tests::process::{DaemonSite, Process};
use dynocar_transport::monotonic_now_ns;

use super::controller::{Controller, TrialOutcome, drive, settle};
use super::traffic::{LoopTraffic, TrafficPlan};
use super::wire::{BenchTransport, Client, Datagrams, Notifying, SocketEnd, TRAIN};
use crate::output::{BenchError, during};
use crate::rig::cores::{Cores, bind, prioritise, process_usage};
use crate::rig::site::{DaemonPlan, ThreadPlan, peer, put_candidates, require, site, stop};
use crate::rig::slow_pipelines;

/// The answering side.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answerer {
    /// An echo on the daemon's channels, with no daemon and no estimator.
    Floor,
    /// The daemon with these pipelines, in the order of the configuration, of which one is polled, or all.
    Daemon(Vec<PipelineKind>, Option<PipelineKind>),
    /// The compared estimator behind a Unix datagram socket.
    UnixDatagram,
    /// The same behind a ZeroMQ pair socket.
    #[cfg(feature = "zeromq")]
    ZeroMq,
}

/// A program that reads the channels of a controller and of the daemon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Companion {
    /// `dynocar record`.
    Recorder,
    /// `dynocar live`, with nobody looking.
    Live,
}

impl Companion {
    /// Starts it on a site, and waits for its first line: by then its channels are open.
    fn start(self, site: &DaemonSite) -> Result<Process, BenchError> {
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

/// The answering side, and the programs and candidates that run with it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Setting {
    /// The answering side.
    pub answerer: Answerer,
    /// Idle strategy of the answering threads.
    pub idle: IdleStrategy,
    /// Who reads the same channels.
    pub companions: &'static [Companion],
    /// Candidates that the daemon tries next to its model.
    pub candidates: u32,
}

/// Extent of the load.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// Number of trains.
    pub trains: u64,
    /// The traffic of each.
    pub traffic: TrafficPlan,
    /// How long samples are sent before counting begins, in s. A new controller wakes every
    /// thread it knows nothing of for half a second; that is not to be measured.
    pub warm_up_s: f64,
    /// How long is measured, in s.
    pub seconds: f64,
    /// Cores of the controllers and of the answering side.
    pub cores: Cores,
    /// Seed of jitter and bad samples.
    pub seed: u64,
}

/// Result of one trial.
#[derive(Clone, Debug)]
pub struct OpenLoopTrial {
    /// By pipeline that is polled.
    pub pipelines: Vec<TrialOutcome>,
    /// Processor time of the answering process over wall time, in %; 100 is one core.
    pub cpu_percent: f64,
    /// Its resident memory after the warm-up, in bytes.
    pub rss_start_bytes: u64,
    /// Its resident memory at the end, in bytes.
    pub rss_bytes: u64,
    /// The latest that a sample left after its appointed time, in ns: beyond some ms the
    /// controllers themselves are at their limit.
    pub publisher_lag_ns: i64,
    /// For how long in s controllers and the fast thread were ready but had no processor.
    pub waits_s: [f64; 2],
    /// How often the fast thread was made to wait for another.
    pub preempted: u64,
}

impl OpenLoopTrial {
    /// Returns the samples of which some pipeline gave no account.
    pub fn missing(&self) -> u64 {
        self.pipelines.iter().map(TrialOutcome::missing).sum()
    }
}

/// Name of the daemon's thread with the fast pipelines.
const FAST: &str = "fast";

/// Runs one trial, until it is over at the latest; binds the calling thread.
///
/// ZeroMQ has threads of its own in both processes; they are started before the binding and after
/// the priority, so that they have the same and may run on either core. A busy case of it would
/// leave them none: the measuring thread and the answering one take both.
///
/// # Errors
///
/// When a process or a transport fails.
pub fn run(
    setting: &Setting,
    extent: &Extent,
    is_over: &AtomicBool,
) -> Result<OpenLoopTrial, BenchError> {
    let Extent { trains, traffic, cores, seed, .. } = *extent;
    let site = site();
    let mut peer = setting.start(&site, extent)?;
    let started: Result<Vec<Process>, BenchError> =
        setting.companions.iter().map(|it| it.start(&site)).collect();
    // They end with the trial.
    let _companions = started?;
    prioritise(cores.priority);
    let mut controllers = (1..=trains)
        .map(|id| {
            let traffic = LoopTraffic::new(traffic, TrainId(id), monotonic_now_ns(), seed);
            Ok(Controller::new(setting.wire(&site, TrainId(id))?, traffic, setting.polled()))
        })
        .collect::<Result<Vec<_>, BenchError>>()?;
    bind(cores.controller);
    for controller in &mut controllers {
        controller.await_ready(&mut peer)?;
    }
    let trial = measure(&mut controllers, setting.polled(), &mut peer, (extent, is_over))?;
    drop(controllers);
    stop(peer)?;
    Ok(trial)
}

/// Warms up, and measures trains whose pipelines answer.
fn measure(
    controllers: &mut [Controller],
    polled: usize,
    peer: &mut Process,
    (extent, is_over): (&Extent, &AtomicBool),
) -> Result<OpenLoopTrial, BenchError> {
    let (rate_hz, trains) = (extent.traffic.rate_hz, controllers.len() as f64);
    let outcomes = || -> Vec<TrialOutcome> { (0..polled).map(|_| TrialOutcome::empty()).collect() };
    // Trains start evenly spread over the first period.
    let begin = |controllers: &mut [Controller], seconds: f64| {
        let start_ns = monotonic_now_ns() + 1_000_000;
        for (index, controller) in controllers.iter_mut().enumerate() {
            let spread_ns = (index as f64 / trains * 1e9 / rate_hz) as i64;
            controller.begin(start_ns + spread_ns, (seconds * rate_hz) as u64);
        }
        start_ns
    };
    let after = |start_ns: i64, seconds: f64| start_ns + (1e9 * seconds) as i64;
    let (mut uncounted, mut counted) = (outcomes(), outcomes());
    let start_ns = begin(controllers, extent.warm_up_s);
    drive(controllers, &mut uncounted, after(start_ns, extent.warm_up_s), is_over)?;
    settle(controllers, &mut uncounted)?;
    require(peer)?;
    let usage = || (process_usage(peer.id(), FAST), monotonic_now_ns());
    let (early, early_ns) = usage();
    let start_ns = begin(controllers, extent.seconds);
    let publisher_lag_ns =
        drive(controllers, &mut counted, after(start_ns, extent.seconds), is_over)?;
    let (late, late_ns) = usage();
    settle(controllers, &mut counted)?;
    controllers.iter().for_each(|it| it.account(&mut counted));
    Ok(OpenLoopTrial {
        pipelines: counted,
        cpu_percent: 1e11 * (late.cpu_s - early.cpu_s) / (late_ns - early_ns) as f64,
        rss_start_bytes: early.rss_bytes,
        rss_bytes: late.rss_bytes,
        publisher_lag_ns,
        waits_s: std::array::from_fn(|which| late.waits_s[which] - early.waits_s[which]),
        preempted: late.preempted - early.preempted,
    })
}

impl Setting {
    /// Returns how many pipelines are polled.
    fn polled(&self) -> usize {
        match &self.answerer {
            Answerer::Daemon(pipelines, None) => pipelines.len(),
            _ => 1,
        }
    }

    /// Returns the controller's end.
    fn wire(
        &self,
        site: &DaemonSite,
        train: TrainId,
    ) -> Result<Box<dyn BenchTransport>, BenchError> {
        let (folder, blocks) = (site.path(), self.idle == IdleStrategy::Event);
        Ok(match &self.answerer {
            Answerer::Floor if blocks => Box::new(Notifying::open(site, train)?),
            Answerer::Floor => Box::new(Client::open(site, train, Some(PipelineKind::Echo))?),
            Answerer::Daemon(_, polled) => Box::new(Client::open(site, train, *polled)?),
            Answerer::UnixDatagram => {
                Box::new(Datagrams::open(folder, SocketEnd::Controller, blocks)?)
            }
            #[cfg(feature = "zeromq")]
            Answerer::ZeroMq => {
                Box::new(super::zeromq::ZeroMq::open(folder, SocketEnd::Controller, blocks)?)
            }
        })
    }

    /// Starts who answers.
    fn start(&self, site: &DaemonSite, extent: &Extent) -> Result<Process, BenchError> {
        let kind = match &self.answerer {
            Answerer::Daemon(pipelines, _) => {
                let lines = match self.candidates {
                    0 => String::new(),
                    count => put_candidates(site, TRAIN, count)?,
                };
                let threads = self.threads(pipelines, extent.cores);
                return DaemonPlan { trains: extent.trains, threads, lines }.start(site);
            }
            Answerer::Floor => "echo",
            Answerer::UnixDatagram => "unix-datagram",
            #[cfg(feature = "zeromq")]
            Answerer::ZeroMq => "zeromq",
        };
        let (folder, core) = (site.path().to_string_lossy(), extent.cores.server.to_string());
        let priority = extent.cores.priority.map(|priority| priority.to_string());
        let mut arguments: Vec<&str> = vec![&folder, "--core", &core];
        arguments.extend(priority.iter().flat_map(|priority| ["--priority", priority]));
        arguments.extend((self.idle == IdleStrategy::Event).then_some("--blocks"));
        peer(site, kind, &arguments)
    }

    /// Fast pipelines share a thread on the daemon's core; slow ones share another one.
    fn threads(&self, pipelines: &[PipelineKind], cores: Cores) -> Vec<ThreadPlan> {
        let slow_kinds = slow_pipelines();
        let (slow, fast): (Vec<_>, Vec<_>) =
            pipelines.iter().partition(|kind| slow_kinds.contains(kind));
        let thread = |name, core, priority, pipelines: Vec<PipelineKind>| {
            (!pipelines.is_empty()).then_some(ThreadPlan {
                name,
                core,
                idle: self.idle,
                priority,
                pipelines,
            })
        };
        [thread(FAST, Some(cores.server), cores.priority, fast), thread("slow", None, None, slow)]
            .into_iter()
            .flatten()
            .collect()
    }
}
