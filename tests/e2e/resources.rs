//! Resources that a process shares with others: readers of its log, open files, a port, its children.

use std::collections::BTreeSet;
use std::io::{BufRead, PipeReader, PipeWriter, Read, Write};
use std::process::Stdio;
use std::time::{Duration, Instant};

use dynocar_client::{SamplePublisher, SnapshotReader};
use dynocar_shared::TrainId;
use dynocar_shared::services::PIPELINES_MAX;
use dynocar_tests::process::{DaemonSite, await_true, hosts_in, remove_segments, segments_of};
use dynocar_transport::peer::RoleLock;
use dynocar_transport::{Host, Peer, Role};
use rustix::process::Signal;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");
const SOAK: &str = env!("CARGO_BIN_EXE_dynocar-soak");
const ECHO: &str = "[[pipelines]]\nkind = \"echo\"\n";
const TRAIN: TrainId = TrainId(1);

/// Returns a pipe that another process has filled.
fn full_pipe() -> (PipeReader, PipeWriter) {
    let (reader, mut writer) = std::io::pipe().unwrap();
    let flags = rustix::fs::fcntl_getfl(&writer).unwrap();
    rustix::fs::fcntl_setfl(&writer, flags | rustix::fs::OFlags::NONBLOCK).unwrap();
    while writer.write(&[b'.'; 1024]).is_ok() {}
    rustix::fs::fcntl_setfl(&writer, flags).unwrap();
    (reader, writer)
}

#[test]
fn a_log_that_nobody_takes_holds_neither_work_nor_end_up() {
    let site = DaemonSite::new();
    let config = site.write_config(1, "log = \"trace\"", ECHO);
    let socket = site.path().join("notify");
    let supervisor = std::os::unix::net::UnixDatagram::bind(&socket).unwrap();
    supervisor.set_nonblocking(true).unwrap();
    let (mut reader, writer) = full_pipe();
    let script = format!("unset WATCHDOG_PID; exec {DYNOCAR} run --config {}", config.display());
    let variables = format!("NOTIFY_SOCKET={}", socket.display());
    let arguments = [&variables, "WATCHDOG_USEC=1000000", "sh", "-c", &script];
    let mut daemon = site.start_into("env", &arguments, [Stdio::null(), writer.into()]);
    let mut fed = 0;
    let mut await_food = |portions| {
        let wanted = fed + portions;
        await_true(
            || {
                let mut message = [0; 4096];
                while let Ok(length) = supervisor.recv(&mut message) {
                    let message = String::from_utf8_lossy(&message[..length]).into_owned();
                    fed += usize::from(message.contains("WATCHDOG=1"));
                }
                fed >= wanted
            },
            || "the watchdog to be fed".into(),
        );
    };
    await_food(2);
    // Each of these is worth a line of the log.
    for _ in 0..3 {
        drop(SamplePublisher::open(&site.host(), TRAIN).unwrap());
        await_food(2);
    }
    let asked = Instant::now();
    assert!(daemon.end(Signal::TERM).success());
    // An orderly end takes less than a second, one that waits for the reader has none.
    assert!(asked.elapsed() < Duration::from_secs(10), "{:?}", asked.elapsed());
    let mut log = String::new();
    reader.read_to_string(&mut log).unwrap();
    assert!(log.starts_with("...."), "what was in the pipe before");
}

