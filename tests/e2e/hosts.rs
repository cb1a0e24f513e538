//! Variety of real hosts: roots of any length and spelling, cleaners of temporary files, containers, other users.
//!
//! A test that mounts a file system does so in a mount namespace of its own.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use dynocar_client::{Host, SamplePublisher, SnapshotReader};
use dynocar_shared::{SampleField, TrainId, TrainSample};
use dynocar_tests::process::{DaemonSite, Process, await_true};
use dynocar_tests::soak::{Programs, starts};
use rustix::process::Signal;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");
const PEER: &str = env!("CARGO_BIN_EXE_dynocar-test-peer");
const ECHO: &str = "[[pipelines]]\nkind = \"echo\"\n";
const TRAIN: TrainId = TrainId(1);

fn daemon_at(site: &DaemonSite, root: &Path) -> Process {
    let config = site.write_config(1, "", ECHO);
    let run = ["run", "--config", config.to_str().expect("UTF-8")];
    site.start_with(DYNOCAR, &run, &[("DYNOCAR_ROOT", root.to_str().expect("UTF-8"))])
}

/// Publishes some samples under a root and waits until the daemon there has counted every one.
pub(super) fn drive(host: &Host, daemon: &Process) {
    const SAMPLES: u64 = 50;
    let mut publisher = SamplePublisher::open(host, TRAIN).unwrap();
    let mut reader = SnapshotReader::open(host, TRAIN).unwrap();
    for index in 0..SAMPLES {
        let mut sample = TrainSample::empty(TRAIN).with(SampleField::Speed, 20.0);
        sample.time_ns = index as i64 * 1_000_000;
        publisher.publish(&mut sample).unwrap();
    }
    await_true(
        || {
            reader.poll();
            let last = publisher.sequence();
            reader.readings(0).any(|it| it.snapshot.sample_sequence == last)
        },
        || format!("the last sample: {}", daemon.errors()),
    );
    let it = *reader.readings(0).next().unwrap().snapshot;
    // The daemon counts the train's samples, of all its controllers.
    let counted = it.samples_used + it.samples_rejected;
    assert_eq!((counted, it.samples_lost), (publisher.sequence(), 0));
}

/// A shell script in a mount namespace of its own; the reason, where this user may make none.
pub(super) fn in_namespace(script: &str) -> Result<Command, String> {
    let probe =
        Command::new("unshare").args(["-m", "mount", "-t", "tmpfs", "none", "/mnt"]).output();
    let probe = probe.map_err(|error| format!("unshare: {error}"))?;
    if !probe.status.success() {
        return Err(String::from_utf8_lossy(&probe.stderr).into_owned());
    }
    let mut made = Command::new("unshare");
    made.args(["-m", "sh", "-c", script]);
    Ok(made)
}

#[test]
fn a_root_of_any_length_serves_and_one_beyond_the_systems_limit_is_refused_with_its_length() {
    let site = DaemonSite::new();
    for length in [28, 31, 36, 64, 108, 140, 150, 255, 1000, 3900] {
        let mut root = site.path().to_path_buf();
        while root.as_os_str().len() < length {
            let missing = length.saturating_sub(root.as_os_str().len() + 1).clamp(1, 200);
            root.push("d".repeat(missing));
        }
        let mut daemon = daemon_at(&site, &root);
        daemon.await_error("serving");
        drive(&Host::at(&root).unwrap(), &daemon);
        assert!(daemon.end(Signal::TERM).success(), "{length}: {}", daemon.errors());
    }
    let long = PathBuf::from(format!("/{}", "d/".repeat(2010)));
    let mut daemon = daemon_at(&site, &long);
    assert_eq!(daemon.wait().code(), Some(2));
    assert!(daemon.errors().contains("4021 bytes long, at most 4000"), "{}", daemon.errors());
    assert!(Host::at(&long).unwrap_err().to_string().contains("4021 bytes long"));
}

#[test]
fn processes_that_are_killed_while_they_start_leave_every_root_servable() {
    let programs = Programs { dynocar: DYNOCAR.into(), peer: PEER.into() };
    println!("{:?}", starts::run(&programs, 8, 1));
}

