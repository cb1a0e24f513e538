//! A train's metrics as they are now, and which of them have changed since they were last published.

use std::collections::HashMap;

use dynocar::operator::pipeline_name;
use dynocar_client::Reading;
use dynocar_shared::schema::unit_of;
use dynocar_shared::{PipelineKind, Quantity, TrainId};
use prost::Message;

use crate::fields::{MetricMeta, each_metric};
use crate::payload::{Metric, Payload, Value};
use crate::queue::Publication;

/// Aliases of a train's metrics begin at its number among the node's trains times this.
const ALIASES: u64 = 1 << 20;
/// What is published of the last event, with its meaning.
const EVENT: [(&str, &str); 2] = [("kind", "The last event"), ("text", "The last event in words")];
/// Stands for the train in the place of a pipeline's number and kind.
const OF_TRAIN: (u32, u32) = (u32::MAX, 0);

/// A metric as it is now.
#[derive(Clone, Debug)]
struct Slot {
    name: String,
    meta: MetricMeta,
    value: Value,
    taken_ms: u64,
    is_changed: bool,
    /// When the readings were last taken that gave it; 0 for what readings do not give.
    round: u64,
}

/// One train. Metrics are added and never taken away, so that an alias keeps its meaning; what is no longer
/// estimated has no value.
#[derive(Clone, Debug)]
pub struct Train {
    /// The train.
    pub id: TrainId,
    /// True while a daemon vouches for any snapshot.
    pub is_alive: bool,
    first_alias: u64,
    slots: Vec<Slot>,
    /// Places of the slots, by pipeline, folder and name.
    places: HashMap<((u32, u32), &'static str, &'static str), usize>,
    round: u64,
    publications: u64,
    must_publish_all: bool,
}

impl Train {
    /// A train of which nothing is known, the so-manieth of the node from 1.
    pub fn new(id: TrainId, number: u64) -> Self {
        let mut train = Train {
            id,
            is_alive: false,
            first_alias: number * ALIASES,
            slots: Vec::new(),
            places: HashMap::new(),
            round: 0,
            publications: 0,
            must_publish_all: true,
        };
        train.set_number(0);
        for (name, meaning) in EVENT {
            train.set_of_train("event", name, meaning, Value::Words(None), 0);
        }
        train
    }

    /// The train's name as a device.
    pub fn device(&self) -> String {
        format!("train-{}", self.id)
    }

    /// Number of metrics.
    pub fn metric_count(&self) -> usize {
        self.slots.len()
    }

    /// Takes what the snapshots say at a moment of the host's monotonic clock.
    pub fn take<'a>(
        &mut self,
        readings: impl Iterator<Item = Reading<'a>>,
        now_ns: i64,
        now_ms: u64,
    ) {
        self.round += 1;
        self.is_alive = false;
        let mut answers = [None; Quantity::ALL.len()];
        for reading in readings {
            let it = reading.snapshot;
            self.is_alive |= !reading.is_stale;
            let pipeline = (it.pipeline_index, it.pipeline_kind);
            for &quantity in Quantity::ALL.iter().filter(|&&quantity| it.answers(quantity)) {
                answers[quantity as usize] = Some((pipeline.0, it.pipeline_kind()));
            }
            each_metric(&reading, now_ns, |meta, value| {
                self.set(pipeline, meta, value, now_ms);
            });
        }
        for &quantity in Quantity::ALL {
            let answer: Option<(u32, Option<PipelineKind>)> = answers[quantity as usize];
            let answer =
                Value::Words(answer.map(|(index, kind)| pipeline_name(index, kind).into()));
            let meaning = "Folder of the pipeline that answers the quantity of this name";
            self.set_of_train("answers", quantity.name(), meaning, answer, now_ms);
        }
        for slot in &mut self.slots {
            let is_gone = slot.round != 0 && slot.round != self.round;
            if is_gone && slot.value != slot.value.missing() {
                slot.value = slot.value.missing();
                (slot.taken_ms, slot.is_changed) = (now_ms, true);
            }
        }
    }

    fn set_of_train(
        &mut self,
        folder: &'static str,
        name: &'static str,
        meaning: &'static str,
        value: Value,
        now_ms: u64,
    ) -> &mut Slot {
        self.set(OF_TRAIN, MetricMeta { folder, name, meaning }, value, now_ms)
    }

    fn set(
        &mut self,
        pipeline: (u32, u32),
        meta: MetricMeta,
        value: Value,
        now_ms: u64,
    ) -> &mut Slot {
        let place = (pipeline, meta.folder, meta.name);
        let index = *self.places.entry(place).or_insert(self.slots.len());
        if index == self.slots.len() {
            let mut name = String::new();
            if pipeline != OF_TRAIN {
                name = pipeline_name(pipeline.0, PipelineKind::from_number(pipeline.1)) + "/";
            }
            if !meta.folder.is_empty() {
                name = name + meta.folder + "/";
            }
            name += meta.name;
            let value = value.clone();
            self.slots.push(Slot {
                name,
                meta,
                value,
                taken_ms: now_ms,
                is_changed: true,
                round: 0,
            });
        }
        let slot = &mut self.slots[index];
        slot.round = if pipeline == OF_TRAIN { 0 } else { self.round };
        if slot.value != value {
            (slot.value, slot.taken_ms, slot.is_changed) = (value, now_ms, true);
        }
        slot
    }

    fn set_number(&mut self, now_ms: u64) {
        let meaning = "Number of the publication: a gap was dropped, a repetition sent again";
        let number = Value::Count(Some(self.publications));
        self.set_of_train("", "publication", meaning, number, now_ms);
    }

    /// A publication of what has changed, if anything has.
    pub fn publication(&mut self, now_ms: u64) -> Option<Publication> {
        let must_publish_all = std::mem::take(&mut self.must_publish_all);
        if !must_publish_all && !self.slots.iter().any(|slot| slot.is_changed) {
            return None;
        }
        self.publications += 1;
        self.set_number(now_ms);
        let mut metrics = Vec::new();
        for (index, slot) in self.slots.iter_mut().enumerate() {
            if std::mem::take(&mut slot.is_changed) || must_publish_all {
                let alias = self.first_alias + index as u64;
                metrics.push(slot.value.changed(alias, slot.taken_ms));
            }
        }
        let payload = Payload { timestamp: Some(now_ms), metrics, seq: None };
        Some(Publication {
            train: self.id,
            metric_count: self.slots.len(),
            payload: payload.encode_to_vec().into(),
            is_historical: false,
        })
    }

    /// A publication of an event, with what has changed.
    pub fn event(&mut self, kind: &'static str, text: String, now_ms: u64) -> Option<Publication> {
        for ((name, meaning), value) in
            EVENT.into_iter().zip([Value::words(kind), Value::words(text)])
        {
            let slot = self.set_of_train("event", name, meaning, value, now_ms);
            // An event like the last is one all the same.
            (slot.taken_ms, slot.is_changed) = (now_ms, true);
        }
        self.publication(now_ms)
    }

    /// Makes the next publication hold everything: one before it was dropped.
    pub fn report_all(&mut self) {
        self.must_publish_all = true;
    }

    /// Every metric as it is now, with its name, type, unit and meaning.
    pub fn born(&self) -> Vec<Metric> {
        let metric = |(index, slot): (usize, &Slot)| {
            let (unit, meaning) = (unit_of(slot.meta.name), slot.meta.meaning);
            let alias = Some(self.first_alias + index as u64);
            slot.value.born(&slot.name, alias, unit, meaning, slot.taken_ms)
        };
        self.slots.iter().enumerate().map(metric).collect()
    }
}