#[test]
fn lines_that_nobody_takes_are_dropped_counted_and_said() {
    const TRAINS: u64 = 60;
    let site = DaemonSite::new();
    let config = site.write_config(TRAINS, "", ECHO);
    let (reader, writer) = full_pipe();
    let run = ["run", "--config", config.to_str().unwrap()];
    let mut daemon = site.start_into(DYNOCAR, &run, [Stdio::null(), writer.into()]);
    let host = site.host();
    let is_there =
        |train| matches!(Peer::look_up(&host, train, Role::Daemon), Ok(Peer::Compatible(_)));
    await_true(|| (1..=TRAINS).all(|it| is_there(TrainId(it))), || "the daemon".into());
    // Each coming and going of their controllers is worth 120 lines, of which some 1200 wait.
    for _ in 0..20 {
        let claim = |it| RoleLock::claim(&host, TrainId(it), Role::Controller).unwrap();
        let controllers: Vec<RoleLock> = (1..=TRAINS).map(claim).collect();
        std::thread::sleep(Duration::from_millis(600));
        drop(controllers);
        std::thread::sleep(Duration::from_millis(600));
    }
    let lines = std::thread::spawn(move || {
        std::io::BufReader::new(reader).lines().map_while(Result::ok).collect::<Vec<_>>()
    });
    assert!(daemon.end(Signal::TERM).success());
    drop(daemon);
    let lines = lines.join().unwrap();
    let count = |words: &str| lines.iter().filter(|it| it.contains(words)).count();
    let is_notice = |line: &&String| line.contains("lines of the log were dropped: nobody took");
    let notices: Vec<u64> = lines
        .iter()
        .filter(is_notice)
        .map(|it| it.split(' ').nth(1).unwrap().parse().unwrap())
        .collect();
    assert!(!notices.is_empty() && notices[0] > 0, "{notices:?}");
    assert_eq!(count("stopped"), TRAINS as usize, "what comes later is taken again");
}

#[test]
fn what_many_pipelines_say_at_once_is_taken_as_a_whole() {
    const TRAINS: u64 = 40;
    let site = DaemonSite::new();
    let echo = |it| format!("[[pipelines]]\nkind = \"echo\"\nname = \"{it}\"\nthread = \"all\"\n");
    let pipelines: String = (0..PIPELINES_MAX).map(echo).collect();
    let threads = "[[threads]]\nname = \"all\"\n";
    let config = site.write_config(TRAINS, "", &format!("{threads}{pipelines}"));
    let mut daemon = site.start(DYNOCAR, &["run", "--config", config.to_str().unwrap()]);
    daemon.await_error("serving");
    assert!(daemon.end(Signal::TERM).success(), "{}", daemon.errors());
    let said = daemon.errors();
    assert_eq!(said.matches(" stopped ").count(), TRAINS as usize * PIPELINES_MAX);
    assert!(!said.contains("dropped"), "{said}");
}

#[test]
fn the_limit_of_open_files_is_raised_and_its_end_is_named_once() {
    let site = DaemonSite::new();
    let config = site.write_config(1, "", ECHO);
    let run = |limits: &str| {
        let script = format!("{limits} && exec {DYNOCAR} run --config {}", config.display());
        site.start("sh", &["-c", &script])
    };
    let read = |readers: &mut Vec<SnapshotReader>| {
        readers.iter_mut().for_each(|it| {
            it.poll();
        });
        readers.iter().filter(|it| it.readings(0).next().is_some()).count()
    };
    let host = site.host();
    let mut raised = run("ulimit -Sn 40");
    raised.await_error("serving");
    let open = |_| SnapshotReader::open(&host, TRAIN).unwrap();
    let mut readers: Vec<SnapshotReader> = (0..10).map(open).collect();
    await_true(|| read(&mut readers) == 10, || format!("ten readers: {}", raised.errors()));
    assert!(raised.end(Signal::TERM).success());
    drop(readers);
    let mut scarce = run("ulimit -n 48");
    await_true(
        || scarce.errors().contains("serving") || scarce.try_wait().is_some(),
        || "a start, or its refusal".into(),
    );
    let mut readers: Vec<SnapshotReader> = (0..10).map(open).collect();
    await_true(
        || {
            read(&mut readers);
            scarce.errors().contains("ulimit -n")
        },
        || format!("the cause: {}", scarce.errors()),
    );
    std::thread::sleep(std::time::Duration::from_secs(2));
    // The limit may end a kept state, too, where the readers were faster.
    let said = scarce.errors();
    let causes: Vec<&str> = said
        .lines()
        .filter(|line| line.contains("ulimit -n"))
        .filter_map(|line| line.split_once("WARN"))
        .map(|(_, cause)| cause)
        .collect();
    let distinct: BTreeSet<&str> = causes.iter().copied().collect();
    assert!(!causes.is_empty() && distinct.len() == causes.len(), "{said}");
}

