//! The count of a train's samples: a page that its controllers and its daemon share.
//!
//! The controller writes the number of each sample before and after it hands the sample to the channel; the next
//! controller counts on from there. Thus a daemon knows the first number of which it could have seen the sample and,
//! when nobody drives the train any more, the last; and a controller knows which samples the pipeline threads have not
//! taken yet. Each number has one writer; the page outlives each of its users, and the last one removes it.

use std::fs::OpenOptions;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::Path;
use std::ptr::NonNull;
use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::{Acquire, Release};

use dynocar_shared::{SCHEMA_MAJOR, TrainId, TrainSample};
use rustix::fs::{FallocateFlags, OFlags};
use rustix::io::Errno;
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};

use super::service::Payload;
use super::users::{COUNT_SUFFIX as SUFFIX, Users, full};
use crate::announcement::SHARED_MEMORY;
use crate::error::ChannelError;
use crate::host::{Host, unusable};

/// Pipeline threads that a page has room for: as many as can receive a train's samples.
const THREADS_MAX: usize = TrainSample::RECEIVERS_MAX;
/// Largest number that a controller can have counted up to.
const NUMBER_MAX: u64 = u64::MAX / 2;

const BYTES: usize = 4096;
const _: () = assert!(size_of::<Page>() <= BYTES);

/// A number with a cache line of its own, for it has a writer of its own.
#[derive(Debug)]
#[repr(C, align(64))]
struct CacheLine<T>(T);

#[derive(Debug)]
#[repr(C)]
struct Page {
    published: CacheLine<Published>,
    served: CacheLine<Served>,
    taken: [CacheLine<AtomicU64>; THREADS_MAX],
}

/// Written by the controller.
#[derive(Debug)]
#[repr(C)]
struct Published {
    begun: AtomicU64,
    sent: AtomicU64,
}

/// Written by the daemon's main thread.
#[derive(Debug)]
#[repr(C)]
struct Served {
    threads: AtomicU64,
    pipelines: AtomicU64,
    ended: AtomicU64,
}

/// The count of one train's samples, by their sequence numbers.
#[derive(Debug)]
pub struct SampleCount {
    page: NonNull<Page>,
    /// After the page: the last user removes it.
    _users: Users,
}

// SAFETY: the page holds atomic numbers only, and stays mapped while the value lives.
unsafe impl Send for SampleCount {}
// SAFETY: as above.
unsafe impl Sync for SampleCount {}

impl SampleCount {
    /// Opens the page of a train, and makes it when nobody has.
    ///
    /// # Errors
    ///
    /// When the shared memory cannot be used.
    pub fn open(host: &Host, train: TrainId) -> Result<Self, ChannelError> {
        let users = Users::enter(host)?;
        users.require_free_memory()?;
        let name = format!("{}v{SCHEMA_MAJOR}_train_{train}{SUFFIX}", host.segment_prefix());
        let path = Path::new(SHARED_MEMORY).join(name);
        let page = map(&path).map_err(|source| match source.raw_os_error() {
            Some(code) if code == Errno::NOSPC.raw_os_error() => full(0, BYTES as u64),
            _ => unusable(&path, "mapping")(source),
        })?;
        Ok(SampleCount { page, _users: users })
    }

    fn page(&self) -> &Page {
        // SAFETY: mapped, and not unmapped before the value is dropped.
        unsafe { self.page.as_ref() }
    }

    /// The controller is about to publish the sample of this number.
    ///
    /// # Real-time
    ///
    /// This and every call below is a plain load or store, without a system call.
    pub fn begin(&self, sequence: u64) {
        self.page().published.0.begun.store(sequence, Release);
    }

    /// The channel has taken, or refused, the sample of this number.
    pub fn finish(&self, sequence: u64) {
        self.page().published.0.sent.store(sequence, Release);
    }

    /// Returns the greatest number that a controller has begun to publish; the next one counts on from it.
    pub fn begun(&self) -> u64 {
        number(&self.page().published.0.begun)
    }

    /// Returns the greatest number that a controller has published: a receiver that begins now misses the samples up to
    /// it, and could see the samples after it.
    pub fn sent(&self) -> u64 {
        number(&self.page().published.0.sent)
    }

    /// Announces that the daemon serves the train with `threads` threads and `pipelines` pipelines.
    pub fn serve(&self, threads: usize, pipelines: usize) {
        let served = &self.page().served.0;
        served.threads.store(threads as u64, Release);
        served.pipelines.store(pipelines as u64, Release);
    }

    /// Returns the pipelines of the newest daemon.
    pub fn pipelines(&self) -> usize {
        number(&self.page().served.0.pipelines) as usize
    }

