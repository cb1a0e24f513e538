//! Models on trial in the shadow of the one in force, and the change from one to another.
//!
//! A thread of its own takes the samples of the trains once more, next to the pipeline threads, and lets the model in
//! force and its rivals predict them ([`dynocar_core::trial`]). Rivals are candidates of the store
//! ([`crate::models`]), the model that was in force before, and the one that was last taken out of force by a rollback
//! to the model before it. Each rival has its own pipelines and residual monitor, whose snapshots nobody else sees.
//! When the store's decisions put another model in force, its pipelines, warm by then, change places with those at
//! work while the train stands ([`crate::runtime::exchange`]). The pipeline threads and the controller never wait for
//! any of this. [`start`] starts the thread.
//!
//! # Layout
//!
//! - [`in_force`]: which model a train has when the daemon starts
//! - [`rule`]: which models are on trial, when a rule adopts or takes back, and which bounds no model may leave
//! - [`train`]: one train's trials, and its change of models
//! - [`record`]: measurements of the trials: a file that outlives the daemon, and figures for the metrics

pub mod in_force;
pub mod record;
pub mod rule;
pub mod train;

pub use record::{Board, Pinned, TrialFigures};
pub use train::ShadowTrain;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use dynocar_shared::{TrainId, TrainSample};
use dynocar_transport::channel::{Receiver, Transport};
use dynocar_transport::{ChannelError, Host};
use tracing::{info, warn};

use crate::config::ModelsConfig;
use crate::runtime::system::{pin_to_core, stand_back};

/// Time for which the thread sleeps while samples gather; a channel holds more than come meanwhile.
const NAP: Duration = Duration::from_millis(20);
/// Time between two checks of the store.
const LOOK: Duration = Duration::from_secs(1);
/// A train without a sample for this time is not driven.
const SILENCE: Duration = Duration::from_secs(2);

struct TrainChannel {
    train: ShadowTrain,
    receiver: Receiver<TrainSample>,
    heard: Instant,
}

/// Starts the thread.
///
/// # Errors
///
/// When the system gives no thread.
pub fn start(
    trains: Vec<ShadowTrain>,
    settings: ModelsConfig,
    host: Host,
    board: Board,
    stop: Arc<AtomicBool>,
) -> std::io::Result<JoinHandle<()>> {
    let work = move || {
        stand_back();
        if let Some(core) = settings.core
            && let Err(error) = pin_to_core(core)
        {
            warn!(core, "the thread of models on trial is not bound to its core: {error}");
        }
        match open(&host, trains) {
            Ok(mut channels) => run(&mut channels, &settings, &board, &stop),
            Err(error) => warn!("no models are on trial: {error}"),
        }
    };
    std::thread::Builder::new().name("shadow".into()).spawn(work)
}

fn open(host: &Host, trains: Vec<ShadowTrain>) -> Result<Vec<TrainChannel>, ChannelError> {
    let transport = Transport::open(host, "dynocar-shadow")?;
    let channel = |train: ShadowTrain| {
        let receiver = transport.receiver::<TrainSample>(TrainId(train.id()))?;
        Ok(TrainChannel { train, receiver, heard: Instant::now() })
    };
    trains.into_iter().map(channel).collect()
}

fn run(channels: &mut [TrainChannel], settings: &ModelsConfig, board: &Board, stop: &AtomicBool) {
    let every = Duration::from_secs(settings.interval_s);
    let (mut looked, mut written) = (None::<Instant>, Instant::now());
    info!(store = %settings.directory.display(), "models are tried");
    while !stop.load(Ordering::Relaxed) {
        let is_time_to_look = looked.is_none_or(|at| at.elapsed() >= LOOK);
        let is_time_to_write = written.elapsed() >= every;
        for channel in channels.iter_mut() {
            channel.hear();
            if is_time_to_look {
                channel.train.look(SystemTime::now());
                board.pin(channel.train.id(), channel.train.figures(), channel.train.events());
            }
            channel.train.go_on();
            if is_time_to_write {
                channel.train.write(SystemTime::now());
            }
        }
        if is_time_to_look {
            looked = Some(Instant::now());
        }
        if is_time_to_write {
            written = Instant::now();
        }
        std::thread::sleep(NAP);
    }
    for channel in channels {
        channel.train.write(SystemTime::now());
    }
}

impl TrainChannel {
    fn hear(&mut self) {
        let since = SystemTime::now().duration_since(UNIX_EPOCH);
        let unix_s = since.map_or(0.0, |since| since.as_secs_f64());
        while let Some(sample) = self.receiver.receive() {
            self.train.take(&sample, unix_s);
            self.heard = Instant::now();
        }
        if self.heard.elapsed() >= SILENCE {
            self.train.note_silence();
        }
    }
}
