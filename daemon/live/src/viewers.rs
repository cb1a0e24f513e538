//! Channels that are advertised while somebody writes them, the messages on them, and reports about viewers that do not
//! keep up.
//!
//! The protocol's library drops the oldest messages of a viewer whose queue is full. It reports this in its log, at
//! most every 30 s, but counts no dropped message. Viewers get fewer samples than the channel carries: a picture needs
//! no thousand a second.

use std::collections::HashMap;
use std::fmt::{Debug, Write};
use std::sync::{Arc, Mutex, PoisonError};

use dynocar::output::report_line;
use dynocar_mcap::event::EventKind;
use dynocar_mcap::schema::DESCRIPTORS;
use dynocar_mcap::topic::{ENCODING, LAYOUT, Message, Topic};
use dynocar_mcap::writing::WallClock;
use dynocar_recording::train_channels::Sink;
use dynocar_transport::ChannelError;
use foxglove::websocket::{ChannelView, Client, ServerListener};
use foxglove::{ChannelId, Context, PartialMetadata, RawChannel, Schema};
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::layer::{self, Layer, SubscriberExt};
use tracing_subscriber::registry;
use tracing_subscriber::util::SubscriberInitExt;

/// Why nothing more can be served.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    /// A channel of shared memory cannot be opened.
    #[error(transparent)]
    Channel(#[from] ChannelError),
    /// The event loop that waits for viewers cannot start.
    #[error("cannot start the event loop: {0}")]
    System(#[source] std::io::Error),
    /// The address cannot be served.
    #[error("ws://{address}: cannot be served: {problem}; --port and --host name another address")]
    Address {
        /// The address.
        address: String,
        /// Message of the system.
        problem: String,
    },
    /// The protocol's library refuses a channel.
    #[error("{topic}: cannot be served: {problem}")]
    Topic {
        /// The channel.
        topic: String,
        /// Message of the system.
        problem: String,
    },
}

/// The newest snapshot of a channel, for viewers that come later.
struct Newest {
    channel: Arc<RawChannel>,
    message: Vec<u8>,
    log_time: u64,
}

type Snapshots = Arc<Mutex<HashMap<ChannelId, Newest>>>;

/// Messages for viewers.
pub struct Viewers {
    context: Arc<Context>,
    channels: HashMap<Topic, Arc<RawChannel>>,
    newest: Snapshots,
    samples_hz: u32,
    thinnings: HashMap<u64, Thinning>,
    clock: WallClock,
    message: Vec<u8>,
}

impl Viewers {
    /// Serves viewers with `samples_hz` samples a second; all, when it is 0.
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
        viewers.channel(Topic::Events)?;
        Ok(viewers)
    }

    /// Returns where a server takes its channels from.
    pub fn context(&self) -> &Arc<Context> {
        &self.context
    }

    /// Returns the listener that reports viewers that come, subscribe and go.
    pub fn listener(&self) -> Arc<dyn ServerListener> {
        Arc::new(Listener { newest: Arc::clone(&self.newest), count: Mutex::new(0) })
    }

    /// Compares the monotonic clock with wall time again.
    pub fn set_clock(&mut self) {
        self.clock = WallClock::now();
    }

    fn channel(&mut self, topic: Topic) -> Result<Arc<RawChannel>, LiveError> {
        if let Some(known) = self.channels.get(&topic) {
            return Ok(Arc::clone(known));
        }
        let (name, (schema, layout)) = (topic.name(), topic.schema_and_layout());
        let channel = self
            .context
            .channel_builder(name.as_str())
            .message_encoding(ENCODING)
            .schema(Schema::new(schema, ENCODING, DESCRIPTORS.as_slice()))
            .add_metadata(LAYOUT, layout)
            .build_raw()
            .map_err(|error| LiveError::Topic { topic: name, problem: error.to_string() })?;
        self.channels.insert(topic, Arc::clone(&channel));
        Ok(channel)
    }

    /// Withdraws the channels that one wrote who is gone.
    fn close(&mut self, is_gone: impl Fn(&Topic) -> bool) {
        for (_, channel) in self.channels.extract_if(|key, _| is_gone(key)) {
            locked(&self.newest).remove(&channel.id());
            channel.close();
        }
    }
}

