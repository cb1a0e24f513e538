//! The kinds of events.

use dynocar_shared::vocabulary;
use dynocar_shared::vocabulary::EffectKind;

vocabulary! {
    /// The kind of an event.
    EventKind: u32 {
        /// None that this release knows.
        Unknown = 0 "unknown",
        /// The recorder has opened the train's channels.
        RecordingBegan = 1 "recording_began",
        /// The recorder was asked to end.
        RecordingEnded = 2 "recording_ended",
        /// A daemon serves the train.
        DaemonCame = 3 "daemon_came",
        /// No daemon serves the train any more.
        DaemonGone = 4 "daemon_gone",
        /// A controller drives the train.
        ControllerCame = 5 "controller_came",
        /// No controller drives the train any more.
        ControllerGone = 6 "controller_gone",
        /// A pipeline's status or its reason is another than before.
        StatusChanged = 7 "status_changed",
        /// Sequence numbers were passed over: samples that the recording lacks.
        SamplesLost = 8 "samples_lost",
        /// The daemon has vouched for no snapshot of a pipeline for a while.
        DaemonSilent = 9 "daemon_silent",
        /// The residual's pipeline suspects an effect that it did not suspect before.
        SuspicionRaised = 10 "suspicion_raised",
        /// It suspects none any more.
        SuspicionEnded = 11 "suspicion_ended",
        /// A person or a program asked to keep this moment for good.
        KeepRequested = 12 "keep_requested",
        /// A pipeline uses another model of train and line than before.
        ModelChanged = 13 "model_changed",
        /// A learner wrote down a maintenance event: a dragging brake, low adhesion, another load.
        MaintenanceFound = 14 "maintenance_found",
    }
}

/// Change of a train.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TrainChange {
    /// Kind of the event.
    pub kind: EventKind,
    /// The pipeline's number in the daemon's configuration, where it concerns one.
    pub pipeline: Option<u32>,
    /// Numbers of the new status and its reason, where that has changed.
    pub status: Option<(u32, u32)>,
    /// The effect that is suspected now, where that has changed.
    pub effect: Option<EffectKind>,
    /// The same in words.
    pub text: String,
}

impl TrainChange {
    /// A change without numbers.
    pub fn new(kind: EventKind, text: String) -> Self {
        TrainChange { kind, pipeline: None, status: None, effect: None, text }
    }
}
