//! Answer of the daemon: one snapshot for each train and pipeline.

use crate::vocabulary::{
    EffectKind, MassSource, Parameter, PipelineKind, Quantity, Reason, RejectionReason, Status,
};
use crate::wire_struct;

/// The most parameters one pipeline estimates together.
pub const PARAMETERS_MAX: usize = 6;
/// Entries of the packed lower triangle of a covariance of [`PARAMETERS_MAX`] parameters.
pub const COVARIANCE_ENTRIES: usize = PARAMETERS_MAX * (PARAMETERS_MAX + 1) / 2;
/// Number of [`RejectionReason`]s.
pub const REJECTION_REASONS: usize = 16;

wire_struct! {
    /// A pipeline's knowledge of one train at one moment.
    ///
    /// `epoch` grows with every start of the daemon and `sequence` with every snapshot of a
    /// pipeline within an epoch; a reader keeps the greatest pair.
    pub struct ParameterSnapshot {
        /// Start of the daemon, in ns of the host's monotonic clock; grows with every restart.
        pub epoch: u64,
        /// Counts this pipeline's snapshots of this train within the epoch, from 1.
        pub sequence: u64,
        /// Counts the resets of the estimate within the epoch.
        pub generation: u64,
        /// The train, see [`crate::TrainId`].
        pub train_id: u64,
        /// Number of the pipeline in the daemon's configuration.
        pub pipeline_index: u32,
        /// [`PipelineKind`] by number.
        pub pipeline_kind: u32,
        /// [`Status`] by number.
        pub status: u32,
        /// [`Reason`] by number.
        pub reason: u32,
        /// One bit for each [`Quantity`] that this pipeline answers for the train, by the daemon's
        /// configuration.
        pub quantities: u32,
        /// One bit for each [`Quantity`] that any pipeline of the daemon answers for the train.
        pub train_quantities: u32,

        /// Measurement time of the newest sample behind the snapshot, controller's clock, in ns.
        pub sample_time_ns: i64,
        /// When that sample was handed to the channel, host's monotonic clock, in ns.
        pub sample_published_ns: i64,
        /// When the snapshot was first handed to the channel, host's monotonic clock, in ns.
        pub published_ns: i64,
        /// When the daemon last vouched for it, host's monotonic clock, in ns; a snapshot is sent
        /// again from time to time while no sample comes.
        pub vouched_ns: i64,
        /// Sequence number of the newest sample behind the snapshot.
        pub sample_sequence: u64,

        /// Samples that entered the estimate or its window.
        pub samples_used: u64,
        /// Samples refused, for any reason.
        pub samples_rejected: u64,
        /// Samples that never arrived, by gaps of the sequence number.
        pub samples_lost: u64,
        /// Windows or segments that updated the estimate.
        pub updates: u64,
        /// Samples refused, by [`RejectionReason`] number.
        pub rejected_by_reason: [u32; 16],

        /// Number of parameters in use.
        pub parameter_count: u32,
        /// One bit for each parameter that the data excited.
        pub excited: u32,
        /// Manoeuvres that would excite the others, see [`crate::Manoeuvre`].
        pub missing_manoeuvres: u32,
        /// Suspected missing effect, [`crate::vocabulary::EffectKind`] by number.
        pub suspected_effect: u32,
        /// Other effects that these data hardly distinguish from it: one bit for each
        /// [`crate::vocabulary::EffectKind`].
        pub suspected_alternatives: u32,
        /// How long the suspicion has stood, in whole s of the controller's clock.
        pub suspicion_age_s: u32,
        /// [`Parameter`] by number.
        pub parameters: [u32; 6],
        /// Values in the parameters' units.
        pub values: [f64; 6],
        /// Covariance, lower triangle packed by rows: (0,0), (1,0), (1,1), (2,0), …
        pub covariance: [f64; 21],

        /// Newest innovation over its predicted standard deviation.
        pub innovation_normalised: f64,
        /// Mean square of the normalised innovations lately; 1 when the model holds.
        pub innovation_mean_square: f64,
        /// Lag-1 correlation of the innovations lately; 0 when they are white.
        pub innovation_correlation: f64,
        /// Force in N, retarding positive, that the model does not explain.
        pub unexplained_force_n: f64,
        /// Its standard deviation in N.
        pub unexplained_force_std_n: f64,
        /// Evidence for the suspected effect: twice the log-likelihood ratio.
        pub suspicion_evidence: f64,
        /// Lowest speed in m/s among the data behind the estimate.
        pub speed_min_mps: f64,
        /// Highest speed in m/s among the data behind the estimate.
        pub speed_max_mps: f64,
        /// The model of train and line that the pipeline uses: the first 8 bytes of SHA-256
        /// over the train's file, a zero byte and the line's file; 0 when it came from no files.
        pub model_hash: u64,
        /// One bit for each [`Quantity`] whose values a controller may use now. It changes seldom: a usable quantity
        /// stays usable for half a second of doubt, and a doubted one has to hold for a while.
        pub usable_quantities: u32,
        /// Where the mass comes from: [`crate::vocabulary::MassSource`] by number.
        pub mass_source: u32,
    }
}

