//! Wrong arguments at the C interface lead to a code and words, never to a crash.

use std::ffi::{CStr, CString, c_char};
use std::fs::File;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;
use std::ptr::{null, null_mut};

use dynocar_client::ffi::about::*;
use dynocar_client::ffi::publisher::*;
use dynocar_client::ffi::reader::*;
use dynocar_client::ffi::snapshot::*;
use dynocar_client::ffi::{Code, ReadingCopy, ResistanceAtSpeed};
use dynocar_shared::{Parameter, ParameterSnapshot, PipelineKind, Status, TrainId, TrainSample};
use dynocar_transport::peer::RoleLock;
use dynocar_transport::{Announcement, Role};

use crate::support::TestRoot;

const TRAIN: u64 = 11;

fn c_path(path: &Path) -> CString {
    CString::new(path.as_os_str().as_bytes()).unwrap()
}

/// A call with a message buffer: its code and its words.
fn in_words(call: impl FnOnce(*mut c_char, usize) -> i32) -> (Code, String) {
    let mut buffer = [1 as c_char; 512];
    let code = Code::from_number(call(buffer.as_mut_ptr(), buffer.len())).unwrap();
    // SAFETY: every call ends its message with a NUL inside the buffer.
    let words = unsafe { CStr::from_ptr(buffer.as_ptr()) };
    (code, words.to_str().unwrap().to_owned())
}

fn open_publisher(root: &Path, place: &mut *mut PublisherHandle) -> (Code, String) {
    let root = c_path(root);
    // SAFETY: all pointers are of living objects.
    in_words(|text, size| unsafe {
        dynocar_publisher_open(root.as_ptr(), TRAIN, place, text, size)
    })
}

fn open_reader(root: &Path, place: &mut *mut ReaderHandle) -> (Code, String) {
    let root = c_path(root);
    // SAFETY: all pointers are of living objects.
    in_words(|text, size| unsafe { dynocar_reader_open(root.as_ptr(), TRAIN, place, text, size) })
}

fn close(publisher: *mut PublisherHandle, reader: *mut ReaderHandle) {
    // SAFETY: the handles are open or NULL, and given up here.
    let codes = unsafe { [dynocar_publisher_close(publisher), dynocar_reader_close(reader)] };
    assert_eq!(codes, [0, 0]);
}

#[test]
fn every_null_is_answered_with_a_code() {
    let expected = Code::NullArgument as i32;
    let snapshot = ParameterSnapshot::empty();
    let (mut number, mut resistance) = (0.0, ResistanceAtSpeed::default());
    // SAFETY: every pointer is NULL or of a living object.
    unsafe {
        assert_eq!(dynocar_publisher_open(null(), TRAIN, null_mut(), null_mut(), 0), expected);
        assert_eq!(dynocar_publisher_start_run(null_mut()), expected);
        assert_eq!(
            dynocar_publisher_publish(null_mut(), &mut TrainSample::empty(TrainId(TRAIN))),
            expected
        );
        assert_eq!(dynocar_publisher_flush(null_mut(), 1, &mut 0), expected);
        assert_eq!(dynocar_publisher_close(null_mut()), 0);
        assert_eq!(dynocar_reader_open(null(), TRAIN, null_mut(), null_mut(), 0), expected);
        assert_eq!(dynocar_reader_set_stale_after_ns(null_mut(), 1), expected);
        assert_eq!(dynocar_reader_poll(null_mut(), null_mut()), expected);
        assert_eq!(dynocar_reader_latest(null_mut(), 1, 0, null_mut()), expected);
        assert_eq!(dynocar_reader_latest_by_index(null_mut(), 1, 0, null_mut()), expected);
        assert_eq!(dynocar_reader_refused(null_mut(), &mut 0), expected);
        assert_eq!(dynocar_reader_close(null_mut()), 0);
        assert_eq!(dynocar_snapshot_resistance(null(), 1.0, 1.0, &mut resistance), expected);
        assert_eq!(dynocar_snapshot_resistance(&snapshot, 1.0, 1.0, null_mut()), expected);
        assert_eq!(dynocar_snapshot_value(null(), 1, &mut number, null_mut()), expected);
        assert_eq!(dynocar_snapshot_value(&snapshot, 1, null_mut(), null_mut()), expected);
        assert_eq!(dynocar_snapshot_covariance(null(), 1, 1, &mut number), expected);
        assert_eq!(dynocar_snapshot_covariance(&snapshot, 1, 1, null_mut()), expected);
        assert_eq!(dynocar_daemon_state(null(), TRAIN, null_mut(), null_mut(), 0), expected);
    }
}

