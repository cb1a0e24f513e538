//! Publications that wait for the broker: bounded, the oldest dropped, every one accounted for.
//!
//! Sparkplug sends data without acknowledgement (QoS 0). A broker answers a connection's packets in their order,
//! so its answer to a ping says that it has taken all that went before. Until then what was sent is kept, and
//! is sent again over the next connection: a publication may come twice, but does not go missing on the way.

use std::collections::VecDeque;

use dynocar_shared::TrainId;
use prost::Message;

use crate::payload::Payload;

/// What is to be published of a train.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Publication {
    /// The train.
    pub train: TrainId,
    /// How many metrics the train had: a birth must have declared as many.
    pub metric_count: usize,
    /// The payload without its number.
    pub payload: Box<[u8]>,
    /// True where it waited while there was no connection.
    pub is_historical: bool,
}

impl Publication {
    /// The payload under a number of the session.
    pub fn numbered(&self, seq: u64) -> Vec<u8> {
        // It is what `Train::publication` has encoded.
        let mut payload = Payload::decode(&*self.payload).unwrap_or_default();
        payload.seq = Some(seq);
        if self.is_historical {
            payload.metrics.iter_mut().for_each(|it| it.is_historical = Some(true));
        }
        payload.encode_to_vec()
    }
}

/// What has become of the publications.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Publications made.
    pub made: u64,
    /// Publications that the broker has taken.
    pub taken: u64,
    /// Publications dropped because the queue was full.
    pub dropped: u64,
    /// Publications that wait, or are sent and not known to have been taken.
    pub waiting: u64,
}

/// The queue.
#[derive(Debug, Default)]
pub struct Queue {
    most: usize,
    waiting: VecDeque<Publication>,
    sent: VecDeque<Publication>,
    counts: Counts,
}

impl Queue {
    /// A queue of at most so many publications, at least 2.
    pub fn new(most: usize) -> Self {
        Queue { most: most.max(2), ..Queue::default() }
    }

    /// Puts a publication at the end; gives the train of one that had to go.
    pub fn push(&mut self, publication: Publication) -> Option<TrainId> {
        self.counts.made += 1;
        let is_full = self.waiting.len() + self.sent.len() >= self.most;
        // What is sent already may have been taken: of two that are not, the older goes.
        let oldest = if is_full { self.waiting.pop_front() } else { None };
        self.waiting.push_back(publication);
        self.counts.dropped += u64::from(oldest.is_some());
        oldest.map(|it| it.train)
    }

    /// The next to be sent; it stays until the broker has taken it. At most half of the queue is under way.
    pub fn send(&mut self) -> Option<&Publication> {
        if 2 * self.sent.len() >= self.most {
            return None;
        }
        let next = self.waiting.pop_front()?;
        self.sent.push_back(next);
        self.sent.back()
    }

    /// The next to be sent, which is not sent yet.
    pub fn next(&self) -> Option<&Publication> {
        self.waiting.front()
    }

    /// The broker has taken all that was sent.
    pub fn take_note(&mut self) {
        self.counts.taken += self.sent.len() as u64;
        self.sent.clear();
    }

    /// The connection is lost: what was sent waits again, before the rest.
    pub fn give_back(&mut self) {
        while let Some(publication) = self.sent.pop_back() {
            self.waiting.push_front(publication);
        }
    }

    /// A connection begins: what waits by now is of the past.
    pub fn begin(&mut self) {
        self.give_back();
        self.waiting.iter_mut().for_each(|it| it.is_historical = true);
    }

    /// What has become of all.
    pub fn counts(&self) -> Counts {
        Counts { waiting: (self.waiting.len() + self.sent.len()) as u64, ..self.counts }
    }
}
