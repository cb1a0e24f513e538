//! A controller that the kernel kills at its first system call.
//!
//! `dynocar-sealed-peer ACTION TRAIN` connects, warms up, lets the kernel forbid every system call but those for
//! writing and ending, and then repeats ACTION: `poll`, `cycle` (publish and poll, until enough new snapshots have
//! come) or `call`, which makes a system call to show that the seal holds. A process that is still alive then writes
//! the number of new snapshots.

use std::time::{Duration, Instant};

use dynocar_client::{SamplePublisher, SnapshotReader};
use dynocar_shared::{SampleField, TrainId, TrainSample};
use dynocar_transport::{Host, monotonic_now_ns};

/// Time for the ports to connect with the first messages; for half a second a new controller also wakes every thread
/// whose state it does not know.
const WARM_UP: Duration = Duration::from_millis(700);
const CALLS: u64 = 20_000;
const NEWS: u64 = 50;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [what, train] = &arguments[..] else {
        panic!("expected: poll|cycle|call TRAIN, got {arguments:?}");
    };
    let train = TrainId(train.parse().expect("a train number"));
    let host = Host::from_environment().expect("a run-time directory");
    let mut reader = SnapshotReader::open(&host, train).expect("a reader");
    let mut publisher = SamplePublisher::open(&host, train).expect("a publisher");
    let start = Instant::now();
    let (mut news, mut last) = (0, 0);
    while start.elapsed() < WARM_UP || news < NEWS {
        let (own, published) = cycle(&mut publisher, &mut reader, train);
        (news, last) = (news + own, published);
        std::thread::sleep(Duration::from_millis(1));
    }
    // However busy the machine, all that was published is answered before nothing new is expected.
    while newest(&reader) < last {
        std::thread::sleep(Duration::from_millis(1));
        reader.poll();
    }
    seal();
    let (mut calls, mut news) = (0, 0);
    while calls < CALLS || (what == "cycle" && news < NEWS) {
        calls += 1;
        match what.as_str() {
            "poll" => news += reader.poll() as u64,
            "cycle" => news += cycle(&mut publisher, &mut reader, train).0,
            _ => {
                // SAFETY: the call takes nothing and changes nothing.
                unsafe { libc::getppid() };
            }
        }
    }
    leave(news);
}

/// Publishes and polls; gives the number of snapshots that brought something new, and that of the sample.
fn cycle(
    publisher: &mut SamplePublisher,
    reader: &mut SnapshotReader,
    train: TrainId,
) -> (u64, u64) {
    let mut sample = TrainSample::empty(train).with(SampleField::Speed, 20.0);
    sample.time_ns = monotonic_now_ns();
    publisher.publish(&mut sample).expect("a sample to be taken");
    (reader.poll() as u64, sample.sequence)
}

/// Returns the newest sample that was answered.
fn newest(reader: &SnapshotReader) -> u64 {
    let readings = reader.readings(monotonic_now_ns());
    readings.map(|reading| reading.snapshot.sample_sequence).max().unwrap_or(0)
}

/// Has the kernel kill this process at every system call but `write` and `exit_group`.
fn seal() {
    let statement = |code: u32, k: u32| libc::sock_filter { code: code as u16, jt: 0, jf: 0, k };
    let skip_if = |number: libc::c_long, jump: u8| libc::sock_filter {
        code: (libc::BPF_JMP | libc::BPF_JEQ | libc::BPF_K) as u16,
        jt: jump,
        jf: 0,
        k: number as u32,
    };
    let mut filter = [
        // The system call's number is the first word of the filter's input.
        statement(libc::BPF_LD | libc::BPF_W | libc::BPF_ABS, 0),
        skip_if(libc::SYS_write, 2),
        skip_if(libc::SYS_exit_group, 1),
        statement(libc::BPF_RET | libc::BPF_K, libc::SECCOMP_RET_KILL_PROCESS),
        statement(libc::BPF_RET | libc::BPF_K, libc::SECCOMP_RET_ALLOW),
    ];
    let program = libc::sock_fprog { len: filter.len() as u16, filter: filter.as_mut_ptr() };
    rustix::thread::set_no_new_privs(true).expect("no new privileges");
    // SAFETY: `program` and the filter it points to outlive the call, which copies them.
    let answer = unsafe {
        libc::prctl(libc::PR_SET_SECCOMP, libc::SECCOMP_MODE_FILTER, std::ptr::from_ref(&program))
    };
    assert_eq!(answer, 0, "the seal: {}", std::io::Error::last_os_error());
}

/// Writes the number and leaves without a further system call.
fn leave(news: u64) -> ! {
    let line = format!("{news}\n");
    // SAFETY: the buffer is valid for its length, and descriptor 1 is this process's own.
    unsafe {
        libc::write(1, line.as_ptr().cast(), line.len());
        libc::_exit(0)
    }
}
