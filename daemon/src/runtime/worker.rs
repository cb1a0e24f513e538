//! A pipeline thread, from sample to snapshot, and its idle strategies.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use dynocar_core::pipeline::Pipeline;
use dynocar_core::pipeline::motion::STANDING_MPS;
use dynocar_shared::{ParameterSnapshot, SampleField, TrainId, TrainSample};
use dynocar_transport::channel::{Receiver, SampleCount, Sender, Sleeper, Transport};
use dynocar_transport::{ChannelError, Host, monotonic_now_ns};

use super::exchange::Exchange;
use super::tally::{LogDetails, Tally};
use crate::config::{IdleStrategy, ThreadConfig};

/// Number of polls between two readings of the clock while a thread finds no sample. Reading the clock takes as long
/// as a poll, and a sample that arrives during the reading has to wait.
const LOOKS_PER_CLOCK: usize = 16;

/// Samples that one train may take in a row before the thread's other trains have their turn.
const TURN: usize = 64;

/// All that a worker needs to start; the main thread makes it and hands it to the worker's thread.
pub struct WorkerPlan {
    /// Name, core and idle strategy.
    pub thread: ThreadConfig,
    /// The run-time directory.
    pub host: Host,
    /// Start of the daemon.
    pub epoch: u64,
    /// See [`crate::config::ProcessConfig::spin_us`].
    pub spin_us: u64,
    /// See [`crate::config::ProcessConfig::heartbeat_ms`].
    pub heartbeat_ms: u64,
    /// The thread's pipelines by train.
    pub channels: Vec<ChannelPlan>,
    /// Set when the daemon is to stop.
    pub stop: Arc<AtomicBool>,
}

/// One train of a worker, with its pipelines.
pub struct ChannelPlan {
    /// The train.
    pub train: TrainId,
    /// How far the train's samples have been counted.
    pub count: Arc<SampleCount>,
    /// The thread's number among those that serve the train.
    pub index: usize,
    /// The pipelines, each with the words that its thread writes and the main thread reads.
    pub pipelines: Vec<(Pipeline, PipelineReport)>,
    /// By which pipelines of another model come, when any may come; the thread's seat is its place.
    pub exchange: Option<Arc<Exchange>>,
}

/// Words of one pipeline that its thread writes and the main thread reads; neither waits.
#[derive(Clone, Debug, Default)]
pub struct PipelineReport {
    /// Signs of life and counts.
    pub tally: Arc<Tally>,
    /// Details for the log.
    pub details: Arc<LogDetails>,
}

struct Slot {
    pipeline: Pipeline,
    sender: Sender<ParameterSnapshot>,
    report: PipelineReport,
    last_vouched_ns: i64,
}

struct TrainChannel {
    receiver: Receiver<TrainSample>,
    count: Arc<SampleCount>,
    index: usize,
    /// A sample taken while falling asleep, to be processed before the channel's next.
    found: Option<TrainSample>,
    slots: Vec<Slot>,
    exchange: Option<Arc<Exchange>>,
    /// Number of the newest sample.
    newest: u64,
    /// Speed in it; nobody drives the train before the first.
    newest_speed_mps: f64,
}

/// A pipeline thread at work; lives in its own thread, for the ports cannot move.
pub struct Worker {
    channels: Vec<TrainChannel>,
    idler: Idler,
    epoch: u64,
    heartbeat_ns: i64,
    last_heartbeat_ns: i64,
    stop: Arc<AtomicBool>,
}

impl Worker {
    /// Opens the ports and publishes each pipeline's first snapshot, so that a waiting client
    /// learns of the new epoch at once.
    ///
    /// # Errors
    ///
    /// When a channel cannot be opened.
    pub fn start(plan: WorkerPlan) -> Result<Self, ChannelError> {
        let transport = Transport::open(&plan.host, "dynocar-daemon")?;
        let trains: Vec<TrainId> = plan.channels.iter().map(|channel| channel.train).collect();
        let sleeper = match plan.thread.idle {
            IdleStrategy::Busy => None,
            _ => Some(Sleeper::open(&transport, &trains, plan.epoch)?),
        };
        let channels = plan
            .channels
            .into_iter()
            .map(|channel| open_channel_of(&transport, channel, plan.epoch))
            .collect::<Result<Vec<_>, _>>()?;
        transport.reserve()?;
        let idler = Idler::new(plan.thread.idle, plan.spin_us, plan.heartbeat_ms, sleeper);
        Ok(Worker {
            channels,
            idler,
            epoch: plan.epoch,
            heartbeat_ns: plan.heartbeat_ms as i64 * 1_000_000,
            last_heartbeat_ns: 0,
            stop: plan.stop,
        })
    }

