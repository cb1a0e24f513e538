//! The schema of what an explanation adds, in a file of its own beside that of the recording.

use std::sync::LazyLock;

use prost::Message;
use prost_types::{FileDescriptorProto, FileDescriptorSet};

use super::messages::{Effect, PredictedSpeed, Residual, Verdict};
use crate::message::MessageField;
use crate::schema::{fields_of, message};

/// The messages with their names, what they are and their fields.
pub const MESSAGES: [(&str, &str, &[MessageField]); 4] = [
    (Verdict::NAME, Verdict::MEANING, Verdict::FIELDS),
    (Effect::NAME, Effect::MEANING, Effect::FIELDS),
    (Residual::NAME, Residual::MEANING, Residual::FIELDS),
    (PredictedSpeed::NAME, PredictedSpeed::MEANING, PredictedSpeed::FIELDS),
];

/// The messages as the bytes that an MCAP schema holds.
pub static DESCRIPTORS: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let file = FileDescriptorProto {
        name: Some("dynocar/explanation.proto".into()),
        package: Some("dynocar".into()),
        syntax: Some("proto3".into()),
        message_type: MESSAGES.iter().map(|it| message(it.0, fields_of(it.2))).collect(),
        ..Default::default()
    };
    FileDescriptorSet { file: vec![file] }.encode_to_vec()
});
