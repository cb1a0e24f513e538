//! Channels that are advertised while somebody writes them, and the messages on them.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use dynocar::output::report_line;
use dynocar_client::ChannelError;
use dynocar_recording::codec::{encode_event, encode_sample, encode_snapshot};
use dynocar_recording::event::{Event, EventKind};
use dynocar_recording::schema::DESCRIPTORS;
use dynocar_recording::topic::{ENCODING, LAYOUT, Topic};
use dynocar_recording::train_channels::Sink;
use dynocar_recording::writing::WallClock;
use dynocar_shared::{ParameterSnapshot, TrainId, TrainSample};
use foxglove::websocket::{ChannelView, Client, ServerListener};
use foxglove::{ChannelId, Context, PartialMetadata, RawChannel, Schema};

use crate::thinning::Thinning;

/// Why nothing more can be served.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    /// A channel of shared memory cannot be opened.
    #[error(transparent)]
    Channel(#[from] ChannelError),
    /// The system gives no means to wait for viewers.
    #[error("no means to wait for viewers: {0}")]
    System(#[source] std::io::Error),
    /// The address cannot be served.
    #[error("ws://{address}: cannot be served: {problem}; --port and --host name another address")]
    Address {
        /// The address.
        address: String,
        /// What the system said.
        problem: String,
    },
    /// The protocol's library refuses a channel.
    #[error("{topic}: cannot be served: {problem}")]
    Topic {
        /// The channel.
        topic: String,
        /// What it said.
        problem: String,
    },
}

/// What is written: by whom, and what.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Key {
    /// By the controller of a train.
    Samples(u64),
    /// By a daemon of a train: pipeline's number and kind.
    Snapshots(u64, u32, u32),
    /// By ourselves.
    Events,
}

/// The newest snapshot of a channel, for viewers that come later.
struct Newest {
    channel: Arc<RawChannel>,
    message: Vec<u8>,
    log_time: u64,
}

type Snapshots = Arc<Mutex<HashMap<ChannelId, Newest>>>;

/// What goes to viewers.
pub struct Viewers {
    context: Arc<Context>,
    channels: HashMap<Key, Arc<RawChannel>>,
    newest: Snapshots,
    samples_hz: u32,
    thinnings: HashMap<u64, Thinning>,
    clock: WallClock,
    message: Vec<u8>,
}

impl Viewers {
    /// Viewers that get so many samples a second; all, when it is 0.
    ///
    /// # Errors
    ///
    /// When the channel of events is refused.
    pub fn new(samples_hz: u32) -> Result<Self, LiveError> {
        let mut viewers = Viewers {
            context: Context::new(),
            channels: HashMap::new(),
            newest: Snapshots::default(),
            samples_hz,
            thinnings: HashMap::new(),
            clock: WallClock::now(),
            message: Vec::with_capacity(2048),
        };
        viewers.channel(Key::Events, Topic::of_events)?;
        Ok(viewers)
    }

    /// Where a server takes its channels from.
    pub fn context(&self) -> &Arc<Context> {
        &self.context
    }

    /// What a server reports of viewers that come, subscribe and go.
    pub fn listener(&self) -> Arc<dyn ServerListener> {
        Arc::new(Listener { newest: Arc::clone(&self.newest), count: Mutex::new(0) })
    }

    /// Compares the monotonic clock with wall time again.
    pub fn set_clock(&mut self) {
        self.clock = WallClock::now();
    }

    fn channel(
        &mut self,
        key: Key,
        topic: impl FnOnce() -> Topic,
    ) -> Result<Arc<RawChannel>, LiveError> {
        if let Some(known) = self.channels.get(&key) {
            return Ok(Arc::clone(known));
        }
        let topic = topic();
        let channel = self
            .context
            .channel_builder(topic.name.as_str())
            .message_encoding(ENCODING)
            .schema(Schema::new(topic.schema, ENCODING, DESCRIPTORS.as_slice()))
            .add_metadata(LAYOUT, topic.layout)
            .build_raw()
            .map_err(|error| LiveError::Topic { topic: topic.name, problem: error.to_string() })?;
        self.channels.insert(key, Arc::clone(&channel));
        Ok(channel)
    }