    /// Works until the daemon stops.
    ///
    /// # Real-time
    ///
    /// Allocates nothing, locks nothing, logs nothing; sleeps only in the idler.
    pub fn run(&mut self) {
        while !self.stop.load(Ordering::Relaxed) {
            let processed = self.look_for_samples();
            let now_ns = monotonic_now_ns();
            if now_ns - self.last_heartbeat_ns >= self.heartbeat_ns {
                self.heartbeat(now_ns);
            }
            if processed {
                self.idler.had_work(now_ns);
            } else {
                let channels = &mut self.channels;
                self.idler.pause(now_ns, || look_once_more(channels));
            }
        }
    }

    /// Looks several times; true when there was a sample.
    fn look_for_samples(&mut self) -> bool {
        (0..LOOKS_PER_CLOCK).any(|_| {
            let processed = self.take_turns();
            if !processed {
                std::hint::spin_loop();
            }
            processed
        })
    }

    /// One turn for every train; true when there was a sample.
    fn take_turns(&mut self) -> bool {
        let mut processed = false;
        for channel in &mut self.channels {
            for _ in 0..TURN {
                let Some(sample) = channel.next() else { break };
                for slot in &mut channel.slots {
                    slot.process(&sample, self.epoch);
                }
                channel.count.note_taken(channel.index, sample.sequence);
                (channel.newest, channel.newest_speed_mps) = (sample.sequence, sample.speed_mps);
                processed = true;
            }
        }
        processed
    }

    /// Vouches for snapshots of which nothing was heard lately, and serves who has come since.
    fn heartbeat(&mut self, now_ns: i64) {
        self.last_heartbeat_ns = now_ns;
        self.idler.serve_newcomers();
        for channel in &mut self.channels {
            channel.count_leftovers(self.epoch, now_ns);
            channel.change_models(self.epoch, now_ns);
        }
        for slot in self.channels.iter_mut().flat_map(|channel| &mut channel.slots) {
            if now_ns - slot.last_vouched_ns >= self.heartbeat_ns {
                slot.vouch(now_ns);
            } else {
                slot.sender.serve_newcomers();
            }
        }
    }
}

impl TrainChannel {
    fn next(&mut self) -> Option<TrainSample> {
        self.found.take().or_else(|| self.receiver.receive())
    }

    /// When nobody drives the train any more, counts as lost the samples that the last controller published and no port
    /// kept.
    fn count_leftovers(&mut self, epoch: u64, now_ns: i64) {
        // Before the poll for samples: samples that are on their way then come first.
        let Some(ended) = self.count.ended() else { return };
        self.found = self.next();
        if self.found.is_some() {
            return;
        }
        for slot in &mut self.slots {
            if slot.pipeline.count_up_to(ended) {
                slot.publish(epoch, now_ns);
            }
        }
        self.count.note_taken(self.index, ended);
        self.newest_speed_mps = 0.0;
    }

    /// Puts the pipelines of another model to work, if any came and the train stands.
    fn change_models(&mut self, epoch: u64, now_ns: i64) {
        let Some(exchange) = &self.exchange else { return };
        // NaN speed: do not swap models.
        let stands = self.newest_speed_mps.abs() <= STANDING_MPS;
        let Some(mut set) = exchange.take(self.index, self.newest, stands) else { return };
        for (slot, new) in self.slots.iter_mut().zip(&mut set) {
            new.take_over(&mut slot.pipeline);
            std::mem::swap(new, &mut slot.pipeline);
            slot.pipeline.snapshot_mut().sequence += 1;
            slot.publish(epoch, now_ns);
        }
        exchange.give_back(self.index, set);
    }
}

