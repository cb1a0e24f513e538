//! Outputs for a supervisor and an operator: notifications, verdicts, metrics, the unit file.

use std::collections::HashMap;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::os::unix::net::UnixDatagram;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use dynocar_client::SamplePublisher;
use dynocar_shared::{ParameterSnapshot, SampleField, Status, TrainId, TrainSample};
use dynocar_tests::process::{DaemonSite, Process, await_true};
use dynocar_transport::channel::Transport;
use dynocar_transport::peer::RoleLock;
use dynocar_transport::{Announcement, Role, monotonic_now_ns};
use rustix::process::Signal;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");
const ECHO: &str = "[[pipelines]]\nkind = \"echo\"\n";
const TRAIN: TrainId = TrainId(1);

fn daemon(site: &DaemonSite, pipelines: &str, variables: &[(&str, &str)]) -> Process {
    let config = site.write_config(1, "", pipelines);
    let arguments = ["run", "--config", config.to_str().expect("a UTF-8 path")];
    let daemon = site.start_with(DYNOCAR, &arguments, variables);
    daemon.await_error("serving");
    daemon
}

#[test]
fn the_supervisor_hears_of_readiness_of_life_and_of_the_end() {
    let site = DaemonSite::new();
    let path = site.path().join("notify");
    let socket = UnixDatagram::bind(&path).unwrap();
    socket.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    let hear = || {
        let mut buffer = [0; 256];
        let length = socket.recv(&mut buffer).expect("a notification");
        String::from_utf8_lossy(&buffer[..length]).into_owned()
    };
    let variables = [("NOTIFY_SOCKET", path.to_str().unwrap()), ("WATCHDOG_USEC", "400000")];
    let mut daemon = daemon(&site, ECHO, &variables);
    assert_eq!(hear(), "READY=1");
    for _ in 0..3 {
        assert_eq!(hear(), "WATCHDOG=1");
    }
    daemon.signal(Signal::TERM);
    await_true(|| hear() == "STOPPING=1", || "STOPPING=1".into());
    assert!(daemon.wait().success());
}

#[test]
fn a_stopped_daemon_no_longer_feeds_the_watchdog() {
    let site = DaemonSite::new();
    let path = site.path().join("notify");
    let socket = UnixDatagram::bind(&path).unwrap();
    let variables = [("NOTIFY_SOCKET", path.to_str().unwrap()), ("WATCHDOG_USEC", "400000")];
    let daemon = daemon(&site, ECHO, &variables);
    daemon.signal(Signal::STOP);
    // Messages sent before the stop are heard first; then silence, for five times the limit.
    socket.set_read_timeout(Some(Duration::from_secs(2))).unwrap();
    let mut buffer = [0; 256];
    let mut heard = 0;
    while socket.recv(&mut buffer).is_ok() {
        heard += 1;
    }
    assert!(heard < 100);
    daemon.signal(Signal::CONT);
    socket.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    assert!(socket.recv(&mut buffer).is_ok(), "it lives again");
}

/// Exit status and output of `dynocar health`.
fn health(site: &DaemonSite) -> (Option<i32>, String) {
    let mut process = site.start(DYNOCAR, &["health", "--train", "1"]);
    let status = process.wait();
    (status.code(), process.output())
}

#[test]
fn health_shows_no_daemon_from_ok_from_stale_by_exit_status_and_words() {
    let site = DaemonSite::new();
    let (code, words) = health(&site);
    assert_eq!(code, Some(6), "{words}");
    assert!(
        words.starts_with("train 1: no daemon: nobody serves it\n  to do: start it"),
        "{words}"
    );
    let daemon = daemon(&site, ECHO, &[]);
    let (code, words) = health(&site);
    assert_eq!(code, Some(0), "{words}");
    assert!(
        words.contains("train 1: ok: daemon") && words.contains("pipeline 0 (echo)"),
        "{words}"
    );
    daemon.signal(Signal::STOP);
    let (code, words) = health(&site);
    assert_eq!(code, Some(4), "{words}");
    assert!(words.starts_with("train 1: stale"), "{words}");
    daemon.signal(Signal::CONT);
    await_true(|| health(&site).0 == Some(0), || "health after SIGCONT".into());
    daemon.kill();
    assert_eq!(health(&site).0, Some(6));
}

#[test]
fn health_without_options_lists_every_train_and_ends_with_the_worst_verdict() {
    let site = DaemonSite::new();
    let health = || {
        let mut process = site.start(DYNOCAR, &["health"]);
        (process.wait().code(), process.output())
    };
    let (code, words) = health();
    assert_eq!(code, Some(6), "{words}");
    assert!(words.starts_with("no daemon: nobody serves any train under /"), "{words}");
    site.write_config(1, "", "");
    let start = |id: u64| {
        let text = format!("[[trains]]\nid = {id}\nfile = \"train.toml\"\n{ECHO}");
        let config = site.write(&format!("daemon-{id}.toml"), &text);
        let daemon = site.start(DYNOCAR, &["run", "--config", config.to_str().expect("UTF-8")]);
        daemon.await_error("serving");
        daemon
    };
    let (_seven, twelve) = (start(7), start(12));
    await_true(|| health().0 == Some(0), || "both trains to be served well".into());
    let (_, words) = health();
    let trains = |it: &&str| it.starts_with("train ");
    let lines: Vec<&str> = words.lines().filter(trains).collect();
    assert_eq!(lines.len(), 2, "{words}");
    assert!(lines[0].starts_with("train 7: ok") && lines[1].starts_with("train 12: ok"), "{words}");
    twelve.stop();
    let (code, words) = health();
    assert_eq!(code, Some(4), "{words}");
    assert!(words.contains("train 7: ok") && words.contains("train 12: stale"), "{words}");
}

