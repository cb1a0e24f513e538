//! The calls that `dynocar.h` marks REAL-TIME allocate no more than it states and make no system call.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::ffi::CString;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::process::ExitStatusExt;
use std::process::Command;
use std::ptr::null_mut;

use dynocar_client::ffi::publisher::*;
use dynocar_client::ffi::reader::*;
use dynocar_client::ffi::snapshot::*;
use dynocar_client::ffi::{ReadingCopy, ResistanceAtSpeed, about, error};
use dynocar_shared::{PipelineKind, Quantity, TrainSample};

use crate::support::{Link, PlayedDaemon, Program, TRAIN, client_directory};

struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
    static BYTES: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: every call goes on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // A thread that is being torn down is not measured.
        let _ = ALLOCATIONS.try_with(|count| count.set(count.get() + 1));
        let _ = BYTES.try_with(|bytes| bytes.set(bytes.get() + layout.size()));
        // SAFETY: promised by the caller.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, index: *mut u8, layout: Layout) {
        // SAFETY: promised by the caller.
        unsafe { System.dealloc(index, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Number and bytes of the allocations during a call, which must succeed.
fn allocations_of(call: impl FnOnce() -> i32) -> (u64, usize) {
    let before = (ALLOCATIONS.get(), BYTES.get());
    let code = call();
    let after = (ALLOCATIONS.get(), BYTES.get());
    assert_eq!(code, 0);
    (after.0 - before.0, after.1 - before.1)
}

struct Ends {
    daemon: PlayedDaemon,
    publisher: *mut PublisherHandle,
    reader: *mut ReaderHandle,
}

fn open() -> Ends {
    let daemon = PlayedDaemon::start();
    let root = CString::new(daemon.root().as_os_str().as_bytes()).unwrap();
    let (mut publisher, mut reader) = (null_mut(), null_mut());
    // SAFETY: all pointers are of living objects.
    unsafe {
        let root = root.as_ptr();
        assert_eq!(dynocar_publisher_open(root, TRAIN.0, &mut publisher, null_mut(), 0), 0);
        assert_eq!(dynocar_reader_open(root, TRAIN.0, &mut reader, null_mut(), 0), 0);
    }
    Ends { daemon, publisher, reader }
}

/// One control cycle; gives the allocations of publishing and of each other real-time call.
fn cycle(ends: &Ends) -> ((u64, usize), [(u64, usize); 6]) {
    let mut sample = TrainSample::empty(TRAIN);
    let mut reading = ReadingCopy::none();
    let mut resistance = ResistanceAtSpeed::default();
    let kind = PipelineKind::ResistanceKalman as u32;
    let quantity = Quantity::Resistance as u32;
    // SAFETY: the handles are open and of this thread, all other pointers of living objects.
    let counts = unsafe {
        let publish = allocations_of(|| dynocar_publisher_publish(ends.publisher, &mut sample));
        ends.daemon.answer(&ends.daemon.next_sample().unwrap());
        let now_ns = about::dynocar_monotonic_now_ns();
        let others = [
            allocations_of(|| dynocar_publisher_start_run(ends.publisher)),
            allocations_of(|| dynocar_reader_poll(ends.reader, null_mut())),
            allocations_of(|| dynocar_reader_latest(ends.reader, kind, now_ns, &mut reading)),
            allocations_of(|| dynocar_reader_quantity(ends.reader, quantity, now_ns, &mut reading)),
            allocations_of(|| {
                dynocar_snapshot_resistance(&reading.snapshot, 20.0, 1e5, &mut resistance)
            }),
            allocations_of(|| {
                error::dynocar_code_text(0);
                about::dynocar_status_name(reading.status);
                0
            }),
        ];
        (publish, others)
    };
    assert!(resistance.force_n > 0.0);
    assert_eq!(reading.snapshot.sample_sequence, sample.sequence);
    counts
}

#[test]
fn only_publishing_allocates_and_that_once_and_little() {
    let ends = open();
    // The first cycles connect the ends.
    for _ in 0..10 {
        cycle(&ends);
    }
    for number in 0..2000 {
        let ((count, bytes), others) = cycle(&ends);
        assert!(count <= 1 && bytes <= 128, "cycle {number}: {count} allocations, {bytes} bytes");
        assert_eq!(others, [(0, 0); 6], "cycle {number}");
    }
    // SAFETY: the handles are given up here.
    let codes =
        unsafe { [dynocar_publisher_close(ends.publisher), dynocar_reader_close(ends.reader)] };
    assert_eq!(codes, [0, 0]);
}

#[test]
fn a_cycle_makes_no_system_call() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("program");
    let source = client_directory().join("tests/foreign/no_system_call.c");
    crate::support::build_c(&source, "c11", Link::Static, &path);
    let clock = Command::new(&path).arg("clock").output().unwrap();
    const SIGNAL_OF_A_FORBIDDEN_CALL: i32 = 31;
    if clock.status.signal() == Some(SIGNAL_OF_A_FORBIDDEN_CALL) || clock.status.code() == Some(1) {
        println!("the clock needs a system call here, or seccomp is not allowed: NOT tested");
        return;
    }
    assert_eq!(clock.stdout, b"clean clock\n", "{}", clock.status);
    let daemon = PlayedDaemon::start();
    let mut command = Command::new(&path);
    let program = Program::start(command.arg(daemon.root()).arg(TRAIN.to_string()));
    let line = program.next_line(|| {
        while let Some(sample) = daemon.next_sample() {
            daemon.answer(&sample);
        }
    });
    assert_eq!(line.as_deref(), Some("clean cycles"));
    program.finish();
}
