//! Messages that an explanation adds to a recording, and their schema in a file of its own.

use std::sync::LazyLock;

use prost::Message;
use prost_types::{FileDescriptorProto, FileDescriptorSet};

use crate::message::{MessageField, message};
use crate::schema::{fields_of, message};

message! {
    /// Statement of `explain` about a recording.
    Verdict {
        /// none, effect, ambiguous, unknown or insufficient_data.
        1 verdict: String = string;
        /// The verdict in a sentence or two.
        2 text: String = string;
        /// RMSE of the predicted speed on the runs held out, without the effects.
        3 rmse_before_mps: Option<f64> = double optional;
        /// The same with the effects.
        4 rmse_after_mps: Option<f64> = double optional;
    }
}

message! {
    /// An effect that begins to act here.
    Effect {
        /// The train.
        1 train_id: u64 = uint64;
        /// The file of the run in the dataset that was explained.
        2 run_file: String = string;
        /// The kind's name.
        3 kind: String = string;
        /// Its place among the effects found, from 1.
        4 number: u32 = uint32;
        /// Kind, size and place in words.
        5 text: String = string;
        /// For how long it acts from here on.
        6 duration_s: f64 = double;
        /// When it ends to act, in ns since 1970 like the message's log time.
        7 end_ns: u64 = uint64;
        /// Chainage of the train's centre where it begins to act.
        8 begin_position_m: Option<f64> = double optional;
        /// Chainage of the train's centre where it ends to act.
        9 end_position_m: Option<f64> = double optional;
        /// Share of the open-loop error on the fit runs that goes when the effect is added last.
        10 error_reduction: f64 = double;
        /// Probability that the search finds as much where nothing acts.
        11 p_value: f64 = double;
    }
}

message! {
    /// The resistance that the models lack, over about 20 s; positive retards. Logged at the middle.
    Residual {
        /// The length of time.
        1 duration_s: f64 = double;
        /// Without the effects found.
        2 residual_before_n_per_kn: f64 = double;
        /// With the effects found.
        3 residual_after_n_per_kn: f64 = double;
    }
}

message! {
    /// The speed as measured, and as the models predict it from the run's first sample on.
    PredictedSpeed {
        /// Measured.
        1 measured_speed_mps: f64 = double;
        /// Predicted without the effects found.
        2 speed_before_mps: f64 = double;
        /// Predicted with the effects found.
        3 speed_after_mps: f64 = double;
        /// Predicted without the effects less measured.
        4 error_before_mps: f64 = double;
        /// Predicted with the effects less measured.
        5 error_after_mps: f64 = double;
    }
}

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