#[test]
fn every_spelling_of_a_directory_is_one_root() {
    let site = DaemonSite::new();
    let root = site.path().join("spelled");
    let mut daemon = daemon_at(&site, &root);
    daemon.await_error("serving");
    std::os::unix::fs::symlink(&root, site.path().join("link")).unwrap();
    for spelling in ["spelled/", "./spelled", "link", "link/../spelled/."] {
        drive(&Host::at(&site.path().join(spelling)).unwrap(), &daemon);
    }
    assert!(daemon.end(Signal::TERM).success());
}

#[test]
fn two_installations_of_one_path_that_share_memory_count_nothing_of_each_other() {
    let site = DaemonSite::new();
    let config = site.write_config(1, "", ECHO);
    let (root, config) = (site.path().join("root"), config.display().to_string());
    let root = root.display();
    let installation = format!(
        "mkdir -p {root} && mount -t tmpfs -o mode=700 none {root} && \
         {{ {DYNOCAR} run --config {config} & daemon=$!; sleep 0.5; timeout 2 {PEER} controller 1 2000; \
         kill $daemon; wait $daemon; }} 2>&1"
    );
    let start = || {
        let mut command = in_namespace(&installation)?;
        command.env("DYNOCAR_ROOT", root.to_string()).stdout(Stdio::piped());
        command.env("XDG_STATE_HOME", site.path());
        Ok::<_, String>(command.spawn().unwrap())
    };
    let both = match [start(), start()] {
        [Ok(one), Ok(other)] => [one, other],
        [Err(reason), _] | [_, Err(reason)] => return println!("not tried: {reason}"),
    };
    for installation in both {
        let output = installation.wait_with_output().unwrap();
        let log = String::from_utf8_lossy(&output.stdout);
        let totals =
            log.lines().find(|line| line.contains("stopped")).unwrap_or_else(|| panic!("{log}"));
        assert!(totals.contains(" rejected=0") && !totals.contains("used=0"), "{log}");
        // The sample that a killed controller was handing over is lost.
        assert!(totals.contains(" lost=0 ") || totals.contains(" lost=1 "), "{log}");
    }
}

#[test]
fn a_root_in_use_is_locked_as_cleaners_honour_it_and_one_that_was_removed_ends_the_daemon_in_words()
{
    let site = DaemonSite::new();
    let root = site.path().join("aged");
    let mut daemon = daemon_at(&site, &root);
    daemon.await_error("serving");
    // systemd-tmpfiles passes over a directory that it cannot lock (tmpfiles.d(5)).
    assert!(File::open(&root).unwrap().try_lock().is_err());
    let host = Host::at(&root).unwrap();
    let reader = SnapshotReader::open(&host, TRAIN).unwrap();
    std::fs::remove_dir_all(&root).unwrap();
    assert_eq!(daemon.wait().code(), Some(1));
    let said = daemon.errors();
    assert_eq!(said.matches("was removed or replaced").count(), 1, "{said}");
    assert!(reader.daemon().unwrap_err().to_string().contains("was removed or replaced"));
    let mut next = daemon_at(&site, &root);
    next.await_error("serving");
    drive(&Host::at(&root).unwrap(), &next);
    assert!(next.end(Signal::TERM).success());
}

#[test]
fn a_daemon_whose_announcement_was_removed_ends_in_words() {
    let site = DaemonSite::new();
    let root = site.path().join("aged");
    let mut daemon = daemon_at(&site, &root);
    daemon.await_error("serving");
    std::fs::remove_file(root.join("trains/1.daemon")).unwrap();
    assert_eq!(daemon.wait().code(), Some(1));
    assert!(daemon.errors().contains("1.daemon: the root directory was removed"));
}

