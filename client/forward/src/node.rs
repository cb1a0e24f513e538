//! The edge node: topics, births, deaths and sequence numbers of one connection, without any socket.
//!
//! Sparkplug specification 3.0.0, chapters 4 to 6: a node is born with number 0, each of its trains is born
//! as a device before any of its data, and each message carries the number after the one before.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use dynocar_shared::TrainId;
use prost::Message as _;

use crate::payload::{MetricValue, Payload, Value};
use crate::queue::{Counts, Publication, Queue};
use crate::train::Train;

/// The command that asks for all births anew.
pub const REBIRTH: &str = "Node Control/Rebirth";
/// The number that ties a node's birth to its death.
const BIRTH_NUMBER: &str = "bdSeq";
/// The first word of every topic.
const NAMESPACE: &str = "spBv1.0";

/// Group and name of the edge node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NodeName {
    /// The group.
    pub group: String,
    /// The node.
    pub node: String,
}

impl NodeName {
    /// The topic of the node's messages of a kind.
    pub fn topic(&self, kind: &str) -> String {
        format!("{NAMESPACE}/{}/{kind}/{}", self.group, self.node)
    }

    fn device_topic(&self, kind: &str, device: &str) -> String {
        format!("{}/{device}", self.topic(kind))
    }
}

/// What is published.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// Under which topic.
    pub topic: String,
    /// What.
    pub payload: Vec<u8>,
}

/// What reading and sending share.
#[derive(Debug)]
pub struct Known {
    /// The trains.
    pub trains: BTreeMap<TrainId, Train>,
    /// What is to be published.
    pub queue: Queue,
}

impl Known {
    /// Nothing, with a queue of so many publications.
    pub fn new(queue: usize) -> Self {
        Known { trains: BTreeMap::new(), queue: Queue::new(queue) }
    }

    /// Puts a publication into the queue; where another had to go for it, that one's train publishes everything next.
    pub fn publish(&mut self, publication: Option<Publication>) {
        let dropped = publication.and_then(|it| self.queue.push(it));
        if let Some(train) = dropped.and_then(|it| self.trains.get_mut(&it)) {
            train.report_all();
        }
    }
}

/// What reading and sending share, for oneself; a thread that has died left it whole.
pub fn locked(known: &Mutex<Known>) -> MutexGuard<'_, Known> {
    known.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A connection's state as Sparkplug has it.
#[derive(Debug)]
pub struct Session {
    name: NodeName,
    birth_number: u64,
    connections: u64,
    seq: u64,
    /// How many metrics each train was born with.
    born: BTreeMap<TrainId, usize>,
    /// The node's own metrics as they were last published.
    published: Option<Counts>,
}

/// Aliases of the node's own metrics; those of trains are greater.
const COUNTS: [(&str, &str); 6] = [
    ("forward/made", "Publications made, over all trains"),
    ("forward/taken", "Publications that the broker has taken"),
    ("forward/dropped", "Publications dropped because the queue was full"),
    ("forward/waiting", "Publications that wait"),
    ("forward/trains", "Trains that were heard of"),
    ("forward/connections", "Connections to the broker so far"),
];

impl Session {
    /// The so-manieth attempt to connect, from 0, which, if it succeeds, is the so-manieth connection.
    pub fn new(name: &NodeName, attempt: u64, connections: u64) -> Self {
        Session {
            name: name.clone(),
            birth_number: attempt % 256,
            connections,
            seq: 0,
            born: BTreeMap::new(),
            published: None,
        }
    }

    /// The node's death: what the broker is to publish when the connection is lost.
    pub fn death(&self, now_ms: u64) -> Message {
        let payload = Payload {
            timestamp: Some(now_ms),
            metrics: vec![self.birth_metric(now_ms)],
            seq: None,
        };
        Message { topic: self.name.topic("NDEATH"), payload: payload.encode_to_vec() }
    }

    fn birth_metric(&self, now_ms: u64) -> crate::payload::Metric {
        Value::Count(Some(self.birth_number)).born(BIRTH_NUMBER, None, "", "", now_ms)
    }

