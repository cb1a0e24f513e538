//! Messages of protobuf that are declared once, as a type and as a table of their fields; and the events around samples
//! and snapshots, which are such messages.

use dynocar::observing::TrainChange;
use dynocar_shared::TrainId;
use dynocar_transport::monotonic_now_ns;

pub use dynocar::observing::EventKind;

/// A field of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MessageField {
    /// The name.
    pub name: &'static str,
    /// The protobuf number.
    pub number: u32,
    /// The name of the vocabulary, or else the type.
    pub type_name: &'static str,
    /// True where it may be missing.
    pub is_optional: bool,
    /// Meaning of the field.
    pub meaning: &'static str,
}

/// A message with the table of its fields from one list: number, name, type and protobuf's name of it, and the
/// vocabulary whose numbers it holds.
macro_rules! message {
    (
        #[doc = $what:literal]
        $name:ident {
            $(
                #[doc = $meaning:literal]
                $number:literal $field:ident: $type:ty = $kind:ident $($optional:ident)? $(($vocabulary:ident))?;
            )*
        }
    ) => {
        #[doc = $what]
        #[derive(Clone, PartialEq, prost::Message)]
        pub struct $name {
            $(
                #[doc = $meaning]
                #[prost($kind, $($optional,)? tag = $number)]
                pub $field: $type,
            )*
        }

        impl $name {
            /// Its name in the package.
            pub const NAME: &str = stringify!($name);
            /// Meaning of the message.
            pub const MEANING: &str = $what;
            /// Its fields, in order.
            pub const FIELDS: &[$crate::event::MessageField] = &[ $(
                $crate::event::MessageField {
                    name: stringify!($field),
                    number: $number,
                    type_name: $crate::event::type_name(stringify!($kind), stringify!($($vocabulary)?)),
                    is_optional: !stringify!($($optional)?).is_empty(),
                    meaning: $meaning,
                },
            )* ];
        }
    };
}

pub(crate) use message;

/// Returns the vocabulary, or else Rust's name of a protobuf type.
pub const fn type_name(kind: &str, vocabulary: &'static str) -> &'static str {
    match kind.as_bytes() {
        _ if !vocabulary.is_empty() => vocabulary,
        b"double" => "f64",
        b"int64" => "i64",
        b"uint64" => "u64",
        b"uint32" => "u32",
        _ => "string",
    }
}

message! {
    /// Event around samples and snapshots.
    Event {
        /// When the recorder saw it, in ns of the host's monotonic clock.
        1 monotonic_ns: i64 = int64;
        /// The train.
        2 train_id: u64 = uint64;
        /// Kind of the event.
        3 kind: i32 = int32 (EventKind);
        /// The pipeline's number in the daemon's configuration, where it concerns one.
        4 pipeline_index: Option<u32> = uint32 optional;
        /// The new status of the pipeline.
        5 status: Option<i32> = int32 optional (Status);
        /// The reason of that status.
        6 reason: Option<i32> = int32 optional (Reason);
        /// How many samples were lost.
        7 count: Option<u64> = uint64 optional;
        /// The same in words.
        8 text: String = string;
    }
}

impl Event {
    /// Of a train, seen now.
    pub fn now(train: TrainId, kind: EventKind, text: String) -> Self {
        Event::new(train, &TrainChange::new(kind, text))
    }

    /// Returns the event of a change of a train, seen now.
    pub fn new(train: TrainId, change: &TrainChange) -> Self {
        Event {
            monotonic_ns: monotonic_now_ns(),
            train_id: train.0,
            kind: change.kind as i32,
            pipeline_index: change.pipeline,
            status: change.status.map(|it| it.0 as i32),
            reason: change.status.map(|it| it.1 as i32),
            count: None,
            text: change.text.clone(),
        }
    }

    /// Returns the kind of the event.
    pub fn kind(&self) -> EventKind {
        EventKind::from_number(self.kind as u32).unwrap_or(EventKind::Unknown)
    }

    /// Returns the number in a field by its place in [`Event::FIELDS`], in two's complement; `None` where it is
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