/// Locks a mutex, also after a panic of another thread: the data are never written in steps.
fn locked<T>(of: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Sink for Viewers {
    type Error = LiveError;

    fn take(&mut self, message: Message<'_>) -> Result<(), LiveError> {
        if let Message::Sample(it) = message {
            let new = || Thinning::to(self.samples_hz);
            let thinning = self.thinnings.entry(it.train_id).or_insert_with(new);
            if !thinning.lets_through(it.published_ns) {
                return Ok(());
            }
        }
        let channel = self.channel(message.topic())?;
        self.message.clear();
        message.encode(&mut self.message);
        let log_time = self.clock.wall_ns(message.number_and_time_ns().1);
        let logged = PartialMetadata::with_log_time(log_time);
        if !matches!(message, Message::Snapshot(_)) {
            channel.log_with_meta(&self.message, logged);
        } else {
            // Who subscribes meanwhile gets this one once, and none that is older after it.
            let mut newest = locked(&self.newest);
            channel.log_with_meta(&self.message, logged);
            let message = self.message.clone();
            newest.insert(channel.id(), Newest { channel, message, log_time });
        }
        if let Message::Event(event) = message {
            let train = event.train_id;
            match event.kind() {
                EventKind::ControllerGone => self.close(|it| *it == Topic::Samples(train)),
                EventKind::DaemonGone => {
                    self.close(|it| matches!(it, Topic::Snapshots(of, _, _) if *of == train));
                }
                _ => {}
            }
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

/// Passes on a given number of samples per second, evenly spaced, of those that come faster.
#[derive(Clone, Copy, Debug)]
pub struct Thinning {
    interval_ns: i64,
    due_ns: i64,
}

impl Thinning {
    /// Lets `per_second` samples a second through; all, when it is 0.
    pub fn to(per_second: u32) -> Self {
        let interval_ns = 1_000_000_000_i64.checked_div(i64::from(per_second)).unwrap_or(0);
        Thinning { interval_ns, due_ns: i64::MIN }
    }

    /// Returns whether a sample that came at this moment is to be passed on.
    pub fn lets_through(&mut self, at_ns: i64) -> bool {
        if at_ns < self.due_ns && self.due_ns.saturating_sub(at_ns) <= self.interval_ns {
            return false;
        }
        // After a gap, or where the clock was set back, the count begins anew.
        let is_even = (0..self.interval_ns).contains(&at_ns.saturating_sub(self.due_ns));
        self.due_ns = if is_even { self.due_ns } else { at_ns }.saturating_add(self.interval_ns);
        true
    }
}

/// How the library's sentence about a full queue begins.
const FULL_QUEUE: &str = "outbox for client ";
/// How its sentences about a viewer that broke off begin.
const BROKEN_OFF: [&str; 2] = ["Error receiving from client ", "Error sending message to client "];

/// Reports from now on the messages of the protocol's library about viewers.
pub fn report_viewers() {
    // Only a second call fails.
    let _ = registry().with(Reporter).try_init();
}

struct Reporter;

/// The sentence of an event.
#[derive(Default)]
struct Sentence(String);

impl Visit for Sentence {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        if field.name() == "message" {
            // Writing into a String cannot fail.
            let _ = write!(self.0, "{value:?}");
        }
    }
}

impl<S: Subscriber> Layer<S> for Reporter {
    fn on_event(&self, event: &Event<'_>, _: layer::Context<'_, S>) {
        let metadata = event.metadata();
        if !metadata.target().starts_with("foxglove") || *metadata.level() > Level::INFO {
            return;
        }
        let mut sentence = Sentence::default();
        event.record(&mut sentence);
        if let Some(words) = words(*metadata.level(), &sentence.0) {
            report_line(&words);
        }
    }
}

fn words(level: Level, sentence: &str) -> Option<String> {
    if let Some(rest) = sentence.strip_prefix(FULL_QUEUE) {
        let address = rest.split(' ').next().unwrap_or(rest);
        return Some(format!(
            "the viewer at {address} does not keep up: its oldest messages are dropped"
        ));
    }
    if let Some(address) = sentence.strip_prefix("Dropping client ")
        && let Some(address) = address.strip_suffix(": handshake failed")
    {
        return Some(format!(
            "the viewer at {address} is refused: it does not offer foxglove.sdk.v1"
        ));
    }
    // That it has gone is reported elsewhere.
    let is_known = BROKEN_OFF.iter().any(|it| sentence.starts_with(it));
    let is_reported = level <= Level::WARN && !is_known;
    is_reported.then(|| format!("viewers: {sentence}"))
}