impl ParameterSnapshot {
    /// Returns a snapshot in which nothing has been estimated.
    pub const fn empty() -> Self {
        ParameterSnapshot {
            epoch: 0,
            sequence: 0,
            generation: 0,
            train_id: 0,
            pipeline_index: 0,
            pipeline_kind: 0,
            status: Status::Unestimated as u32,
            reason: Reason::TooFewSamples as u32,
            quantities: 0,
            train_quantities: 0,
            sample_time_ns: 0,
            sample_published_ns: 0,
            published_ns: 0,
            vouched_ns: 0,
            sample_sequence: 0,
            samples_used: 0,
            samples_rejected: 0,
            samples_lost: 0,
            updates: 0,
            rejected_by_reason: [0; REJECTION_REASONS],
            parameter_count: 0,
            excited: 0,
            missing_manoeuvres: 0,
            suspected_effect: 0,
            suspected_alternatives: 0,
            suspicion_age_s: 0,
            parameters: [0; PARAMETERS_MAX],
            values: [0.0; PARAMETERS_MAX],
            covariance: [0.0; COVARIANCE_ENTRIES],
            innovation_normalised: 0.0,
            innovation_mean_square: 0.0,
            innovation_correlation: 0.0,
            unexplained_force_n: 0.0,
            unexplained_force_std_n: 0.0,
            suspicion_evidence: 0.0,
            speed_min_mps: 0.0,
            speed_max_mps: 0.0,
            model_hash: 0,
            usable_quantities: 0,
            mass_source: 0,
        }
    }

    /// Returns the permitted use of the estimate; an unknown number reads as invalid.
    pub const fn status(&self) -> Status {
        match Status::from_number(self.status) {
            Some(status) => status,
            None => Status::Invalid,
        }
    }

    /// Returns the reason for the status.
    pub const fn reason(&self) -> Option<Reason> {
        Reason::from_number(self.reason)
    }

    /// Returns the estimator's kind.
    pub const fn pipeline_kind(&self) -> Option<PipelineKind> {
        PipelineKind::from_number(self.pipeline_kind)
    }

    /// Returns whether this pipeline answers a quantity for the train.
    pub const fn answers(&self, quantity: Quantity) -> bool {
        self.quantities & quantity.bit() != 0
    }

    /// Returns whether a controller may use the values for a quantity, as the daemon wrote it.
    pub const fn is_usable_for(&self, quantity: Quantity) -> bool {
        self.usable_quantities & quantity.bit() != 0 && !matches!(self.status(), Status::Invalid)
    }

    /// Returns where the mass comes from; `None` for a number that a newer peer gives.
    pub const fn mass_source(&self) -> Option<MassSource> {
        MassSource::from_number(self.mass_source)
    }

    /// Returns the effects that the data hardly distinguish from the suspected one.
    pub fn alternatives(&self) -> impl Iterator<Item = EffectKind> {
        let bits = self.suspected_alternatives;
        EffectKind::ALL.iter().copied().filter(move |kind| bits & kind.bit() != 0)
    }

    /// Returns the samples refused for one reason.
    pub const fn rejected(&self, reason: RejectionReason) -> u32 {
        self.rejected_by_reason[reason as usize]
    }

    /// Returns the index of a parameter among this snapshot's values.
    pub fn index_of(&self, parameter: Parameter) -> Option<usize> {
        let count = (self.parameter_count as usize).min(PARAMETERS_MAX);
        self.parameters[..count].iter().position(|&number| number == parameter as u32)
    }

    /// Returns a parameter's value in its unit.
    ///
    /// # Examples
    ///
    /// ```
    /// use dynocar_shared::{Parameter, ParameterSnapshot};
    ///
    /// let mut snapshot = ParameterSnapshot::empty();
    /// assert_eq!(snapshot.value(Parameter::Mass), None);
    /// snapshot.parameter_count = 1;
    /// snapshot.parameters[0] = Parameter::Mass as u32;
    /// snapshot.values[0] = 412.0;
    /// assert_eq!(snapshot.value(Parameter::Mass), Some(412.0));
    /// ```
    pub fn value(&self, parameter: Parameter) -> Option<f64> {
        self.index_of(parameter).map(|index| self.values[index])
    }

    /// Returns a parameter's standard deviation in its unit.
    pub fn std(&self, parameter: Parameter) -> Option<f64> {
        self.index_of(parameter).map(|index| self.covariance_at(index, index).max(0.0).sqrt())
    }

    /// Returns the covariance of the values at two places.
    ///
    /// # Panics
    ///
    /// When a place is [`PARAMETERS_MAX`] or more.
    pub const fn covariance_at(&self, i: usize, j: usize) -> f64 {
        self.covariance[packed_index(i, j)]
    }
}

/// Returns where the entry (i, j) of a symmetric matrix lies in its lower triangle packed by rows.
pub const fn packed_index(i: usize, j: usize) -> usize {
    let (row, column) = if i >= j { (i, j) } else { (j, i) };
    row * (row + 1) / 2 + column
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_packed_triangle_is_symmetric_and_dense() {
        let mut seen = [false; COVARIANCE_ENTRIES];
        for i in 0..PARAMETERS_MAX {
            for j in 0..=i {
                assert_eq!(packed_index(i, j), packed_index(j, i));
                assert!(!core::mem::replace(&mut seen[packed_index(i, j)], true));
            }
        }
        assert!(seen.iter().all(|&entry| entry));
    }

    #[test]
    fn a_status_from_a_newer_peer_reads_as_invalid() {
        let mut snapshot = ParameterSnapshot::empty();
        snapshot.status = 99;
        assert_eq!(snapshot.status(), Status::Invalid);
    }
}
