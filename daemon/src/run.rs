//! The daemon: every stage of the live path on one screen.
//!
//! ```text
//! controller ──TrainSample──▶ validation ─▶ track and forces ─▶ estimator ──ParameterSnapshot──▶ client
//!             shared memory   └───────────── Pipeline, one or more in a Worker ─────┘  shared memory
//! ```

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use dynocar_shared::{Quantity, TrainId};
use dynocar_transport::channel::SampleCount;
use dynocar_transport::peer::RoleLock;
use dynocar_transport::{ChannelError, Host, Role, monotonic_now_ns};
use tracing::{info, warn};

use super::runtime::system::{
    STACK_BYTES, lock_all_memory, pin_to_core, prefault_stack, raise_open_files, set_fifo_priority,
};
use crate::config::{
    DaemonConfig, IdleStrategy, ModelsConfig, RootError, SettingRefused, ThreadConfig,
    build_pipeline,
};
use crate::ending::{self, EndingError};
use crate::models::Store;
use crate::observing::ObservedTrain;
use crate::runtime::exchange::Exchange;
use crate::runtime::main_thread::{RuntimeWatch, WatchedPipeline};
use crate::runtime::worker::{ChannelPlan, PipelineReport, Worker, WorkerPlan};
use crate::shadow::train::PlacedPipeline;
use crate::shadow::{self, Board, ShadowTrain};
use crate::stamp::Stamp;
use crate::state;
use crate::state::keeper::StateKeeper;
use crate::supervision::listener;
use crate::supervision::notify::{Supervisor, Watchdog};

