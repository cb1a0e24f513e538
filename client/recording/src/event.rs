//! What happens around samples and snapshots, as messages of a recording.

use prost::Enumeration;

macro_rules! kinds {
    ($( #[doc = $doc:literal] $kind:ident = $number:literal $name:literal; )*) => {
        /// The kind of an event.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Enumeration)]
        #[repr(i32)]
        pub enum EventKind { $( #[doc = $doc] $kind = $number ),* }

        impl EventKind {
            /// Every kind, in the order of its number.
            pub const ALL: &'static [EventKind] = &[ $( EventKind::$kind ),* ];

            /// The kind's name.
            pub const fn name(self) -> &'static str {
                match self { $( EventKind::$kind => $name ),* }
            }

            /// What the kind means.
            pub const fn meaning(self) -> &'static str {
                match self { $( EventKind::$kind => $doc ),* }
            }
        }
    };
}

kinds! {
    /// None that this release knows.
    Unknown = 0 "unknown";
    /// The recorder has opened the train's channels.
    RecordingBegan = 1 "recording_began";
    /// The recorder was asked to end.
    RecordingEnded = 2 "recording_ended";
    /// A daemon serves the train.
    DaemonCame = 3 "daemon_came";
    /// No daemon serves the train any more.
    DaemonGone = 4 "daemon_gone";
    /// A controller drives the train.
    ControllerCame = 5 "controller_came";
    /// No controller drives the train any more.
    ControllerGone = 6 "controller_gone";
    /// A pipeline's status or its reason is another than before.
    StatusChanged = 7 "status_changed";
    /// Sequence numbers were passed over: samples that the recording lacks.
    SamplesLost = 8 "samples_lost";
    /// The daemon has vouched for no snapshot of a pipeline for a while.
    DaemonSilent = 9 "daemon_silent";
    /// The residual's pipeline suspects an effect that it did not suspect before.
    SuspicionRaised = 10 "suspicion_raised";
    /// It suspects none any more.
    SuspicionEnded = 11 "suspicion_ended";
    /// A person or a program asked to keep this moment for good.
    KeepRequested = 12 "keep_requested";
    /// A pipeline uses another model of train and line than before.
    ModelChanged = 13 "model_changed";
    /// A learner wrote down a maintenance event: a dragging brake, low adhesion, another load.
    MaintenanceFound = 14 "maintenance_found";
}

/// Something that happened.
#[derive(Clone, PartialEq, prost::Message)]
pub struct Event {
    /// When the recorder saw it, in ns of the host's monotonic clock.
    #[prost(int64, tag = "1")]
    pub monotonic_ns: i64,
    /// The train.
    #[prost(uint64, tag = "2")]
    pub train_id: u64,
    /// What happened.
    #[prost(enumeration = "EventKind", tag = "3")]
    pub kind: i32,
    /// The pipeline's number in the daemon's configuration, where it concerns one.
    #[prost(uint32, optional, tag = "4")]
    pub pipeline_index: Option<u32>,
    /// The new status, see [`dynocar_shared::Status`].
    #[prost(int32, optional, tag = "5")]
    pub status: Option<i32>,
    /// Its reason, see [`dynocar_shared::Reason`].
    #[prost(int32, optional, tag = "6")]
    pub reason: Option<i32>,
    /// How many, for what is counted.
    #[prost(uint64, optional, tag = "7")]
    pub count: Option<u64>,
    /// The same in words.
    #[prost(string, tag = "8")]
    pub text: String,
}

impl Event {
    /// The number in a field by its place in [`EVENT_FIELDS`], in two's complement; `None` where it is
    /// missing, and for the text.
    pub fn word(&self, index: usize) -> Option<u64> {
        match index {
            0 => Some(self.monotonic_ns as u64),
            1 => Some(self.train_id),
            2 => Some(self.kind as u64),
            3 => self.pipeline_index.map(u64::from),
            4 => self.status.map(|it| it as u64),
            5 => self.reason.map(|it| it as u64),
            6 => self.count,
            _ => None,
        }
    }

    /// Sets the number in a field by its place; one that is never missing becomes 0 without.
    pub fn set_word(&mut self, index: usize, word: Option<u64>) {
        let number = word.unwrap_or(0);
        match index {
            0 => self.monotonic_ns = number as i64,
            1 => self.train_id = number,
            2 => self.kind = number as i32,
            3 => self.pipeline_index = word.map(|it| it as u32),
            4 => self.status = word.map(|it| it as i32),
            5 => self.reason = word.map(|it| it as i32),
            6 => self.count = word,
            _ => {}
        }
    }
}

/// A field of [`Event`]: name, number, whether it may be missing, unit and meaning.
pub struct EventField {
    /// The name.
    pub name: &'static str,
    /// The protobuf number.
    pub number: i32,
    /// The name of the vocabulary, or else the type.
    pub type_name: &'static str,
    /// True where it may be missing.
    pub is_optional: bool,
    /// What it is.
    pub meaning: &'static str,
}

const fn field(
    name: &'static str,
    number: i32,
    type_name: &'static str,
    is_optional: bool,
    meaning: &'static str,
) -> EventField {
    EventField { name, number, type_name, is_optional, meaning }
}

/// The fields of [`Event`], in order.
#[rustfmt::skip]
pub const EVENT_FIELDS: [EventField; 8] = [
    field("monotonic_ns", 1, "i64", false, "When the recorder saw it, in ns of the host's monotonic clock."),
    field("train_id", 2, "u64", false, "The train."),
    field("kind", 3, "EventKind", false, "What happened."),
    field("pipeline_index", 4, "u32", true, "The pipeline's number in the daemon's configuration, where it concerns one."),
    field("status", 5, "Status", true, "The new status of the pipeline."),
    field("reason", 6, "Reason", true, "The reason of that status."),
    field("count", 7, "u64", true, "How many, for what is counted."),
    field("text", 8, "string", false, "The same in words."),
];
