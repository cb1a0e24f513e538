//! Publisher and reader as Python holds them, each end kept in the thread that opened it.
//!
//! The transport's ports belong to one thread, and Python hands its objects from thread to thread. Therefore an object
//! holds only a number, under which the end lies in a list of its own thread. Another thread that uses the object is
//! refused; one that drops it leaves the end to its own thread, which closes it when it opens the next one or ends.

use std::cell::RefCell;
use std::collections::HashMap;
use std::marker::PhantomData;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::{LocalKey, ThreadId, current};
use std::time::{Duration, Instant};

use dynocar_client::ffi::{Code, ReadingCopy};
use dynocar_client::{
    ChannelError, Host, Owner, SamplePublisher, SnapshotReader, monotonic_now_ns,
};
use dynocar_shared::services::PIPELINES_MAX;
use dynocar_shared::{PipelineKind, Quantity, SampleField, TrainId, TrainSample};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::calls::{SIGNALS_EVERY, of_channel, of_code};
use crate::snapshot::Reading;

/// `SamplePublisher` without its documentation.
#[pyclass(frozen, module = "dynocar._native")]
pub(crate) struct Publisher(Handle<SamplePublisher>);

#[pymethods]
impl Publisher {
    #[new]
    fn open(py: Python<'_>, train_id: u64, root: Option<PathBuf>) -> PyResult<Self> {
        Handle::open(py, train_id, root, SamplePublisher::open).map(Publisher)
    }

    fn start_run(&self, py: Python<'_>) -> PyResult<()> {
        self.0.with(py, SamplePublisher::start_run)
    }

    /// Publishes a sample; the values are in the order of [`SampleField`].
    fn publish(
        &self,
        py: Python<'_>,
        time_ns: Option<i64>,
        direction: i8,
        flags: u8,
        values: [Option<f64>; SampleField::ALL.len()],
    ) -> PyResult<u64> {
        let mut sample = TrainSample::empty(TrainId(0));
        sample.time_ns = time_ns.unwrap_or_else(monotonic_now_ns);
        (sample.direction, sample.flags) = (direction, flags);
        for (field, value) in SampleField::ALL.into_iter().zip(values) {
            if let Some(value) = value {
                sample.set(field, value);
            }
        }
        let sent = self.0.with(py, |publisher| publisher.publish(&mut sample))?;
        sent.map_err(|refused| of_code(py, Code::from(refused)))
    }

    /// Waits for short times, between which Ctrl-C is heard.
    fn flush(&self, py: Python<'_>, patience_s: f64) -> PyResult<u64> {
        let patience = Duration::try_from_secs_f64(patience_s.max(0.0)).unwrap_or(Duration::MAX);
        let start = Instant::now();
        loop {
            let time = SIGNALS_EVERY.min(patience.saturating_sub(start.elapsed()));
            let begun = Instant::now();
            let left = self.0.with_patience(py, move |publisher| publisher.flush(time))?;
            py.check_signals()?;
            // A result that comes back early waits for nobody.
            let is_hopeless = begun.elapsed() < time;
            if left == 0 || is_hopeless || start.elapsed() >= patience {
                return Ok(left);
            }
        }
    }

    fn close(&self, py: Python<'_>) -> PyResult<()> {
        self.0.close(py)
    }
}

/// `SnapshotReader` without its documentation.
#[pyclass(frozen, module = "dynocar._native")]
pub(crate) struct Reader(Handle<SnapshotReader>);

#[pymethods]
impl Reader {
    #[new]
    fn open(py: Python<'_>, train_id: u64, root: Option<PathBuf>) -> PyResult<Self> {
        Handle::open(py, train_id, root, SnapshotReader::open).map(Reader)
    }

    fn set_stale_after_ns(&self, py: Python<'_>, stale_after_ns: i64) -> PyResult<()> {
        if stale_after_ns <= 0 {
            return Err(of_code(py, Code::BadNumber));
        }
        self.0.with(py, |reader| reader.set_stale_after_ns(stale_after_ns))
    }

    fn poll(&self, py: Python<'_>) -> PyResult<usize> {
        self.0.with(py, SnapshotReader::poll)
    }

    fn quantity(&self, py: Python<'_>, number: u32, now_ns: Option<i64>) -> PyResult<Reading> {
        let quantity = Quantity::from_number(number).ok_or_else(|| of_code(py, Code::BadNumber))?;
        self.pick(py, now_ns, |reader, now_ns| Ok(reader.quantity(quantity, now_ns)?.into()))
    }

    fn latest(&self, py: Python<'_>, number: u32, now_ns: Option<i64>) -> PyResult<Reading> {
        let kind = PipelineKind::from_number(number).ok_or_else(|| of_code(py, Code::BadNumber))?;
        self.pick(py, now_ns, |reader, now_ns| {
            reader.latest(kind, now_ns).map(ReadingCopy::from).ok_or(Code::NoSnapshot)
        })
    }

    fn latest_by_index(
        &self,
        py: Python<'_>,
        index: u32,
        now_ns: Option<i64>,
    ) -> PyResult<Reading> {
        if index as usize >= PIPELINES_MAX {
            return Err(of_code(py, Code::BadNumber));
        }
        self.pick(py, now_ns, |reader, now_ns| {
            let found = reader.readings(now_ns).find(|it| it.snapshot.pipeline_index == index);
            found.map(ReadingCopy::from).ok_or(Code::NoSnapshot)
        })
    }

    fn refused(&self, py: Python<'_>) -> PyResult<u64> {
        self.0.with(py, |reader| reader.refused())
    }

