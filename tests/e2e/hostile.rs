//! Attempts of processes of another user and of the same user.

use std::fs::OpenOptions;
use std::os::unix::fs::{FileExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use dynocar_tests::process::{DaemonSite, Process, await_true};
use dynocar_tests::soak::hostile::{SegmentKind, vandalise};
use rand::{RngExt, SeedableRng};

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");
const PEER: &str = env!("CARGO_BIN_EXE_dynocar-test-peer");
const ECHO: &str = "[[pipelines]]\nkind = \"echo\"\n[state]\ndirectory = \"state\"\n";

struct Cast {
    site: DaemonSite,
    daemon: Process,
    controller: Process,
    client: Process,
}

fn cast() -> Cast {
    let site = DaemonSite::new();
    std::fs::create_dir(site.path().join("state")).unwrap();
    let config = site.write_config(1, "", ECHO);
    let daemon = site.start(DYNOCAR, &["run", "--config", config.to_str().unwrap()]);
    daemon.await_error("serving");
    let controller = site.start(PEER, &["controller", "1", "2000"]);
    let client = site.start(PEER, &["client", "1", "2000"]);
    client.await_line("samples in use", |line| used(line) > 0);
    Cast { site, daemon, controller, client }
}

/// Samples used, by a line of the test client.
fn used(line: &str) -> u64 {
    line.split(' ').nth(3).and_then(|word| word.parse().ok()).unwrap_or(0)
}

fn segment_paths(site: &DaemonSite) -> Vec<PathBuf> {
    site.segments().into_iter().map(|name| Path::new("/dev/shm").join(name)).collect()
}

fn all_below(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap().flatten() {
        let path = entry.path();
        if std::fs::symlink_metadata(&path).is_ok_and(|it| it.is_dir()) {
            all_below(&path, found);
        }
        found.push(path);
    }
}

#[test]
fn every_file_and_segment_is_closed_to_other_users() {
    let cast = cast();
    let root = cast.site.host().root().to_path_buf();
    let transport = cast.site.host().transport_directory();
    let mut found = vec![root.clone(), transport.clone()];
    all_below(&root, &mut found);
    all_below(&transport, &mut found);
    let segments = segment_paths(&cast.site);
    assert!(segments.len() > 10 && found.len() > 10, "{segments:?}, {found:?}");
    let user = std::fs::metadata(&root).unwrap().uid();
    let mode = |path: &Path| std::fs::metadata(path).map(|it| it.permissions().mode() & 0o777);
    for path in &segments {
        // One of a port that has just gone is as closed as can be.
        let Ok(attributes) = std::fs::metadata(path) else { continue };
        let mode = attributes.permissions().mode() & 0o777;
        assert_eq!(mode & 0o077, 0, "{}: {mode:o}", path.display());
        assert_eq!(attributes.uid(), user, "{}", path.display());
    }
    // Within the directories files may be as they are: nobody else comes in.
    assert_eq!([&root, &transport].map(|it| mode(it).unwrap()), [0o700; 2]);
    for path in &found {
        let mode = mode(path).unwrap_or(0);
        assert_eq!(mode & 0o027, 0, "{}: {mode:o}", path.display());
    }
}

#[test]
fn another_user_can_neither_read_nor_write_nor_signal() {
    let cast = cast();
    let as_nobody = |command: &str| {
        let arguments = ["--reuid=65534", "--regid=65534", "--clear-groups", "sh", "-c", command];
        Command::new("setpriv").args(arguments).output()
    };
    match as_nobody("true") {
        Ok(output) if output.status.success() => {}
        other => return println!("not tried, no other user to be had here: {other:?}"),
    }
    let refused = |command: String| {
        let output = as_nobody(&command).unwrap();
        assert!(!output.status.success(), "another user may: {command}");
    };
    for path in segment_paths(&cast.site).iter().filter(|path| path.exists()) {
        refused(format!("cat {}", path.display()));
        refused(format!("echo x > {}", path.display()));
        refused(format!("rm {}", path.display()));
    }
    let root = cast.site.host().root().display().to_string();
    refused(format!("ls {root}"));
    refused(format!("cat {root}/trains/1.daemon"));
    refused(format!("kill -0 {}", cast.daemon.id()));
    // Nor can it take the daemon's place: the directory is not its own.
    let mut there = Command::new("setpriv");
    there.args(["--reuid=65534", "--regid=65534", "--clear-groups", PEER, "client", "1", "1000"]);
    let output = there.env("DYNOCAR_ROOT", &root).output().unwrap();
    assert!(!output.status.success());
}

#[test]
fn garbage_in_the_payload_of_samples_and_snapshots_harms_nobody() {
    garbage_harms_nobody(SegmentKind::Payload);
}

#[test]
fn garbage_in_the_counts_of_samples_harms_nobody() {
    garbage_harms_nobody(SegmentKind::Counts);
}

fn garbage_harms_nobody(kind: SegmentKind) {
    let Cast { site, mut daemon, mut controller, mut client } = cast();
    let before = used(&client.last_line().unwrap());
    let summary = vandalise(&site, kind, Duration::from_secs(2), 1);
    println!("{summary:?}");
    assert!(summary.writes > 100, "{summary:?}");
    let ends = [daemon.try_wait(), controller.try_wait(), client.try_wait()];
    assert!(ends.iter().all(Option::is_none), "{ends:?}; {}", daemon.errors());
    client.await_line("progress after the garbage", |line| used(line) > before + 100);
}

#[test]
fn announcements_full_of_garbage_are_passed_over() {
    let site = DaemonSite::new();
    let path = site.host().trains_directory().join("1.controller");
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    let garbage: Vec<u8> = (0..100_000).map(|_| random.random()).collect();
    std::fs::write(&path, &garbage).unwrap();
    let held = std::fs::File::open(&path).unwrap();
    held.lock().unwrap();
    let config = site.write_config(1, "", "[[pipelines]]\nkind = \"echo\"\n");
    let mut daemon = site.start(DYNOCAR, &["run", "--config", config.to_str().unwrap()]);
    daemon.await_error("serving");
    let start = Instant::now();
    let file = OpenOptions::new().write(true).open(&path).unwrap();
    while start.elapsed() < Duration::from_secs(1) {
        file.write_at(&[random.random(), b'=', random.random()], random.random_range(0..300))
            .unwrap();
    }
    assert!(daemon.try_wait().is_none(), "{}", daemon.errors());
    await_true(|| daemon.errors().contains("no controller"), || daemon.errors());
}