#[test]
fn separate_shared_memories_are_named_with_what_containers_need() {
    let site = DaemonSite::new();
    let daemon = daemon_at(&site, site.host().root());
    daemon.await_error("serving");
    let script = format!(
        "mount -t tmpfs none /dev/shm && {{ {PEER} client 1 1000; {DYNOCAR} health; echo status $?; }} 2>&1"
    );
    let mut command = match in_namespace(&script) {
        Ok(command) => command,
        Err(reason) => return println!("not tried: {reason}"),
    };
    let output = command.env("DYNOCAR_ROOT", site.host().root()).output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains("SeparateMemory"), "{said}");
    assert!(said.contains("a /dev/shm of its own") && said.contains("--ipc="), "{said}");
    assert!(said.contains("status 5"), "{said}");
}

#[test]
fn shared_memory_that_cannot_be_used_is_named_by_everybody() {
    let site = DaemonSite::new();
    let config = site.write_config(1, "", ECHO);
    let root = site.path().join("root");
    let everybody = format!(
        "timeout -s TERM 5 {DYNOCAR} run --config {}; echo status $?; {DYNOCAR} health; echo status $?; \
         {PEER} controller 1 1000; {PEER} client 1 1000",
        config.display()
    );
    for (mount, words) in [
        (
            "mount -t tmpfs -o ro none /dev/shm",
            "shared memory cannot be used: Read-only file system",
        ),
        ("mount -t tmpfs none /dev", "shared memory cannot be used: No such file or directory"),
        (
            "mount -t tmpfs -o nr_inodes=3 none /dev/shm",
            "shared memory cannot be used: No space left",
        ),
        ("mount -t tmpfs -o size=1m none /dev/shm", "shared memory is full: 1024 KiB free"),
        (
            "mount -t tmpfs -o size=8m none /dev/shm; head -c 6m /dev/zero >/dev/shm/neighbour",
            "shared memory is full: 2048 KiB free",
        ),
    ] {
        let mut command = match in_namespace(&format!("{{ {mount}; {everybody}; }} 2>&1")) {
            Ok(command) => command,
            Err(reason) => return println!("not tried: {reason}"),
        };
        let output =
            command.env("DYNOCAR_ROOT", &root).env("RUST_BACKTRACE", "0").output().unwrap();
        let said = String::from_utf8_lossy(&output.stdout);
        // The peers give the value, whose words are those of the type.
        let named = ["SharedMemoryUnusable", "SharedMemoryFull"].map(|it| said.matches(it).count());
        assert_eq!((said.matches(words).count(), named.iter().sum::<usize>()), (1, 2), "{said}");
        assert!(said.contains("status 1") && said.contains("status 6"), "{said}");
        assert!(!said.contains("DYNOCAR_ROOT"), "{said}");
    }
}

#[test]
fn a_root_of_another_user_says_how_to_ask_and_one_of_the_system_keeps_its_mode() {
    let site = DaemonSite::new();
    let root = site.path().join("of-another");
    std::fs::create_dir(&root).unwrap();
    if std::os::unix::fs::chown(&root, Some(65534), Some(65534)).is_ok() {
        let variables = [("DYNOCAR_ROOT", root.to_str().unwrap())];
        let mut health = site.start_with(DYNOCAR, &["health"], &variables);
        assert_eq!(health.wait().code(), Some(1));
        assert!(health.errors().contains("sudo -u '#65534'"), "{}", health.errors());
    }
    let script = format!(
        "mount -t tmpfs -o mode=755 none /run && mkdir /run/lock && chmod 755 /run/lock && touch /run/lock/x && \
         for root in /run /var/run /run/lock /tmp; do DYNOCAR_ROOT=$root {DYNOCAR} health; echo $?; \
         stat -c %a $root/.; ls $root/. | grep -c trains; done"
    );
    match in_namespace(&script) {
        Err(reason) => println!("not tried: {reason}"),
        Ok(mut command) => {
            let output = command.output().unwrap();
            let said = String::from_utf8_lossy(&output.stdout);
            let expected = ["1", "755", "0", "1", "755", "0", "1", "755", "0", "1", "1777", "0"];
            assert_eq!(said.lines().collect::<Vec<_>>(), expected, "{output:?}");
        }
    }
}