    fn close(&self, py: Python<'_>) -> PyResult<()> {
        self.0.close(py)
    }
}

impl Reader {
    /// Returns a reading, or the code that says why there is none.
    fn pick(
        &self,
        py: Python<'_>,
        now_ns: Option<i64>,
        pick: impl FnOnce(&SnapshotReader, i64) -> Result<ReadingCopy, Code>,
    ) -> PyResult<Reading> {
        let now_ns = now_ns.unwrap_or_else(monotonic_now_ns);
        let picked = self.0.with(py, |reader| pick(reader, now_ns))?;
        Ok(match picked {
            Ok(copy) => Reading { code: Code::Ok, copy },
            Err(code) => Reading { code, copy: ReadingCopy::none() },
        })
    }
}

/// The ends of a kind that a thread opened, by their numbers.
type Ends<E> = RefCell<HashMap<u64, E>>;

thread_local! {
    static PUBLISHERS: Ends<SamplePublisher> = RefCell::default();
    static READERS: Ends<SnapshotReader> = RefCell::default();
}

static NUMBERS: AtomicU64 = AtomicU64::new(0);
/// Owners and numbers of ends that another thread dropped.
static DROPPED_ELSEWHERE: Mutex<Vec<(ThreadId, u64)>> = Mutex::new(Vec::new());

/// A kind of end.
pub(crate) trait End: Sized + 'static {
    /// Name in messages.
    const NAME: &'static str;

    /// Returns those that this thread opened.
    fn of_this_thread() -> &'static LocalKey<Ends<Self>>;
}

impl End for SamplePublisher {
    const NAME: &'static str = "publisher";

    fn of_this_thread() -> &'static LocalKey<Ends<Self>> {
        &PUBLISHERS
    }
}

impl End for SnapshotReader {
    const NAME: &'static str = "reader";

    fn of_this_thread() -> &'static LocalKey<Ends<Self>> {
        &READERS
    }
}

/// Handle of an object to its end of the channel.
pub(crate) struct Handle<E: End> {
    process: Owner,
    owner: ThreadId,
    number: u64,
    end: PhantomData<fn() -> E>,
}

impl<E: End> Handle<E> {
    /// Opens an end for a train.
    pub(crate) fn open(
        py: Python<'_>,
        train_id: u64,
        root: Option<PathBuf>,
        make: fn(&Host, TrainId) -> Result<E, ChannelError>,
    ) -> PyResult<Self> {
        let number = NUMBERS.fetch_add(1, Ordering::Relaxed);
        let opened: Result<(), ChannelError> = py.detach(move || {
            close_dropped_ends();
            let host = Host::of(root.as_deref())?;
            let end = make(&host, TrainId(train_id))?;
            E::of_this_thread().with_borrow_mut(|ends| ends.insert(number, end));
            Ok(())
        });
        opened.map_err(|error| of_channel(py, &error))?;
        let (process, owner) = (Owner::current(), current().id());
        Ok(Handle { process, owner, number, end: PhantomData })
    }

    /// Works with the end; `work` calls nothing of Python, which may drop other ends meanwhile.
    pub(crate) fn with<R>(&self, py: Python<'_>, work: impl FnOnce(&mut E) -> R) -> PyResult<R> {
        self.require_owner(py)?;
        let done = E::of_this_thread().with_borrow_mut(|ends| ends.get_mut(&self.number).map(work));
        done.ok_or_else(|| PyValueError::new_err(format!("the {} is closed", E::NAME)))
    }

    /// Returns the same where it may take time: other threads of Python go on meanwhile.
    pub(crate) fn with_patience<R: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut E) -> R + Send,
    ) -> PyResult<R> {
        self.require_owner(py)?;
        let number = self.number;
        let done = py.detach(move || {
            E::of_this_thread().with_borrow_mut(|ends| ends.get_mut(&number).map(work))
        });
        done.ok_or_else(|| PyValueError::new_err(format!("the {} is closed", E::NAME)))
    }

    /// Closes the end; a closed one stays closed.
    pub(crate) fn close(&self, py: Python<'_>) -> PyResult<()> {
        self.require_owner(py)?;
        let number = self.number;
        py.detach(move || close::<E>(number));
        Ok(())
    }

    fn require_owner(&self, py: Python<'_>) -> PyResult<()> {
        if !self.process.is_this_process() {
            return Err(of_code(py, Code::ForkedProcess));
        }
        if self.owner == current().id() { Ok(()) } else { Err(of_code(py, Code::WrongThread)) }
    }
}

impl<E: End> Drop for Handle<E> {
    fn drop(&mut self) {
        if self.owner == current().id() {
            close::<E>(self.number);
        } else if let Ok(mut dropped) = DROPPED_ELSEWHERE.lock() {
            dropped.push((self.owner, self.number));
        }
    }
}

/// Closes an end of this thread, if it is there still.
fn close<E: End>(number: u64) {
    // A thread that is ending has closed its ends.
    let end = E::of_this_thread().try_with(|ends| ends.borrow_mut().remove(&number));
    // Closing a publisher may wait, so the list is free again by then.
    drop(end);
}

fn close_dropped_ends() {
    let own = current().id();
    let Ok(mut dropped) = DROPPED_ELSEWHERE.lock() else { return };
    let numbers: Vec<u64> =
        dropped.extract_if(.., |(owner, _)| *owner == own).map(|(_, number)| number).collect();
    drop(dropped);
    for number in numbers {
        close::<SamplePublisher>(number);
        close::<SnapshotReader>(number);
    }
}