impl Slot {
    fn process(&mut self, sample: &TrainSample, epoch: u64) {
        self.pipeline.process(sample);
        self.report.details.note_position(sample.get(SampleField::Position).unwrap_or(f64::NAN));
        let now_ns = monotonic_now_ns();
        self.publish(epoch, now_ns);
    }

    fn publish(&mut self, epoch: u64, now_ns: i64) {
        let snapshot = self.pipeline.snapshot_mut();
        snapshot.epoch = epoch;
        snapshot.published_ns = now_ns;
        self.vouch(now_ns);
    }

    /// Sends the newest snapshot, be it for the first time or again.
    fn vouch(&mut self, now_ns: i64) {
        let snapshot = self.pipeline.snapshot_mut();
        snapshot.vouched_ns = now_ns;
        self.last_vouched_ns = now_ns;
        if self.sender.send(snapshot).is_err() {
            self.report.tally.note_unsent();
        }
        self.report.details.note_implausible(self.pipeline.implausible());
        self.report.tally.note_beat();
    }
}

fn open_channel_of(
    transport: &Transport,
    plan: ChannelPlan,
    epoch: u64,
) -> Result<TrainChannel, ChannelError> {
    // Before the first snapshot: who reads that may publish at once, and loses nothing.
    let receiver = transport.receiver::<TrainSample>(plan.train)?;
    // After the port is open: every sample published from now on can be received, and is counted.
    let counted_from = plan.count.sent();
    plan.count.note_taken(plan.index, counted_from);
    let slots = plan
        .pipelines
        .into_iter()
        .map(|(mut pipeline, report)| {
            pipeline.count_from(counted_from);
            let sender = transport.sender::<ParameterSnapshot>(plan.train)?;
            let mut slot = Slot { pipeline, sender, report, last_vouched_ns: 0 };
            slot.publish(epoch, monotonic_now_ns());
            Ok(slot)
        })
        .collect::<Result<_, ChannelError>>()?;
    Ok(TrainChannel {
        receiver,
        count: plan.count,
        index: plan.index,
        found: None,
        slots,
        exchange: plan.exchange,
        newest: counted_from,
        newest_speed_mps: 0.0,
    })
}

/// Returns whether a sample came while the controllers were informed of the sleep; keeps it.
fn look_once_more(channels: &mut [TrainChannel]) -> bool {
    let mut any = false;
    for channel in channels {
        channel.found = channel.next();
        any |= channel.found.is_some();
    }
    any
}

/// Decides, between two polls for samples, whether to poll again at once or to sleep.
pub struct Idler {
    spin_ns: i64,
    last_work_ns: i64,
    /// `None` for a thread that never sleeps.
    sleeper: Option<Sleeper>,
    sleep_max: Duration,
}

impl Idler {
    /// Returns an idler; `sleeper` puts the thread to sleep, unless it never sleeps.
    pub fn new(
        strategy: IdleStrategy,
        spin_us: u64,
        heartbeat_ms: u64,
        sleeper: Option<Sleeper>,
    ) -> Self {
        let spin_us = match strategy {
            IdleStrategy::Busy => u64::MAX,
            IdleStrategy::Adaptive => spin_us,
            IdleStrategy::Event => 0,
        };
        Idler {
            spin_ns: i64::try_from(spin_us.saturating_mul(1_000)).unwrap_or(i64::MAX),
            last_work_ns: 0,
            sleeper: sleeper.filter(|_| strategy != IdleStrategy::Busy),
            sleep_max: Duration::from_millis(heartbeat_ms),
        }
    }

    /// Remembers that there was work at this time.
    pub fn had_work(&mut self, now_ns: i64) {
        self.last_work_ns = now_ns;
    }

    /// Returns at once or after a sleep; `has_work` is asked once more before falling asleep.
    pub fn pause(&mut self, now_ns: i64, has_work: impl FnOnce() -> bool) {
        match &mut self.sleeper {
            Some(sleeper) if now_ns.saturating_sub(self.last_work_ns) >= self.spin_ns => {
                sleeper.sleep(self.sleep_max, has_work);
            }
            _ => {}
        }
    }

    /// Speaks up to controllers that have come since.
    pub fn serve_newcomers(&self) {
        if let Some(sleeper) = &self.sleeper {
            sleeper.serve_newcomers();
        }
    }
}
