//! Messages in the order in which they were recorded, whatever the order in which another tool has written them.

use std::collections::HashMap;

use dynocar_shared::{ParameterSnapshot, TrainSample};

/// Puts samples into order by the times at which they were logged, each once.
pub fn samples_in_order(samples: &mut Vec<TrainSample>, logged: &[u64]) {
    put_in_order(samples, logged, |it| Place {
        of: (it.train_id, 0),
        published_ns: it.published_ns,
        number: (0, it.sequence),
    });
}

/// The same of snapshots.
pub fn snapshots_in_order(snapshots: &mut Vec<ParameterSnapshot>, logged: &[u64]) {
    put_in_order(snapshots, logged, |it| Place {
        of: (it.train_id, it.pipeline_index),
        published_ns: it.published_ns,
        number: (it.epoch, it.sequence),
    });
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