    /// The node's birth and those of its trains that live; also when a host asks for them anew.
    pub fn births(&mut self, known: &Known, now_ms: u64) -> Vec<Message> {
        self.seq = 0;
        self.born.clear();
        let counts = known.queue.counts();
        self.published = Some(counts);
        let version = Value::words(env!("CARGO_PKG_VERSION"));
        let mut metrics = vec![
            self.birth_metric(now_ms),
            Value::Switch(false).born(REBIRTH, None, "", "", now_ms),
            version.born("forward/version", None, "", "Release of dynocar forward", now_ms),
        ];
        let values = self.own(known, counts);
        metrics.extend(COUNTS.iter().zip(1..).zip(values).map(|((count, alias), value)| {
            Value::Count(Some(value)).born(count.0, Some(alias), "", count.1, now_ms)
        }));
        let mut births = vec![self.message("NBIRTH", None, metrics, now_ms)];
        let living = known.trains.values().filter(|train| train.is_alive);
        births.extend(living.map(|train| self.birth(train, now_ms)));
        births
    }

    fn own(&self, known: &Known, counts: Counts) -> [u64; COUNTS.len()] {
        let trains = known.trains.len() as u64;
        [counts.made, counts.taken, counts.dropped, counts.waiting, trains, self.connections]
    }

    fn birth(&mut self, train: &Train, now_ms: u64) -> Message {
        self.born.insert(train.id, train.metric_count());
        self.message("DBIRTH", Some(&train.device()), train.born(), now_ms)
    }

    fn message(
        &mut self,
        kind: &str,
        device: Option<&str>,
        metrics: Vec<crate::payload::Metric>,
        now_ms: u64,
    ) -> Message {
        let seq = Some(self.next_seq());
        let payload = Payload { timestamp: Some(now_ms), metrics, seq };
        let topic = match device {
            Some(device) => self.name.device_topic(kind, device),
            None => self.name.topic(kind),
        };
        Message { topic, payload: payload.encode_to_vec() }
    }

    fn next_seq(&mut self) -> u64 {
        let seq = self.seq;
        self.seq = (seq + 1) % 256;
        seq
    }

    /// The next of the queue, after its train's birth where that is due; empty when there is none, or too many are
    /// under way.
    pub fn next(&mut self, known: &mut Known, now_ms: u64) -> Vec<Message> {
        let mut messages = Vec::new();
        let Some(publication) = known.queue.send() else { return messages };
        let id = publication.train;
        let Some(train) = known.trains.get(&id) else { return messages };
        if self.born.get(&id).is_none_or(|&count| count < publication.metric_count) {
            messages.push(self.birth(train, now_ms));
        }
        let topic = self.name.device_topic("DDATA", &train.device());
        let payload = publication.numbered(self.next_seq());
        messages.push(Message { topic, payload });
        messages
    }

    /// Births of trains that live again, deaths of those whose daemon is silent; for when nothing waits.
    pub fn births_and_deaths(&mut self, known: &Known, now_ms: u64) -> Vec<Message> {
        let mut messages = Vec::new();
        for train in known.trains.values() {
            let is_born = self.born.contains_key(&train.id);
            if train.is_alive && !is_born {
                messages.push(self.birth(train, now_ms));
            } else if !train.is_alive && is_born {
                self.born.remove(&train.id);
                messages.push(self.message("DDEATH", Some(&train.device()), Vec::new(), now_ms));
            }
        }
        messages
    }

    /// The node's own counts, where they have changed.
    pub fn own_data(&mut self, known: &Known, now_ms: u64) -> Option<Message> {
        let counts = known.queue.counts();
        if self.published.replace(counts) == Some(counts) {
            return None;
        }
        let values = self.own(known, counts);
        let metric = |(alias, value)| Value::Count(Some(value)).changed(alias, now_ms);
        let metrics = (1..).zip(values).map(metric).collect();
        Some(self.message("NDATA", None, metrics, now_ms))
    }
}

/// True for a command that asks for all births anew.
pub fn is_rebirth(payload: &[u8]) -> bool {
    let metrics = Payload::decode(payload).map(|it| it.metrics).unwrap_or_default();
    metrics.iter().any(|metric| {
        metric.name.as_deref() == Some(REBIRTH) && metric.value == Some(MetricValue::Boolean(true))
    })
}
