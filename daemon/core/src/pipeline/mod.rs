//! Estimators behind one interface, from sample to snapshot.
//!
//! A [`Pipeline`] is one estimator for one train with its own validation: the daemon feeds it
//! from the channel, `dynocar identify` from a file, and both get the same bits.

pub mod admission;
pub mod braking;
mod estimator;
pub mod judge;
mod kept;
pub mod momentum;
pub mod monitor;
pub mod motion;
pub mod output;
pub mod settings;
pub mod train_kalman;

pub use estimator::{Echo, Estimator, Outcome};
pub use judge::InnovationMonitor;
pub use kept::{KeptEstimate, NotKept, UseBefore};
pub use settings::SettingError;

use std::sync::Arc;

use dynocar_model::force::ForceResolver;
use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;
use dynocar_shared::{ParameterSnapshot, Reason, TrainId, TrainSample};

use self::admission::Admission;
use self::output::Usable;
use crate::plausibility::DetectedFault;

/// One estimator for one train, from [`TrainSample`] to [`ParameterSnapshot`].
pub struct Pipeline {
    admission: Admission,
    resolver: ForceResolver,
    estimator: Box<dyn Estimator>,
    usable: Usable,
    /// One bit for each quantity that estimators of this kind answer.
    answerable: u32,
    /// Resets of the pipelines that this one took over from.
    resets_before: u64,
    snapshot: ParameterSnapshot,
}

impl Pipeline {
    /// Returns a pipeline around an estimator; `index` is its number in the configuration.
    pub fn new(
        train_id: TrainId,
        index: u32,
        train: Arc<TrainModel>,
        track: Option<Arc<Track>>,
        estimator: Box<dyn Estimator>,
    ) -> Self {
        let mut snapshot = ParameterSnapshot::empty();
        snapshot.train_id = train_id.0;
        snapshot.pipeline_index = index;
        snapshot.pipeline_kind = estimator.kind() as u32;
        let mut admission = Admission::new(train_id, Arc::clone(&train));
        if let Some(line_m) = track.as_ref().and_then(|track| track.length_m) {
            admission.keep_on_line(line_m, train.length_m);
        }
        admission.write(&*estimator, &mut snapshot);
        let answerable = output::answerable(estimator.kind());
        Pipeline {
            admission,
            resolver: ForceResolver::new(train, track),
            estimator,
            usable: Usable::default(),
            answerable,
            resets_before: 0,
            snapshot,
        }
    }

    /// Starts from an estimate kept from earlier, before the first sample; false when the
    /// estimator has no use for it.
    pub fn warm_start(&mut self, kept: &KeptEstimate) -> bool {
        let is_taken = self.estimator.warm_start(kept);
        if is_taken {
            self.usable = Usable::resumed(kept.use_before.usable_quantities);
        }
        self.write_estimate();
        is_taken
    }

    /// Takes the place of another pipeline of the train, with another model: the counts of samples,
    /// snapshots and resets go on here, this change being one more reset, and a new motion segment
    /// begins; the estimate stays this one's own. The other goes on from here on its own account.
    ///
    /// # Real-time
    ///
    /// Allocates nothing, locks nothing.
    pub fn take_over(&mut self, other: &mut Pipeline) {
        self.admission.exchange_counts(&mut other.admission);
        let (ours, theirs) = (self.snapshot.model_hash, other.snapshot);
        self.resets_before = theirs.generation + 1;
        other.resets_before = 0;
        let written = &mut self.snapshot;
        std::mem::swap(written, &mut other.snapshot);
        (written.model_hash, other.snapshot.model_hash) = (ours, theirs.model_hash);
        self.write_estimate();
        other.write_estimate();
    }

    fn write_estimate(&mut self) -> Option<u32> {
        self.snapshot.generation = 0;
        let known = self.admission.write(&*self.estimator, &mut self.snapshot);
        self.snapshot.generation += self.resets_before;
        known
    }

    /// Counts the samples after this number, taken or lost; to be called before the first sample.
    pub fn count_from(&mut self, sequence: u64) {
        self.admission.count_from(sequence);
    }

    /// Counts as lost the samples up to this number that have not come and will not come any more; true when there were
    /// any.
    pub fn count_up_to(&mut self, sequence: u64) -> bool {
        self.admission.count_up_to(sequence);
        let is_news = self.snapshot.samples_lost != self.admission.lost();
        self.snapshot.samples_lost = self.admission.lost();
        self.snapshot.sequence += u64::from(is_news);
        is_news
    }

    /// Takes one sample and gives the snapshot after it.
    ///
    /// The caller fills in the snapshot's epoch, its time of publishing and the quantities that it answers; everything
    /// else depends on the samples alone.
    ///
    /// # Real-time
    ///
    /// Allocates nothing, locks nothing, reads no clock.
    pub fn process(&mut self, sample: &TrainSample) -> &ParameterSnapshot {
        let outcome = self.admission.take(sample, &mut self.resolver, &mut *self.estimator);
        let snapshot = &mut self.snapshot;
        match outcome {
            Outcome::Idle | Outcome::Used => snapshot.samples_used += 1,
            Outcome::Updated => {
                snapshot.samples_used += 1;
                snapshot.updates += 1;
            }
            Outcome::Rejected(reason) => {
                snapshot.samples_rejected += 1;
                let count = &mut snapshot.rejected_by_reason[reason as usize];
                *count = count.saturating_add(1);
            }
        }
        snapshot.samples_lost = self.admission.lost();
        snapshot.sequence += 1;
        snapshot.sample_time_ns = sample.time_ns;
        snapshot.sample_published_ns = sample.published_ns;
        snapshot.sample_sequence = sample.sequence;
        let known = self.write_estimate();
        let awaiting = [Reason::EstimateStale, Reason::OnlyLowerBound, Reason::LoadMayHaveChanged];
        let reason = known.and(self.snapshot.reason());
        let is_awaiting = reason.is_some_and(|reason| awaiting.contains(&reason));
        let good = known.unwrap_or(0) & self.answerable;
        self.snapshot.usable_quantities = self.usable.see(good, is_awaiting, sample.time_ns);
        &self.snapshot
    }

    /// Returns the recent implausibility of the samples that spoils the estimate.
    pub fn implausible(&self) -> Option<DetectedFault> {
        self.admission.implausible(self.estimator.kind())
    }

    /// Returns the snapshot after the last sample.
    pub fn snapshot(&self) -> &ParameterSnapshot {
        &self.snapshot
    }

    /// Returns the snapshot after the last sample, for its publisher to stamp.
    pub fn snapshot_mut(&mut self) -> &mut ParameterSnapshot {
        &mut self.snapshot
    }
}
