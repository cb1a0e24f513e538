//! Messages in the order in which they were recorded, whatever the order in which another tool has written them.

use std::collections::HashMap;

use dynocar_shared::{ParameterSnapshot, TrainSample};

use crate::error::ReadError;
use crate::reading::{Item, Raw, Visitor};
use crate::recording::Recording;

/// A recording that is read, with the times at which its messages were logged.
#[derive(Debug, Default)]
pub struct Logged {
    recording: Recording,
    log_time: u64,
    samples: Vec<u64>,
    snapshots: Vec<u64>,
}

impl Visitor for Logged {
    type Error = ReadError;

    fn item(&mut self, item: Item<'_>) -> Result<(), ReadError> {
        match item {
            Item::Sample(_) => self.samples.push(self.log_time),
            Item::Snapshot(_) => self.snapshots.push(self.log_time),
            _ => {}
        }
        self.recording.item(item)
    }

    fn raw(&mut self, raw: &Raw<'_>) -> Result<(), ReadError> {
        self.log_time = raw.header.log_time;
        self.recording.raw(raw)
    }
}

impl Logged {
    /// Returns the recording in order, each message once.
    pub fn in_order(self) -> Recording {
        let Logged { mut recording, samples, snapshots, .. } = self;
        put_in_order(&mut recording.samples, &samples, |it: &TrainSample| Place {
            of: (it.train_id, 0),
            published_ns: it.published_ns,
            number: (0, it.sequence),
        });
        put_in_order(&mut recording.snapshots, &snapshots, |it: &ParameterSnapshot| Place {
            of: (it.train_id, it.pipeline_index),
            published_ns: it.published_ns,
            number: (it.epoch, it.sequence),
        });
        recording
    }
}

/// Place of a message among those of its controller or pipeline.
struct Place {
    of: (u64, u32),
    published_ns: i64,
    number: (u64, u64),
}

/// Sorts messages by the times at which they were logged where any stands behind a later one, and drops those that
/// stand there twice. A clock that was set back, or numbers that begin anew, are no such order: the other goes on.
fn put_in_order<M: Copy + PartialEq>(
    messages: &mut Vec<M>,
    logged: &[u64],
    place: impl Fn(&M) -> Place,
) {
    let mut before: HashMap<(u64, u32), (u64, Place)> = HashMap::new();
    let is_behind = |(message, &time): (&M, &u64)| {
        let own = place(message);
        let falls = before.get(&own.of).is_some_and(|(earlier, it)| {
            time <= *earlier && own.published_ns <= it.published_ns && own.number <= it.number
        });
        before.insert(own.of, (time, own));
        falls
    };
    if !messages.iter().zip(logged).any(is_behind) {
        return;
    }
    let mut sorted: Vec<(u64, M)> = logged.iter().copied().zip(messages.drain(..)).collect();
    sorted.sort_by_key(|(time, message)| {
        let own = place(message);
        (*time, own.published_ns, own.number, own.of)
    });
    messages.extend(sorted.into_iter().map(|(_, message)| message));
    messages.dedup();
}
