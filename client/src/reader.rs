//! The end from which a controller polls snapshots, and the pipelines that answer the quantities, as the snapshots
//! state them.

use dynocar_shared::services::PIPELINES_MAX;
use dynocar_shared::snapshot::PARAMETERS_MAX;
use dynocar_shared::{
    ParameterSnapshot, PipelineKind, Quantity, Reason, Status, TrainId, UseState,
};

use dynocar_transport::channel::{Receiver, Transport};
use dynocar_transport::{ChannelError, Host, Peer, Role, monotonic_now_ns};

/// A snapshot older than this counts as stale, in ns. The daemon republishes every 50 ms.
pub const STALE_AFTER_NS: i64 = 250_000_000;

/// Largest lead in ns of a time that this host's clock can have given.
const CLOCK_TOLERANCE_NS: i64 = 1_000_000_000;

/// Reads the newest snapshot of each pipeline of one train.
///
/// # Examples
///
/// ```
/// use dynocar_client::{Host, NoAnswer, SnapshotReader, monotonic_now_ns};
/// use dynocar_shared::TrainId;
///
/// # let folder = tempfile::tempdir()?;
/// # let host = Host::at(&folder.path().join("root"))?;
/// let mut reader = SnapshotReader::open(&host, TrainId(1))?;
/// // No daemon runs here yet: the controller goes on with its own parameters, and polls again.
/// assert_eq!(reader.poll(), 0);
/// assert_eq!(reader.mass(monotonic_now_ns()).err(), Some(NoAnswer::NoSnapshot));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct SnapshotReader {
    host: Host,
    train: TrainId,
    receiver: Receiver<ParameterSnapshot>,
    latest: Box<[Option<ParameterSnapshot>; PIPELINES_MAX]>,
    answers: Answers,
    stale_after_ns: i64,
    refused: u64,
}

/// A snapshot with its age.
///
/// # Examples
///
/// ```
/// use dynocar_client::Reading;
/// use dynocar_shared::{Parameter, ParameterSnapshot};
///
/// /// Returns the mass in t that a controller uses.
/// fn mass_t(reading: &Reading, built_in_t: f64) -> f64 {
///     let learned_t = reading.snapshot.value(Parameter::Mass);
///     learned_t.filter(|_| reading.is_usable()).unwrap_or(built_in_t)
/// }
///
/// let snapshot = ParameterSnapshot::empty();
/// let silent = Reading { snapshot: &snapshot, age_ns: 1_000_000_000, is_stale: true, quantity: None };
/// assert_eq!(mass_t(&silent, 412.0), 412.0);
/// assert_eq!(silent.why(), "daemon_silent");
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Reading<'a> {
    /// The snapshot.
    pub snapshot: &'a ParameterSnapshot,
    /// Time in ns since the daemon last vouched for it.
    pub age_ns: i64,
    /// True when the daemon has been silent for too long.
    pub is_stale: bool,
    /// Quantity that was asked for; `None` where a pipeline was.
    pub quantity: Option<Quantity>,
}

impl Reading<'_> {
    /// Returns the estimate's status; invalid while the daemon is silent.
    pub fn status(&self) -> Status {
        if self.is_stale { Status::Invalid } else { self.snapshot.status() }
    }

    /// Returns the reason for the status; `None` for a reason that only a newer peer knows.
    pub fn reason(&self) -> Option<Reason> {
        if self.is_stale { Some(Reason::DaemonSilent) } else { self.snapshot.reason() }
    }

    /// Returns whether a controller may use the values for its request; else it falls back to its own parameters. The
    /// daemon decides that, with hysteresis, so that a controller can switch on it: `docs/guides/reading.md` states the
    /// promise behind it and its delay. Of a pipeline that was requested by its kind, all quantities that it answers
    /// have to be usable.
    pub fn is_usable(&self) -> bool {
        let it = self.snapshot;
        let is_current = self.status() != Status::Invalid;
        is_current
            && match self.quantity {
                Some(quantity) => it.is_usable_for(quantity),
                None => {
                    let usable = it.usable_quantities;
                    usable != 0 && it.quantities & !usable == 0
                }
            }
    }

    /// Returns the state of use of the request, in one word.
    pub fn use_state(&self) -> UseState {
        UseState::of(self.status(), self.is_usable())
    }

    /// Returns the reason for the state of use, in one word: the reason behind the status, or `confirming` for values
    /// that are known but held back. Only usable values have `none`.
    pub fn why(&self) -> &'static str {
        self.use_state().why(self.reason())
    }
}