#[test]
fn a_root_that_cannot_be_used_is_named_in_words() {
    let directory = TestRoot::new();
    let file = directory.path().join("file");
    std::fs::write(&file, "").unwrap();
    for (root, code, part) in [
        (Path::new("relative"), Code::RootName, "expected an absolute path"),
        (Path::new("/tmp/a b"), Code::RootName, "/tmp/a b"),
        (file.as_path(), Code::Directory, "making the directory failed"),
    ] {
        let (mut publisher, mut reader) = (std::ptr::dangling_mut(), std::ptr::dangling_mut());
        for (came, words) in [open_publisher(root, &mut publisher), open_reader(root, &mut reader)]
        {
            assert_eq!(came, code, "{words}");
            assert!(words.contains(part), "{words}");
        }
        assert!(publisher.is_null() && reader.is_null());
    }
}

#[test]
fn a_second_controller_learns_who_drives() {
    let directory = TestRoot::new();
    let (mut first, mut second) = (null_mut(), null_mut());
    assert_eq!(open_publisher(directory.path(), &mut first), (Code::Ok, String::new()));
    let (code, words) = open_publisher(directory.path(), &mut second);
    assert_eq!(code, Code::Occupied);
    assert!(words.starts_with("train 11: already has a controller"), "{words}");
    assert!(words.contains(&format!("process {}", std::process::id())), "{words}");
    close(first, null_mut());
    assert_eq!(open_publisher(directory.path(), &mut second).0, Code::Ok);
    close(second, null_mut());
}

#[test]
fn the_daemon_is_absent_or_compatible_or_incompatible_in_words() {
    let directory = TestRoot::new();
    let root = c_path(directory.path());
    let mut state = -1;
    let mut look_up = || {
        // SAFETY: all pointers are of living objects.
        let (code, words) = in_words(|text, size| unsafe {
            dynocar_daemon_state(root.as_ptr(), TRAIN, &mut state, text, size)
        });
        assert_eq!(code, Code::Ok);
        (state, words)
    };
    let absent = (DaemonState::Absent as i32, "no daemon serves train 11".to_owned());
    assert_eq!(look_up(), absent);

    let ours = Announcement::of_this_process(Role::Daemon);
    let lock = RoleLock::claim(&directory.host, TrainId(TRAIN), Role::Daemon).unwrap();
    assert_eq!(look_up(), (DaemonState::Compatible as i32, ours.to_string()));
    drop(lock);

    let file = directory.host.trains_directory().join(format!("{TRAIN}.daemon"));
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, text.replace("schema=1", "schema=2")).unwrap();
    let held = File::open(&file).unwrap();
    held.lock().unwrap();
    let (state, words) = look_up();
    assert_eq!(state, DaemonState::Incompatible as i32);
    assert!(words.contains("schema 2") && words.contains("schema 1"), "{words}");

    let (mut publisher, mut reader) = (null_mut(), null_mut());
    for (code, words) in [
        open_publisher(directory.path(), &mut publisher),
        open_reader(directory.path(), &mut reader),
    ] {
        assert_eq!(code, Code::IncompatibleDaemon);
        assert!(words.contains("the daemon is incompatible"), "{words}");
    }
    drop(held);
    assert_eq!(look_up(), absent);
}

