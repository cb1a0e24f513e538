//! Reports about viewers that do not keep up.
//!
//! The protocol's library drops the oldest messages of a viewer whose queue is full, and says so in
//! its log, at most every 30 s; it counts none.

use std::fmt::{Debug, Write};

use dynocar::output::report_line;
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::layer::{Context, Layer, SubscriberExt};
use tracing_subscriber::registry;
use tracing_subscriber::util::SubscriberInitExt;

/// How the library's sentence about a full queue begins.
const FULL_QUEUE: &str = "outbox for client ";
/// How its sentences about a viewer that broke off begin.
const BROKEN_OFF: [&str; 2] = ["Error receiving from client ", "Error sending message to client "];

/// Reports from now on what the protocol's library has to say of viewers.
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
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
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
