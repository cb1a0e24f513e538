//! Every long-running program ends when it is asked to, when its terminal is closed, and after its readers have gone:
//! cleanly, with whole output files.

use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{ExitStatus, Stdio};
use std::time::Duration;

use dynocar_mcap::reading::{FileEnding, read};
use dynocar_mcap::recording::Recording;
use dynocar_shared::TrainId;
use dynocar_tests::process::{DaemonSite, Process, Terminal, Tie, await_true};
use dynocar_transport::{Peer, Role};
use rustix::process::Signal;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");
const RECORDING: &str = env!("CARGO_BIN_EXE_dynocar-recording-under-test");
const LIVE: &str = env!("CARGO_BIN_EXE_dynocar-live-under-test");
const WATCH: &str = env!("CARGO_BIN_EXE_dynocar-watch-under-test");
const PEER: &str = env!("CARGO_BIN_EXE_dynocar-test-peer");
const TRAIN: TrainId = TrainId(1);

/// Ways in which a program ends.
#[derive(Clone, Copy, Debug)]
enum End {
    /// A signal.
    Signal(Signal),
    /// The terminal is closed.
    Closed(Tie),
    /// Standard output and error are pipes that nobody reads any more; then a signal.
    ClosedPipes(Signal),
}

const ENDS: [End; 6] = [
    End::Signal(Signal::TERM),
    End::Signal(Signal::HUP),
    End::Signal(Signal::INT),
    End::Closed(Tie::Leader),
    End::Closed(Tie::Guest),
    End::ClosedPipes(Signal::TERM),
];

/// A program at work on a site of its own, together with a controller.
struct TestSite {
    site: DaemonSite,
    controller: Process,
    port: u16,
}

impl TestSite {
    fn new() -> Self {
        let site = DaemonSite::new();
        site.write_config(1, "", "[[pipelines]]\nkind = \"mass_kalman\"\n");
        std::fs::create_dir(site.path().join("runs")).unwrap();
        let controller = site.start(PEER, &["controller", "1", "5000"]);
        controller.await_line("a sample", |line| !line.is_empty());
        let free = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = free.local_addr().unwrap().port();
        TestSite { site, controller, port }
    }

    fn at(&self, name: &str) -> PathBuf {
        self.site.path().join(name)
    }

    /// Returns the words of a command, with the values of this site in place of `{…}`.
    fn arguments(&self, words: &str) -> Vec<String> {
        let fill = |word: &str| {
            word.replace("{site}", &self.site.path().display().to_string())
                .replace("{port}", &self.port.to_string())
        };
        words.split(' ').map(fill).collect()
    }
}

/// A program, a check from outside that it is at work, and a check of the files that it must leave.
struct Program {
    name: &'static str,
    words: &'static str,
    is_at_work: fn(&TestSite) -> bool,
    left: fn(&TestSite),
}

const RUN: Program = Program {
    name: DYNOCAR,
    words: "run --config {site}/daemon.toml",
    is_at_work: |it| {
        !matches!(Peer::look_up(&it.site.host(), TRAIN, Role::Daemon), Ok(Peer::Absent))
    },
    left: |it| {
        let seen = Peer::look_up(&it.site.host(), TRAIN, Role::Daemon).unwrap();
        assert!(matches!(seen, Peer::Absent), "{seen:?}");
    },
};

const LEARN: Program = Program {
    name: DYNOCAR,
    words: "learn --config {site}/daemon.toml --runs {site}/runs --models {site}/models",
    is_at_work: |it| it.at("models/learn").exists(),
    left: |_| {},
};

const RECORD: Program = Program {
    name: RECORDING,
    words: "record -o {site}/run.mcap",
    is_at_work: |it| has_samples(&it.at("run.mcap")),
    left: |it| assert_whole(&it.at("run.mcap")),
};

const FLIGHT_RECORDER: Program = Program {
    name: RECORDING,
    words: "flight-recorder {site}/ring",
    is_at_work: |it| ring(it).iter().any(|file| has_samples(file)),
    left: |it| ring(it).iter().for_each(|file| assert_whole(file)),
};

const SERVE: Program = Program {
    name: LIVE,
    words: "--port {port}",
    is_at_work: |it| TcpStream::connect(("127.0.0.1", it.port)).is_ok(),
    left: |_| {},
};

fn ring(place: &TestSite) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(place.at("ring")).into_iter().flatten().flatten();
    let paths = entries.map(|entry| entry.path());
    paths.filter(|it| it.extension().is_some_and(|it| it == "mcap")).collect()
}

fn has_samples(file: &Path) -> bool {
    let mut recording = Recording::default();
    read(file, &mut recording).is_ok() && !recording.samples.is_empty()
}

fn assert_whole(file: &Path) {
    let mut recording = Recording::default();
    assert_eq!(read(file, &mut recording).unwrap(), FileEnding::Whole, "{}", file.display());
    assert!(!recording.samples.is_empty(), "{}", file.display());
}

fn closed_pipe() -> Stdio {
    let (_, writer) = std::io::pipe().unwrap();
    writer.into()
}