#[test]
fn another_thread_is_refused_and_the_handle_stays_good() {
    let directory = TestRoot::new();
    let (mut publisher, mut reader) = (null_mut(), null_mut());
    assert_eq!(open_publisher(directory.path(), &mut publisher).0, Code::Ok);
    assert_eq!(open_reader(directory.path(), &mut reader).0, Code::Ok);
    let addresses = (publisher as usize, reader as usize);
    let elsewhere = std::thread::spawn(move || {
        let (publisher, reader) = (addresses.0 as *mut PublisherHandle, addresses.1 as *mut _);
        let mut sample = TrainSample::empty(TrainId(TRAIN));
        let mut reading = ReadingCopy::none();
        // SAFETY: the handles are alive; the other thread does not use them meanwhile.
        unsafe {
            [
                dynocar_publisher_publish(publisher, &mut sample),
                dynocar_publisher_start_run(publisher),
                dynocar_publisher_close(publisher),
                dynocar_reader_poll(reader, null_mut()),
                dynocar_reader_latest(reader, 1, 0, &mut reading),
                dynocar_reader_close(reader),
            ]
        }
    });
    assert_eq!(elsewhere.join().unwrap(), [Code::WrongThread as i32; 6]);
    let mut sample = TrainSample::empty(TrainId(TRAIN));
    // SAFETY: all pointers are of living objects.
    assert_eq!(unsafe { dynocar_publisher_publish(publisher, &mut sample) }, 0);
    assert_eq!(sample.sequence, 1);
    close(publisher, reader);
}

#[test]
fn a_reading_that_could_not_be_had_cannot_be_used() {
    let directory = TestRoot::new();
    let mut reader = null_mut();
    assert_eq!(open_reader(directory.path(), &mut reader).0, Code::Ok);
    let kind = PipelineKind::Rls as u32;
    let used = || ReadingCopy { is_usable: 1, is_stale: 0, ..ReadingCopy::none() };
    let mut readings = [used(), used(), used(), used(), used(), used()];
    // SAFETY: all pointers are of living objects.
    let codes = unsafe {
        [
            dynocar_reader_latest(reader, kind, 0, &mut readings[0]),
            dynocar_reader_latest(reader, 9999, 0, &mut readings[1]),
            dynocar_reader_latest_by_index(reader, 0, 0, &mut readings[2]),
            dynocar_reader_latest_by_index(reader, 32, 0, &mut readings[3]),
            dynocar_reader_quantity(reader, 0, 0, &mut readings[4]),
            dynocar_reader_quantity(reader, 5, 0, &mut readings[5]),
        ]
    };
    let [missing, bad] = [Code::NoSnapshot as i32, Code::BadNumber as i32];
    assert_eq!(codes, [missing, bad, missing, bad, missing, bad]);
    for reading in readings {
        assert_eq!((reading.is_usable, reading.is_stale), (0, 1));
        assert_eq!(reading.status, Status::Invalid as u32);
    }
    // SAFETY: the reader is open.
    let code = unsafe { dynocar_reader_set_stale_after_ns(reader, 0) };
    assert_eq!(code, bad);
    close(null_mut(), reader);
}

#[test]
fn a_snapshot_answers_only_for_the_parameters_it_holds() {
    let mut snapshot = ParameterSnapshot::empty();
    // A count beyond the array, as a careless caller may hand it in.
    snapshot.parameter_count = 4_000_000;
    snapshot.parameters[5] = Parameter::Mass as u32;
    snapshot.values[5] = 114.5;
    let (mut value, mut std, mut resistance) = (0.0, 0.0, ResistanceAtSpeed::default());
    let (mass, davis_a) = (Parameter::Mass as u32, Parameter::DavisA as u32);
    // SAFETY: all pointers are of living objects.
    let codes = unsafe {
        [
            dynocar_snapshot_value(&snapshot, mass, &mut value, &mut std),
            dynocar_snapshot_value(&snapshot, davis_a, &mut value, null_mut()),
            dynocar_snapshot_value(&snapshot, 999, &mut value, null_mut()),
            dynocar_snapshot_covariance(&snapshot, mass, davis_a, &mut std),
            dynocar_snapshot_resistance(&snapshot, 20.0, 1e5, &mut resistance),
            dynocar_snapshot_resistance(&snapshot, f64::NAN, 1e5, &mut resistance),
            dynocar_snapshot_resistance(&snapshot, 20.0, -1.0, &mut resistance),
        ]
    };
    let [missing, bad] = [Code::NotInSnapshot as i32, Code::BadNumber as i32];
    assert_eq!(codes, [0, missing, bad, missing, missing, bad, bad]);
    assert_eq!((value, resistance), (114.5, ResistanceAtSpeed::default()));
}
