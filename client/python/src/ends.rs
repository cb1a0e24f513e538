//! Ends of channels, each kept in the thread that opened it.
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

use dynocar_client::ffi::Code;
use dynocar_client::{ChannelError, Host, Owner, SamplePublisher, SnapshotReader};
use dynocar_shared::TrainId;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::calls::{of_channel, of_code};

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