/// Why the daemon could not start or had to stop.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The run-time directory cannot be used.
    #[error(transparent)]
    Root(#[from] RootError),
    /// A channel cannot be opened.
    #[error(transparent)]
    Channel(#[from] ChannelError),
    /// A setting of a pipeline is out of range.
    #[error(transparent)]
    Setting(#[from] SettingRefused),
    /// The daemon could not learn when to end.
    #[error(transparent)]
    Ending(#[from] EndingError),
    /// The system gives no thread.
    #[error("{what}: {source}")]
    System {
        /// Requested service.
        what: &'static str,
        /// The system's answer.
        source: std::io::Error,
    },
    /// The system gives no address to listen at.
    #[error("metrics.listen = {address}: {source}")]
    Listen {
        /// The address of the configuration.
        address: SocketAddr,
        /// The system's answer.
        source: std::io::Error,
    },
    /// A pipeline thread ended by itself.
    #[error("thread {0}: ended unexpectedly; the daemon stops so that a supervisor can restart it")]
    ThreadEnded(String),
}

/// Serves the configured trains until it is to end ([`ending`]).
///
/// # Errors
///
/// See [`RunError`]; a second daemon on a train is refused with the name of the first.
pub fn run(config: &DaemonConfig) -> Result<(), RunError> {
    let mut config = config.clone();
    shadow::in_force::settle(&mut config);
    let config = &config;
    let host = config.process.host()?;
    let stop = ending::flag()?;
    let trains: Vec<TrainId> = config.trains.iter().map(|train| train.id).collect();
    let roles = trains
        .iter()
        .map(|&train| RoleLock::claim(&host, train, Role::Daemon))
        .collect::<Result<Vec<_>, _>>()?;
    let counts = trains
        .iter()
        .map(|&train| SampleCount::open(&host, train).map(Arc::new))
        .collect::<Result<Vec<_>, _>>()?;
    raise_open_files();
    // Grows with every start: the monotonic clock is common to all processes of the host.
    let epoch = monotonic_now_ns() as u64;
    if config.process.lock_memory {
        lock_memory();
    }
    let state = state::Taken::up(config, &host);
    let (mut plans, watched) = plan_workers(config, &host, epoch, &stop, state.as_ref(), &counts)?;
    let board = Board::default();
    let shadow = plan_shadow(config, &mut plans);
    let workers = start_workers(plans)?;
    let shadow = shadow
        .map(|(trains, models)| {
            shadow::start(trains, models, host.clone(), board.clone(), Arc::clone(&stop))
        })
        .transpose()
        .map_err(|source| RunError::System { what: "thread of models on trial", source })?;
    let keeper = state.map(|state| start_keeper(config, &host, state, &stop)).transpose()?;
    report_who_answers(config);
    info!(epoch, trains = trains.len(), pipelines = config.pipelines.len(), "serving");

    let listener =
        config.metrics.map(|address| start_metrics(config, address, &host, board, &stop));
    let listener = listener.transpose()?;

    let supervisor = Supervisor::from_environment();
    let alive = watched.iter().map(|it| (it.name.clone(), Arc::clone(&it.report.tally))).collect();
    let watchdog = Watchdog::new(&supervisor, alive);
    supervisor.notify("READY=1");
    let trains = trains.into_iter().zip(counts).collect();
    let mut watch = RuntimeWatch::new(host.clone(), epoch, trains, watched);
    let mut lost_root = None;
    watch.until_stopped(&stop, || {
        watchdog.round(Instant::now());
        lost_root = roles.iter().find_map(|role| role.require_there(&host).err());
        lost_root.is_some() || workers.iter().any(JoinHandle::is_finished)
    });
    supervisor.notify("STOPPING=1");

    let ended = workers.iter().find(|worker| worker.is_finished()).map(thread_name);
    let was_asked = stop.swap(true, std::sync::atomic::Ordering::Relaxed);
    for worker in workers {
        // A panic was already printed by the thread itself; `ended` names it below.
        let _ = worker.join();
    }
    for helper in keeper.into_iter().chain(listener).chain(shadow) {
        let _ = helper.join();
    }
    watch.report_totals();
    match (lost_root, ended) {
        (Some(error), _) => Err(error.into()),
        (None, Some(name)) if !was_asked => Err(RunError::ThreadEnded(name)),
        _ => Ok(()),
    }
}

/// One line for each train: which pipeline answers which question.
fn report_who_answers(config: &DaemonConfig) {
    for train in &config.trains {
        let name = |it| {
            train.answers.pipeline_index(it).map_or("-", |index| &config.pipelines[index].name)
        };
        info!(
            train = train.id.0,
            resistance = name(Quantity::Resistance),
            mass = name(Quantity::Mass),
            adhesion = name(Quantity::Adhesion),
            brake_friction = name(Quantity::BrakeFriction),
            braking_ratio = name(Quantity::BrakingRatio),
            "answers"
        );
    }
}

/// Builds every pipeline and deals them out to the threads.
fn plan_workers(
    config: &DaemonConfig,
    host: &Host,
    epoch: u64,
    stop: &Arc<AtomicBool>,
    state: Option<&state::Taken<'_>>,
    counts: &[Arc<SampleCount>],
) -> Result<(Vec<WorkerPlan>, Vec<WatchedPipeline>), RunError> {
    let mut plans: Vec<WorkerPlan> = config
        .threads
        .iter()
        .map(|thread| WorkerPlan {
            thread: thread.clone(),
            host: host.clone(),
            epoch,
            spin_us: config.process.spin_us,
            heartbeat_ms: config.process.heartbeat_ms,
            channels: Vec::new(),
            stop: Arc::clone(stop),
        })
        .collect();
    let mut watched = Vec::new();
    for (index, settings) in config.pipelines.iter().enumerate() {
        for (train_index, train) in config.trains.iter().enumerate() {
            if !settings.trains.contains(&train.id) {
                continue;
            }
            let mut pipeline = build_pipeline(settings, index as u32, train)?;
            let kept = state.and_then(|it| {
                state::warm_start_of(it.config, &it.stored[train_index], settings, &Stamp::now())
            });
            if let Some(kept) = kept {
                pipeline.warm_start(&kept);
            }
            let report = PipelineReport::default();
            let name = settings.name.clone();
            let (index, watched_report) = (index as u32, report.clone());
            watched.push(WatchedPipeline { name, train: train.id, index, report: watched_report });
            let channels = &mut plans[settings.thread].channels;
            match channels.iter_mut().find(|channel| channel.train == train.id) {
                Some(channel) => channel.pipelines.push((pipeline, report)),
                None => {
                    let (count, pipelines) =
                        (Arc::clone(&counts[train_index]), vec![(pipeline, report)]);
                    let (train, index, exchange) = (train.id, 0, None);
                    channels.push(ChannelPlan { train, count, index, pipelines, exchange });
                }
            }
        }
    }
    for (train, count) in config.trains.iter().zip(counts) {
        number_channels(&mut plans, train.id, count);
    }
    Ok((plans, watched))
}

/// Returns the trains whose models are tried, each with a way to the threads that serve it.
fn plan_shadow(
    config: &DaemonConfig,
    plans: &mut [WorkerPlan],
) -> Option<(Vec<ShadowTrain>, ModelsConfig)> {
    let models = config.models.clone()?;
    let store = Store::at(&models.directory);
    let mut trains = Vec::new();
    for train in &config.trains {
        let channels = plans.iter_mut().flat_map(|plan| &mut plan.channels);
        let mut channels: Vec<&mut ChannelPlan> =
            channels.filter(|it| it.train == train.id).collect();
        channels.sort_by_key(|channel| channel.index);
        let exchange = Arc::new(Exchange::new(channels.len()));
        let mut placed = Vec::new();
        for channel in channels {
            channel.exchange = Some(Arc::clone(&exchange));
            let indices = channel.pipelines.iter().map(|(it, _)| it.snapshot().pipeline_index);
            placed.extend(indices.map(|index| PlacedPipeline {
                settings: config.pipelines[index as usize].clone(),
                index,
                seat: channel.index,
            }));
        }
        let own = store.train(train.id);
        trains.push(ShadowTrain::new(train.clone(), placed, own, models.clone(), exchange));
    }
    Some((trains, models))
}

/// Numbers the channels of a train, and informs its controllers how many threads and pipelines serve it.
fn number_channels(plans: &mut [WorkerPlan], train: TrainId, count: &SampleCount) {
    let (mut threads, mut pipelines) = (0, 0);
    for channel in
        plans.iter_mut().flat_map(|plan| &mut plan.channels).filter(|it| it.train == train)
    {
        channel.index = threads;
        threads += 1;
        pipelines += channel.pipelines.len();
    }
    count.serve(threads, pipelines);
}

/// Starts one thread for each plan and waits until all of them have their ports open.
fn start_workers(plans: Vec<WorkerPlan>) -> Result<Vec<JoinHandle<()>>, RunError> {
    let (report_start, started) = sync_channel(plans.len());
    let workers = plans
        .into_iter()
        .map(|plan| {
            let report_start = report_start.clone();
            std::thread::Builder::new()
                .name(plan.thread.name.clone())
                .stack_size(STACK_BYTES)
                .spawn(move || work(plan, report_start))
                .map_err(|source| RunError::System { what: "pipeline thread", source })
        })
        .collect::<Result<Vec<_>, _>>()?;
    drop(report_start);
    started.iter().collect::<Result<(), _>>()?;
    Ok(workers)
}

/// Starts the thread that hands out metrics.
fn start_metrics(
    config: &DaemonConfig,
    address: SocketAddr,
    host: &Host,
    board: Board,
    stop: &Arc<AtomicBool>,
) -> Result<JoinHandle<()>, RunError> {
    let failed = |what| move |source| RunError::System { what, source };
    let refused = |source| RunError::Listen { address, source };
    let socket = listener::open(address).map_err(refused)?;
    let trains: Vec<TrainId> = config.trains.iter().map(|train| train.id).collect();
    let names: Vec<String> = config.pipelines.iter().map(|it| it.name.clone()).collect();
    let (host, stop) = (host.clone(), Arc::clone(stop));
    let serve = move || {
        let observed: Result<Vec<_>, _> =
            trains.into_iter().map(|train| ObservedTrain::open(&host, train)).collect();
        match observed {
            Ok(mut trains) => listener::serve(&socket, &mut trains, &names, &board, &stop),
            Err(error) => warn!("no metrics: {error}"),
        }
    };
    std::thread::Builder::new()
        .name("metrics".into())
        .spawn(serve)
        .map_err(failed("metrics thread"))
}

/// Starts the thread that keeps validated estimates.
fn start_keeper(
    config: &DaemonConfig,
    host: &Host,
    state: state::Taken<'_>,
    stop: &Arc<AtomicBool>,
) -> Result<JoinHandle<()>, RunError> {
    let (config, stop, host) = (config.clone(), Arc::clone(stop), host.clone());
    let interval = Duration::from_secs(state.config.interval_s);
    let (directory, stored) = (state.directory, state.stored);
    std::thread::Builder::new()
        .name("state".into())
        .spawn(move || {
            match StateKeeper::new(&config, (directory, interval), &host, stored, stop) {
                Ok(mut keeper) => keeper.run(),
                Err(error) => warn!("no state is kept: {error}"),
            }
        })
        .map_err(|source| RunError::System { what: "state thread", source })
}

fn work(plan: WorkerPlan, report_start: SyncSender<Result<(), ChannelError>>) {
    prepare_thread(&plan.thread);
    match Worker::start(plan) {
        Ok(mut worker) => {
            // The main thread has given up when it no longer listens; the stop flag says so too.
            let _ = report_start.send(Ok(()));
            drop(report_start);
            worker.run();
        }
        Err(error) => {
            let _ = report_start.send(Err(error));
        }
    }
}

/// Gives the calling thread its configured core and priority; a refusal of the system is reported with its cost, and
/// the daemon goes on.
fn prepare_thread(thread: &ThreadConfig) {
    let name = thread.name.as_str();
    if let Some(core) = thread.core
        && let Err(error) = pin_to_core(core)
    {
        warn!(thread = name, core, "not bound to its core, latency will vary more: {error}");
    }
    if let Some(priority) = thread.priority {
        if let Err(error) = set_fifo_priority(priority) {
            warn!(
                thread = name,
                priority,
                "no real-time priority: {error}; it needs CAP_SYS_NICE or a real-time limit of at \
                 least {priority} (systemd: LimitRTPRIO={priority}). Any other program may hold \
                 this thread up for milliseconds"
            );
        } else if thread.idle == IdleStrategy::Busy && thread.core.is_none() {
            warn!(
                thread = name,
                "a busy thread of real-time priority takes a whole core from everyone else: bind \
                 it to a core of its own"
            );
        }
    }
    prefault_stack();
    info!(thread = name, core = thread.core, idle = %thread.idle, "pipeline thread");
}

fn lock_memory() {
    match lock_all_memory() {
        Ok(()) => info!("memory locked"),
        Err(error) => warn!(
            "memory not locked: {error}. A page that was put aside costs a thread microseconds, or \
             milliseconds from a disk"
        ),
    }
}

fn thread_name(worker: &JoinHandle<()>) -> String {
    worker.thread().name().unwrap_or("unnamed").to_owned()
}