#[test]
fn a_limit_of_open_files_is_named_wherever_it_ends_a_start() {
    let site = DaemonSite::new();
    let config = site.write_config(1, "", ECHO);
    for limit in [7, 10, 16, 20, 24, 28, 32] {
        let script =
            format!("ulimit -n {limit} && exec {DYNOCAR} run --config {}", config.display());
        let daemon = site.start("sh", &["-c", &script]);
        // With the greater of these the daemon serves, without keeping a state.
        daemon.await_error(&format!("the limit of {limit} is reached"));
        let said = daemon.errors();
        assert!(said.contains("ulimit -n") && !said.contains("refused"), "{said}");
    }
}

#[test]
fn metrics_are_answered_beside_slow_peers_with_head_slash_and_query() {
    let site = DaemonSite::new();
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let lines = format!("[metrics]\nlisten = \"{port}\"");
    let config = site.write_config(1, "", &format!("{ECHO}{lines}\n"));
    let daemon = site.start(DYNOCAR, &["run", "--config", config.to_str().unwrap()]);
    daemon.await_error("serving");
    await_true(|| std::net::TcpStream::connect(port).is_ok(), || "metrics".into());
    let connect = || std::net::TcpStream::connect(port).unwrap();
    let ask = |request: &str| {
        let mut stream = connect();
        stream.write_all(format!("{request} HTTP/1.1\r\nHost: x\r\n\r\n").as_bytes()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    };
    await_true(|| ask("GET /metrics").contains("dynocar_"), || "the first snapshot".into());
    // The daemon does not wait for a slow client: its answer comes after those of quick ones.
    let mut slow = connect();
    slow.write_all(b"GET /metrics HTTP/1.1\r\n").unwrap();
    let quick = ask("GET /metrics/?x=1");
    slow.write_all(b"\r\n").unwrap();
    let mut answer = String::new();
    slow.read_to_string(&mut answer).unwrap();
    for answer in [&quick, &answer] {
        assert!(answer.starts_with("HTTP/1.1 200 OK") && answer.contains("dynocar_"), "{answer}");
    }
    let head = ask("HEAD /metrics");
    assert!(head.starts_with("HTTP/1.1 200 OK") && head.ends_with("\r\n\r\n"), "{head}");
    assert!(ask("GET /other").starts_with("HTTP/1.1 404"));
    // Ten times as many as there are places for, which would take a second each time.
    let dawdlers: Vec<_> = (0..320).map(|_| connect()).collect();
    let asked = Instant::now();
    assert!(ask("GET /metrics").starts_with("HTTP/1.1 200 OK"));
    assert!(asked.elapsed() < Duration::from_secs(6), "{:?}", asked.elapsed());
    drop(dawdlers);
}

/// Returns the processes that a process started.
fn children_of(process: u32) -> Vec<String> {
    let tasks = format!("/proc/{process}/task/{process}/children");
    let children = std::fs::read_to_string(tasks).unwrap_or_default();
    children.split_whitespace().map(str::to_owned).collect()
}

#[test]
fn whoever_starts_processes_takes_them_along_however_it_ends() {
    let is_running = |process: &String| {
        let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
        stat.rsplit(") ").next().is_some_and(|it| !it.is_empty() && !it.starts_with('Z'))
    };
    for (program, arguments, signal) in [
        (DYNOCAR, &["demo", "--rate", "20"][..], Signal::KILL),
        (DYNOCAR, &["demo", "--rate", "20"], Signal::TERM),
        (SOAK, &["faults", "--rounds", "100"], Signal::TERM),
        (SOAK, &["faults", "--rounds", "100"], Signal::KILL),
    ] {
        let site = DaemonSite::new();
        let folder = site.path().join("temporary");
        std::fs::create_dir(&folder).unwrap();
        let variables = [("TMPDIR", folder.to_str().unwrap())];
        let mut process = site.start_with(program, arguments, &variables);
        let mut children = Vec::new();
        await_true(
            || {
                children = children_of(process.id());
                children.len() >= 2
            },
            || format!("the children of {program} {arguments:?}: {}", process.errors()),
        );
        let hosts = hosts_in(&folder);
        process.end(signal);
        await_true(|| !children.iter().any(is_running), || format!("the end of {children:?}"));
        let is_empty = |host: &Host| segments_of(host).is_empty();
        if program == DYNOCAR {
            assert!(!hosts.is_empty(), "the demo's run-time directory");
            await_true(|| hosts.iter().all(is_empty), || "an empty shared memory".into());
        }
        hosts.iter().for_each(remove_segments);
    }
}
