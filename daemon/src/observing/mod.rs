//! Observation of trains, in one vocabulary for all observers: arrivals and departures, and changes in the answers
//! of the pipelines. An observer is one reader of each train's snapshots, as every client is.
//!
//! - `train`: one train, and the kinds of events

mod train;

use dynocar_shared::TrainId;
use dynocar_transport::{ChannelError, Host, Peer, Role};

pub use train::{EventKind, ObservedTrain, TrainChange};

/// Selection of trains and pipelines to observe.
#[derive(Clone, Debug)]
pub struct ObservedSelection {
    /// The run-time directory.
    pub host: Host,
    /// The trains; every train that is there or comes, when empty.
    pub trains: Vec<TrainId>,
}

impl ObservedSelection {
    /// Returns the trains, in addition to the known ones, for which somebody now holds one of these roles; none where
    /// the selection names trains.
    ///
    /// # Errors
    ///
    /// When the run-time directory cannot be read.
    pub fn newcomers(
        &self,
        roles: &[Role],
        is_known: impl Fn(TrainId) -> bool,
    ) -> Result<Vec<TrainId>, ChannelError> {
        let mut newcomers = Vec::new();
        if self.trains.is_empty() {
            for &role in roles {
                newcomers.extend(Peer::trains(&self.host, role)?);
            }
        }
        newcomers.retain(|&train| !is_known(train));
        newcomers.sort_unstable();
        newcomers.dedup();
        Ok(newcomers)
    }
}