    /// Withdraws the channels that one wrote who is gone.
    fn close(&mut self, is_gone: impl Fn(&Key) -> bool) {
        for (_, channel) in self.channels.extract_if(|key, _| is_gone(key)) {
            locked(&self.newest).remove(&channel.id());
            channel.close();
        }
    }

    fn at(&self, monotonic_ns: i64) -> PartialMetadata {
        PartialMetadata::with_log_time(self.clock.wall_ns(monotonic_ns))
    }
}

/// What a thread that failed left is whole: nothing is written in steps.
fn locked<T>(of: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Sink for Viewers {
    type Error = LiveError;

    fn sample(&mut self, sample: &TrainSample) -> Result<(), LiveError> {
        let train = sample.train_id;
        let new = || Thinning::to(self.samples_hz);
        let thinning = self.thinnings.entry(train).or_insert_with(new);
        if !thinning.lets_through(sample.published_ns) {
            return Ok(());
        }
        let channel = self.channel(Key::Samples(train), || Topic::of_samples(TrainId(train)))?;
        self.message.clear();
        encode_sample(sample, &mut self.message);
        channel.log_with_meta(&self.message, self.at(sample.published_ns));
        Ok(())
    }

    fn snapshot(&mut self, snapshot: &ParameterSnapshot) -> Result<(), LiveError> {
        let (train, index) = (snapshot.train_id, snapshot.pipeline_index);
        let key = Key::Snapshots(train, index, snapshot.pipeline_kind);
        let topic = || Topic::of_snapshots(TrainId(train), index, snapshot.pipeline_kind());
        let channel = self.channel(key, topic)?;
        let mut message = Vec::with_capacity(2048);
        encode_snapshot(snapshot, &mut message);
        let log_time = self.clock.wall_ns(snapshot.published_ns);
        // Who subscribes meanwhile gets this one once, and none that is older after it.
        let mut newest = locked(&self.newest);
        channel.log_with_meta(&message, PartialMetadata::with_log_time(log_time));
        newest.insert(channel.id(), Newest { channel, message, log_time });
        Ok(())
    }

    fn event(&mut self, event: &Event) -> Result<(), LiveError> {
        let train = event.train_id;
        let channel = self.channel(Key::Events, Topic::of_events)?;
        self.message.clear();
        encode_event(event, &mut self.message);
        channel.log_with_meta(&self.message, self.at(event.monotonic_ns));
        match event.kind() {
            EventKind::ControllerGone => self.close(|key| *key == Key::Samples(train)),
            EventKind::DaemonGone => {
                self.close(|key| matches!(key, Key::Snapshots(of, _, _) if *of == train));
            }
            _ => {}
        }
        Ok(())
    }
}

/// Viewers that come, subscribe and go.
struct Listener {
    newest: Snapshots,
    count: Mutex<usize>,
}

impl ServerListener for Listener {
    /// A pipeline says nothing new while its train stands: the newest that it said is handed on.
    fn on_subscribe(&self, client: Client, channel: ChannelView<'_>) {
        if let Some(newest) = locked(&self.newest).get(&channel.id()) {
            let log_time = PartialMetadata::with_log_time(newest.log_time);
            let viewer = client.sink_id();
            newest.channel.log_with_meta_to_sink(&newest.message, log_time, viewer);
        }
    }

    fn on_client_connect(&self) {
        let mut count = locked(&self.count);
        *count += 1;
        report_line(&format!("a viewer has come: {count} now"));
    }

    fn on_client_disconnect(&self) {
        let mut count = locked(&self.count);
        *count = count.saturating_sub(1);
        report_line(&format!("a viewer has gone: {count} now"));
    }
}