/// Ends a program that is at work, and gives how it ended.
fn ended(place: &TestSite, program: &Program, end: End) -> ExitStatus {
    let words = place.arguments(program.words);
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let at_work = || await_true(|| (program.is_at_work)(place), || format!("{words:?} at work"));
    let on = |terminal: &Terminal, tie| {
        let process = terminal.start(place.site.command(program.name, &words), tie);
        at_work();
        process
    };
    match end {
        End::Signal(signal) => on(&Terminal::open(), Tie::Leader).end(signal),
        End::Closed(tie) => {
            let terminal = Terminal::open();
            let mut process = on(&terminal, tie);
            drop(terminal);
            process.wait()
        }
        End::ClosedPipes(signal) => {
            let streams = [closed_pipe(), closed_pipe()];
            let mut process = place.site.start_into(program.name, &words, streams);
            at_work();
            process.end(signal)
        }
    }
}

/// After any way of ending, the exit status is 0 and the required files remain.
fn ends_cleanly(program: &Program) {
    for end in ENDS {
        let mut place = TestSite::new();
        let status = ended(&place, program, end);
        assert_eq!(status.code(), Some(0), "{} by {end:?}: {status}", program.words);
        (program.left)(&place);
        assert!(place.controller.try_wait().is_none(), "the controller goes on");
    }
}

#[test]
fn the_daemon_ends_by_signals_and_with_its_terminal() {
    ends_cleanly(&RUN);
}

#[test]
fn a_learner_ends_by_signals_and_with_its_terminal() {
    ends_cleanly(&LEARN);
}

#[test]
fn a_recorder_ends_by_signals_and_with_its_terminal_and_its_file_is_whole() {
    ends_cleanly(&RECORD);
}

#[test]
fn a_flight_recorder_ends_by_signals_and_with_its_terminal_and_its_files_are_whole() {
    ends_cleanly(&FLIGHT_RECORDER);
}

#[test]
fn the_live_view_ends_by_signals_and_with_its_terminal() {
    ends_cleanly(&SERVE);
}

/// The screen or the lines of `dynocar watch` on a terminal, once they are there.
fn watching(site: &DaemonSite, terminal: &mut Terminal, tie: Tie, arguments: &[&str]) -> Process {
    let process = terminal.start(site.command(WATCH, arguments), tie);
    // A screen is drawn by cells: words may stand apart.
    terminal.see(if arguments.is_empty() { "quit" } else { "no daemon serves any train" });
    process
}

#[test]
fn a_watcher_ends_by_signals_and_with_its_terminal_as_screen_and_as_lines() {
    for arguments in [&[][..], &["--plain"]] {
        let site = DaemonSite::new();
        for signal in [Signal::TERM, Signal::HUP, Signal::INT] {
            let mut terminal = Terminal::open();
            let mut watch = watching(&site, &mut terminal, Tie::Leader, arguments);
            assert_eq!(watch.end(signal).code(), Some(0), "{arguments:?} by {signal:?}");
            if arguments.is_empty() {
                terminal.see("\x1b[?1049l");
            }
        }
        for tie in [Tie::Leader, Tie::Guest, Tie::Deaf] {
            let mut terminal = Terminal::open();
            let mut watch = watching(&site, &mut terminal, tie, arguments);
            drop(terminal);
            // Who shows something on a terminal that is gone has nothing left to do, `nohup` or not.
            assert_eq!(watch.wait().code(), Some(0), "{arguments:?} as {tie:?}");
        }
    }
}

#[test]
fn a_watcher_whose_lines_nobody_reads_any_more_ends() {
    let site = DaemonSite::new();
    let mut watch = site.start_into(WATCH, &[], [closed_pipe(), closed_pipe()]);
    assert_eq!(watch.wait().code(), Some(0));
}

#[test]
fn a_watcher_ends_though_its_terminal_takes_nothing_more() {
    let site = DaemonSite::new();
    for arguments in [&[][..], &["--plain"]] {
        let mut terminal = Terminal::open();
        let mut watch = watching(&site, &mut terminal, Tie::Leader, arguments);
        terminal.halt();
        // Lines come each second.
        std::thread::sleep(Duration::from_millis(1_200));
        assert_eq!(watch.end(Signal::TERM).code(), Some(0), "{arguments:?}");
    }
}

#[test]
fn a_program_that_is_to_outlive_its_terminal_does() {
    let mut place = TestSite::new();
    let words = place.arguments(RECORD.words);
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let terminal = Terminal::open();
    let mut recorder = terminal.start(place.site.command(RECORDING, &words), Tie::Deaf);
    await_true(|| (RECORD.is_at_work)(&place), || "a recorder at work".into());
    drop(terminal);
    let file = place.at("run.mcap");
    let samples = || {
        let mut recording = Recording::default();
        read(&file, &mut recording).map_or(0, |_| recording.samples.len())
    };
    let before = samples();
    await_true(|| samples() > before + 100, || "samples after the terminal's end".into());
    assert!(recorder.try_wait().is_none());
    assert_eq!(recorder.end(Signal::TERM).code(), Some(0));
    assert_whole(&file);
    assert!(place.controller.try_wait().is_none());
}
