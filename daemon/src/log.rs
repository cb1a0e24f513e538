//! The daemon's log: lines in a bounded queue, which a thread of its own writes to standard error.
//!
//! A reader of the log may stand still, and a full pipe blocks every writer. Therefore only that thread writes: a line
//! that finds the queue full is dropped, and the log reports how many were.

use std::io::{self, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::time::{Duration, Instant};

use tracing_subscriber::fmt::MakeWriter;

use crate::output::report_line;

/// Lines that fit into every queue: the log of some minutes.
const LINES_MIN: usize = 1024;
/// Stack of the thread that writes: it may be locked into memory.
const STACK_BYTES: usize = 64 * 1024;
/// How long an ending program waits for its last lines to be taken.
const PATIENCE: Duration = Duration::from_millis(500);

/// Where lines are queued.
#[derive(Clone, Debug)]
pub struct Queue {
    lines: SyncSender<Vec<u8>>,
    counts: Arc<Counts>,
}

#[derive(Debug, Default)]
struct Counts {
    waiting: AtomicU64,
    dropped: AtomicU64,
}

impl Queue {
    /// Starts the thread that writes; `burst` is the most lines that are said at once.
    ///
    /// # Errors
    ///
    /// When the system gives no thread.
    pub fn start(burst: usize) -> io::Result<Self> {
        let (lines, queued) = sync_channel(LINES_MIN + burst);
        let counts = Arc::new(Counts::default());
        let of_thread = Arc::clone(&counts);
        let builder = std::thread::Builder::new().name("log".into()).stack_size(STACK_BYTES);
        builder.spawn(move || write_all(&queued, &of_thread))?;
        Ok(Queue { lines, counts })
    }
}

/// The log of a program; when it is dropped, the last lines are waited for, a short time at most.
#[derive(Debug)]
pub struct Log(pub Queue);

impl Drop for Log {
    fn drop(&mut self) {
        let start = Instant::now();
        while self.0.counts.waiting.load(Ordering::Acquire) > 0 && start.elapsed() < PATIENCE {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

fn write_all(queued: &Receiver<Vec<u8>>, counts: &Counts) {
    for line in queued {
        // A log that cannot be written is reported nowhere, and ends no daemon.
        let _ = io::stderr().lock().write_all(&line);
        let dropped = counts.dropped.swap(0, Ordering::Relaxed);
        if dropped > 0 {
            report_line(&format!(
                "dynocar: {dropped} lines of the log were dropped: nobody took them from standard error"
            ));
        }
        counts.waiting.fetch_sub(1, Ordering::Release);
    }
}

impl Write for Queue {
    /// Takes a line as a whole; never waits.
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        self.counts.waiting.fetch_add(1, Ordering::Relaxed);
        if let Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) =
            self.lines.try_send(line.to_vec())
        {
            self.counts.waiting.fetch_sub(1, Ordering::Release);
            self.counts.dropped.fetch_add(1, Ordering::Relaxed);
        }
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl<'a> MakeWriter<'a> for Queue {
    type Writer = Queue;

    fn make_writer(&'a self) -> Queue {
        self.clone()
    }
}