    /// The publisher of the samples up to this number is gone: those that have not come are lost.
    pub fn end(&self, sequence: u64) {
        self.page().served.0.ended.store(sequence, Release);
    }

    /// Returns the last number, once everybody is gone who published a sample.
    pub fn ended(&self) -> Option<u64> {
        let ended = number(&self.page().served.0.ended);
        (ended == self.begun()).then_some(ended)
    }

    /// A pipeline thread of the daemon has taken the samples up to this number.
    pub fn note_taken(&self, thread: usize, sequence: u64) {
        if let Some(taken) = self.page().taken.get(thread) {
            taken.0.store(sequence, Release);
        }
    }

    /// Returns the samples published that the slowest pipeline thread has not taken; `None` where there never
    /// was one.
    pub fn untaken(&self) -> Option<u64> {
        let page = self.page();
        let threads = (number(&page.served.0.threads) as usize).min(THREADS_MAX);
        let least = page.taken[..threads].iter().map(|taken| number(&taken.0)).min()?;
        Some(self.sent().saturating_sub(least))
    }
}

impl Drop for SampleCount {
    fn drop(&mut self) {
        // SAFETY: mapped by `map` with this length; nobody holds a reference any more. A mapping that cannot be
        // removed stays until the process ends.
        let _ = unsafe { munmap(self.page.as_ptr().cast(), BYTES) };
    }
}

/// Returns the count at a place; memory that was never written reads as a count that has not begun.
fn number(place: &AtomicU64) -> u64 {
    let number = place.load(Acquire);
    if number <= NUMBER_MAX { number } else { 0 }
}

/// Maps a file of this user's as a page, filled with zeros when it is new; its memory is reserved,
/// so that no later touch can end the process.
fn map(path: &Path) -> std::io::Result<NonNull<Page>> {
    let file = OpenOptions::new()
        .read(true)
        .write(true)
        .create(true)
        .truncate(false)
        .mode(0o600)
        .custom_flags(OFlags::NOFOLLOW.bits() as i32)
        .open(path)?;
    if file.metadata()?.uid() != rustix::process::geteuid().as_raw() {
        return Err(std::io::ErrorKind::PermissionDenied.into());
    }
    rustix::fs::fallocate(&file, FallocateFlags::empty(), 0, BYTES as u64)?;
    let access = ProtFlags::READ | ProtFlags::WRITE;
    let flags = MapFlags::SHARED | MapFlags::POPULATE;
    // SAFETY: a new mapping at a place of the system's choice, as long as the file at least.
    let place = unsafe { mmap(std::ptr::null_mut(), BYTES, access, flags, &file, 0) }?;
    NonNull::new(place.cast()).ok_or(std::io::ErrorKind::OutOfMemory.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRAIN: TrainId = TrainId(3);

    #[test]
    fn the_next_user_reads_on_and_the_last_one_leaves_nothing() {
        let directory = tempfile::tempdir().unwrap();
        let host = Host::at(directory.path()).unwrap();
        let segments = || {
            let prefix = host.segment_prefix();
            let names = std::fs::read_dir(SHARED_MEMORY).unwrap().flatten();
            names.filter(|it| it.file_name().to_string_lossy().starts_with(&prefix)).count()
        };
        let first = SampleCount::open(&host, TRAIN).unwrap();
        assert_eq!((first.begun(), first.sent(), first.untaken()), (0, 0, None));
        first.begin(8);
        first.finish(7);
        let second = SampleCount::open(&host, TRAIN).unwrap();
        drop(first);
        assert_eq!((second.begun(), second.sent()), (8, 7));
        assert_eq!(SampleCount::open(&host, TrainId(4)).unwrap().begun(), 0);
        assert_eq!(segments(), 2);
        drop(second);
        assert_eq!(segments(), 0);
    }

    #[test]
    fn the_slowest_thread_says_what_is_not_taken() {
        let directory = tempfile::tempdir().unwrap();
        let count = SampleCount::open(&Host::at(directory.path()).unwrap(), TRAIN).unwrap();
        count.finish(100);
        count.serve(2, 5);
        count.note_taken(0, 100);
        count.note_taken(1, 60);
        count.note_taken(THREADS_MAX, 1);
        assert_eq!((count.untaken(), count.pipelines()), (Some(40), 5));
        count.begin(101);
        count.end(100);
        assert_eq!(count.ended(), None, "somebody publishes");
        count.end(101);
        assert_eq!(count.ended(), Some(101));
        count.begin(u64::MAX);
        assert_eq!(count.begun(), 0, "no controller of ours counts up to that");
    }
}