#[test]
fn health_names_the_remedy_where_every_sample_is_refused() {
    let site = DaemonSite::new();
    let daemon = daemon(&site, "[[pipelines]]\nkind = \"train_kalman\"\n", &[]);
    let mut publisher = SamplePublisher::open(&site.host(), TRAIN).unwrap();
    let mut sample = TrainSample::empty(TRAIN).with(SampleField::Speed, f64::NAN);
    let mut words = String::new();
    await_true(
        || {
            for _ in 0..300 {
                sample.time_ns += 100_000_000;
                publisher.publish(&mut sample).expect("a sample to be taken");
            }
            let code;
            (code, words) = health(&site);
            code == Some(3) && words.contains("to do: leave the bit out")
        },
        || format!("a verdict on refused samples: {}", daemon.errors()),
    );
    assert!(words.contains("(bad_input): it ends once few of the samples are refused"), "{words}");
}

#[test]
fn health_shows_a_degraded_pipeline_and_an_incompatible_daemon() {
    let site = DaemonSite::new();
    let host = site.host();
    let role = RoleLock::claim(&host, TRAIN, Role::Daemon).unwrap();
    let transport = Transport::open(&host, "test-daemon").unwrap();
    let sender = transport.sender::<ParameterSnapshot>(TRAIN).unwrap();
    let mut process = site.start(DYNOCAR, &["health"]);
    let mut snapshot = ParameterSnapshot::empty();
    (snapshot.train_id, snapshot.status) = (TRAIN.0, Status::Degraded as u32);
    let mut code = None;
    await_true(
        || {
            snapshot.vouched_ns = monotonic_now_ns();
            snapshot.sequence += 1;
            sender.send(&snapshot).unwrap();
            code = process.try_wait();
            code.is_some()
        },
        || "the verdict".into(),
    );
    assert_eq!(code.unwrap().code(), Some(3), "{}", process.output());
    drop(role);

    let text = format!(
        "process_id=7\nversion=9\nschema=9\ntransport={}\nsample_layout=1\nsnapshot_layout=2\n",
        Announcement::of_this_process(Role::Daemon).transport
    );
    let path = host.trains_directory().join("1.daemon");
    std::fs::write(&path, text).unwrap();
    let held = std::fs::File::open(&path).unwrap();
    held.lock().unwrap();
    let (code, words) = health(&site);
    assert_eq!(code, Some(5), "{words}");
    assert!(words.contains("incompatible: daemon 9"), "{words}");
}

/// A port that was free a moment ago.
fn free_port() -> u16 {
    std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

fn ask(port: u16, request: &[u8]) -> String {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).expect("the listener");
    stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    // A listener that refuses early closes before all is written.
    let _ = stream.write_all(request);
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    String::from_utf8_lossy(&answer).into_owned()
}

/// The value of a sample line, by its name and one of its labels.
fn value(text: &str, name: &str, label: &str) -> Option<f64> {
    let line = text.lines().find(|line| line.starts_with(name) && line.contains(label))?;
    line.rsplit(' ').next()?.parse().ok()
}