impl SnapshotReader {
    /// Opens the snapshot channel of a train. The daemon need not run yet.
    ///
    /// # Errors
    ///
    /// When the daemon there is incompatible, or when the shared memory cannot be used.
    pub fn open(host: &Host, train: TrainId) -> Result<Self, ChannelError> {
        Peer::look_up(host, train, Role::Daemon)?.require_compatible(train, Role::Controller)?;
        let transport = Transport::open(host, "dynocar-reader")?;
        let receiver = transport.receiver::<ParameterSnapshot>(train)?;
        transport.reserve()?;
        Ok(SnapshotReader {
            host: host.clone(),
            train,
            receiver,
            latest: Box::new([None; PIPELINES_MAX]),
            answers: Answers::default(),
            stale_after_ns: STALE_AFTER_NS,
            refused: 0,
        })
    }

    /// Sets the age in ns from which a snapshot counts as stale.
    pub fn set_stale_after_ns(&mut self, stale_after_ns: i64) {
        self.stale_after_ns = stale_after_ns;
    }

    /// Takes the messages since the last poll; returns the number of snapshots that brought something new.
    ///
    /// # Real-time
    ///
    /// Never waits; at most a few messages of each pipeline are taken. No system call and no
    /// allocation while no process comes or goes.
    pub fn poll(&mut self) -> usize {
        let mut news = 0;
        for _ in 0..4 * PIPELINES_MAX {
            match self.receiver.receive() {
                Some(snapshot) => news += usize::from(self.take(&snapshot)),
                None => break,
            }
        }
        news
    }

    /// Returns the newest snapshot of the pipeline that answers a quantity, by the daemon's configuration;
    /// `now_ns` is the host's monotonic clock.
    ///
    /// # Errors
    ///
    /// [`NoAnswer`], when nothing has come yet or no pipeline answers the quantity.
    ///
    /// # Real-time
    ///
    /// No search, no system call, no allocation; so are the methods named after a quantity.
    pub fn quantity(&self, quantity: Quantity, now_ns: i64) -> Result<Reading<'_>, NoAnswer> {
        let index = self.answers.index(quantity)?;
        let snapshot = self.latest[index].as_ref().ok_or(NoAnswer::NoSnapshot)?;
        Ok(self.reading(snapshot, Some(quantity), now_ns))
    }

    /// Basic resistance, see [`ParameterSnapshot::resistance_at`]; as [`Self::quantity`].
    ///
    /// # Errors
    ///
    /// See [`Self::quantity`].
    pub fn resistance(&self, now_ns: i64) -> Result<Reading<'_>, NoAnswer> {
        self.quantity(Quantity::Resistance, now_ns)
    }

    /// Returns the gross mass, parameter `Mass` in t; as [`Self::quantity`].
    ///
    /// # Errors
    ///
    /// See [`Self::quantity`].
    pub fn mass(&self, now_ns: i64) -> Result<Reading<'_>, NoAnswer> {
        self.quantity(Quantity::Mass, now_ns)
    }

    /// Adhesion, parameter `Adhesion` or `AdhesionLowerBound`; as [`Self::quantity`].
    ///
    /// # Errors
    ///
    /// See [`Self::quantity`].
    pub fn adhesion(&self, now_ns: i64) -> Result<Reading<'_>, NoAnswer> {
        self.quantity(Quantity::Adhesion, now_ns)
    }

    /// Friction of the brake discs, parameter `DiscFriction`; as [`Self::quantity`].
    ///
    /// # Errors
    ///
    /// See [`Self::quantity`].
    pub fn brake_friction(&self, now_ns: i64) -> Result<Reading<'_>, NoAnswer> {
        self.quantity(Quantity::BrakeFriction, now_ns)
    }

    /// Braking ratio, parameter `BrakingRatio`; as [`Self::quantity`].
    ///
    /// # Errors
    ///
    /// See [`Self::quantity`].
    pub fn braking_ratio(&self, now_ns: i64) -> Result<Reading<'_>, NoAnswer> {
        self.quantity(Quantity::BrakingRatio, now_ns)
    }

    /// Returns the newest snapshot of the first pipeline of a kind; `now_ns` is the host's monotonic
    /// clock.
    pub fn latest(&self, kind: PipelineKind, now_ns: i64) -> Option<Reading<'_>> {
        self.readings(now_ns).find(|reading| reading.snapshot.pipeline_kind == kind as u32)
    }

    /// Returns the newest snapshot of every pipeline, by the pipeline's number in the configuration.
    pub fn readings(&self, now_ns: i64) -> impl Iterator<Item = Reading<'_>> {
        self.latest.iter().flatten().map(move |snapshot| self.reading(snapshot, None, now_ns))
    }

    fn reading<'a>(
        &self,
        snapshot: &'a ParameterSnapshot,
        quantity: Option<Quantity>,
        now_ns: i64,
    ) -> Reading<'a> {
        let age_ns = now_ns.saturating_sub(snapshot.vouched_ns);
        Reading { snapshot, age_ns, is_stale: age_ns > self.stale_after_ns, quantity }
    }

    /// Messages that no daemon of ours would send: foreign train, number out of range, NaN, a time
    /// in the future.
    pub fn refused(&self) -> u64 {
        self.refused
    }

    /// Returns who serves the train now. Opens a file: call it outside the control cycle.
    ///
    /// # Errors
    ///
    /// When the announcement cannot be read.
    pub fn daemon(&self) -> Result<Peer, ChannelError> {
        Peer::look_up(&self.host, self.train, Role::Daemon)
    }

    /// Returns true for a snapshot that a daemon of ours may send: of this train, with numbers in range, all finite,
    /// and not vouched for in the future, since such a snapshot would never grow old.
    fn is_plausible(&self, it: &ParameterSnapshot) -> bool {
        let statistics = [
            it.innovation_normalised,
            it.innovation_mean_square,
            it.innovation_correlation,
            it.unexplained_force_n,
            it.unexplained_force_std_n,
            it.suspicion_evidence,
            it.speed_min_mps,
            it.speed_max_mps,
        ];
        let latest_ns = monotonic_now_ns().saturating_add(CLOCK_TOLERANCE_NS);
        it.train_id == self.train.0
            && (it.pipeline_index as usize) < PIPELINES_MAX
            && it.parameter_count as usize <= PARAMETERS_MAX
            && it.values.iter().chain(&it.covariance).chain(&statistics).all(|it| it.is_finite())
            && it.vouched_ns <= latest_ns
            && i64::try_from(it.epoch).is_ok_and(|epoch| epoch <= latest_ns)
    }

    /// Keeps a snapshot unless it is older than the one we have: connections to a daemon that
    /// died are drained before those to its successor.
    fn take(&mut self, snapshot: &ParameterSnapshot) -> bool {
        if !self.is_plausible(snapshot) {
            self.refused += 1;
            return false;
        }
        let slot = &mut self.latest[snapshot.pipeline_index as usize];
        let order = |it: &ParameterSnapshot| (it.epoch, it.sequence, it.vouched_ns);
        let before = slot.as_ref().map(order);
        if before.is_some_and(|before| order(snapshot) <= before) {
            return false;
        }
        *slot = Some(*snapshot);
        self.answers.learn(snapshot);
        before.is_none_or(|(epoch, sequence, _)| {
            (snapshot.epoch, snapshot.sequence) > (epoch, sequence)
        })
    }
}

/// Why there is no reading of a quantity.
///
/// # Examples
///
/// ```
/// use dynocar_client::NoAnswer;
///
/// let may_come = |why: NoAnswer| why == NoAnswer::NoSnapshot;
/// assert!(may_come(NoAnswer::NoSnapshot) && !may_come(NoAnswer::NotProvided));
/// assert_eq!(NoAnswer::NotProvided.name(), "not_provided");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoAnswer {
    /// No daemon has been heard of, or not yet the pipeline that answers.
    #[error("no snapshot of the pipeline that answers has come yet")]
    NoSnapshot,
    /// The daemon is there, and its configuration lets no pipeline answer this for the train.
    #[error("the daemon's configuration lets no pipeline answer this quantity for the train")]
    NotProvided,
}

impl NoAnswer {
    /// Returns the reason's name, in addition to those of [`dynocar_shared::Reason`].
    pub const fn name(self) -> &'static str {
        match self {
            NoAnswer::NoSnapshot => "no_snapshot",
            NoAnswer::NotProvided => "not_provided",
        }
    }
}

/// The pipelines that answer, learned from the snapshots of the newest daemon.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Answers {
    epoch: u64,
    /// Bits of the quantities that any pipeline answers; `None` before the first snapshot.
    provided: Option<u32>,
    /// Number of the pipeline that answers, by quantity.
    indices: [Option<usize>; Quantity::ALL.len()],
}

impl Answers {
    /// Takes in the quantities that a snapshot answers; another daemon may have another configuration.
    pub(crate) fn learn(&mut self, snapshot: &ParameterSnapshot) {
        if snapshot.epoch < self.epoch {
            return;
        }
        if snapshot.epoch > self.epoch {
            *self = Answers { epoch: snapshot.epoch, ..Answers::default() };
        }
        self.provided = Some(snapshot.train_quantities);
        for &quantity in Quantity::ALL {
            if snapshot.answers(quantity) {
                self.indices[quantity as usize] = Some(snapshot.pipeline_index as usize);
            }
        }
    }

    /// Returns the number of the pipeline that answers a quantity.
    pub(crate) fn index(&self, quantity: Quantity) -> Result<usize, NoAnswer> {
        let is_provided = self.provided.is_none_or(|bits| bits & quantity.bit() != 0);
        let why = if is_provided { NoAnswer::NoSnapshot } else { NoAnswer::NotProvided };
        self.indices[quantity as usize].ok_or(why)
    }
}