#[test]
fn metrics_are_open_metrics_text_and_nothing_else_is_answered() {
    let site = DaemonSite::new();
    let port = free_port();
    let pipelines = format!("{ECHO}name = \"floor\"\n[metrics]\nlisten = \"127.0.0.1:{port}\"\n");
    let daemon = daemon(&site, &pipelines, &[]);
    let mut publisher = SamplePublisher::open(&site.host(), TRAIN).unwrap();
    let mut offered = 0;
    let get = b"GET /metrics HTTP/1.1\r\nHost: localhost\r\n\r\n";
    await_true(
        || {
            let mut sample = TrainSample::empty(TRAIN).with(SampleField::Speed, 20.0);
            sample.time_ns = monotonic_now_ns();
            // Each second one is of no use.
            if offered % 2 == 1 {
                sample.set(SampleField::Speed, f64::NAN);
            }
            publisher.publish(&mut sample).unwrap();
            offered += 1;
            let text = ask(port, get);
            value(&text, "dynocar_samples_used_total", "floor").is_some_and(|used| used >= 5.0)
        },
        || format!("five samples in the metrics: {}", ask(port, get)),
    );
    let answer = ask(port, get);
    let (head, text) = answer.split_once("\r\n\r\n").expect("head and body");
    assert!(head.starts_with("HTTP/1.1 200 OK"), "{head}");
    assert!(head.contains("application/openmetrics-text; version=1.0.0"), "{head}");
    assert!(text.ends_with("# EOF\n"), "{text}");
    assert!(value(text, "dynocar_samples_rejected_total", "reason=\"not_finite\"").unwrap() >= 4.0);
    assert_eq!(value(text, "dynocar_status", "status=\"invalid\""), Some(0.0));
    assert!(value(text, "dynocar_vouched_age_seconds", "train=\"1\"").unwrap() < 30.0);
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let number = line.rsplit(' ').next().and_then(|word| word.parse::<f64>().ok());
        assert!(number.is_some_and(f64::is_finite), "{line}");
    }

    assert!(ask(port, b"GET / HTTP/1.1\r\n\r\n").starts_with("HTTP/1.1 404"));
    assert!(ask(port, b"POST /metrics HTTP/1.1\r\n\r\n").starts_with("HTTP/1.1 404"));
    let endless = [&b"GET /metrics HTTP/1.1\r\nX: "[..], &[b'x'; 100_000]].concat();
    assert!(!ask(port, &endless).contains("200 OK"));
    // Somebody who connects and says nothing holds the listener up for a second, not for good.
    let silent = TcpStream::connect(("127.0.0.1", port)).unwrap();
    assert!(ask(port, get).starts_with("HTTP/1.1 200"));
    drop(silent);
    daemon.kill();
}

#[test]
fn metrics_are_off_by_default_and_refused_beyond_loopback() {
    for address in ["0.0.0.0:9464", "192.168.0.1:9464", "localhost", "9464"] {
        let site = DaemonSite::new();
        let pipelines = format!("{ECHO}[metrics]\nlisten = \"{address}\"\n");
        let config = site.write_config(1, "", &pipelines);
        let mut daemon = site.start(DYNOCAR, &["run", "--config", config.to_str().unwrap()]);
        assert_eq!(daemon.wait().code(), Some(2));
        let expected = format!("metrics.listen = {address}: expected a loopback address");
        assert!(daemon.errors().contains(&expected), "{}", daemon.errors());
    }
    let site = DaemonSite::new();
    let daemon = daemon(&site, ECHO, &[]);
    let sockets = std::fs::read_to_string("/proc/net/tcp").unwrap();
    let listening: Vec<&str> = sockets
        .lines()
        .filter(|line| line.split_whitespace().nth(3) == Some("0A"))
        .filter_map(|line| line.split_whitespace().nth(9))
        .collect();
    let descriptors = std::fs::read_dir(format!("/proc/{}/fd", daemon.id())).unwrap();
    for descriptor in descriptors.flatten() {
        let Ok(target) = std::fs::read_link(descriptor.path()) else { continue };
        let target = target.to_string_lossy().into_owned();
        let is_listening = listening.iter().any(|inode| target == format!("socket:[{inode}]"));
        assert!(!is_listening, "the daemon listens by default");
    }
}

#[test]
fn the_unit_file_says_what_the_docs_promise() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/dynocar.service");
    let text = std::fs::read_to_string(&path).unwrap();
    let keys: HashMap<&str, &str> = text
        .lines()
        .filter(|line| !line.starts_with('#'))
        .filter_map(|l| l.split_once('='))
        .collect();
    let promised = [
        ("Type", "notify"),
        ("User", "dynocar"),
        ("RemoveIPC", "no"),
        ("Restart", "always"),
        ("RestartPreventExitStatus", "2"),
        ("RuntimeDirectory", "dynocar"),
        ("RuntimeDirectoryMode", "0700"),
        ("StateDirectory", "dynocar"),
        ("NoNewPrivileges", "yes"),
        ("CapabilityBoundingSet", ""),
        ("ProtectSystem", "strict"),
        ("IPAddressDeny", "any"),
        ("UMask", "0077"),
    ];
    for (key, value) in promised {
        assert_eq!(keys.get(key), Some(&value), "{key}");
    }
    let watchdog_s: f64 = keys["WatchdogSec"].parse().unwrap();
    assert!(watchdog_s >= 2.0, "longer than what counts as a hang");
    assert!(!keys.contains_key("PrivateDevices"), "it would hide nothing and cost /dev/shm");
    // Where systemd is installed it reads the file itself; an unknown key or value is an error.
    if let Ok(output) = Command::new("systemd-analyze").arg("--version").output()
        && output.status.success()
    {
        let folder = tempfile::tempdir().unwrap();
        let copy = folder.path().join("dynocar.service");
        // The program and the user need not exist here.
        let here = text
            .replace("/usr/local/bin/dynocar", "/bin/true")
            .replace("User=dynocar", "User=root")
            .replace("Group=dynocar", "Group=root");
        std::fs::write(&copy, here).unwrap();
        let output = Command::new("systemd-analyze").arg("verify").arg(&copy).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        let errors: Vec<&str> =
            said.lines().filter(|line| line.contains("dynocar.service:")).collect();
        assert!(errors.is_empty(), "{errors:?}");
    }
}
