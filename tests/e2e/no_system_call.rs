//! A controller's cycle makes no system call while the pipelines are awake: the kernel itself watches, and kills a
//! process that makes one.

use dynocar_tests::process::{DaemonSite, Process};

use crate::hold_the_cores;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");
const PEER: &str = env!("CARGO_BIN_EXE_dynocar-sealed-peer");

const BUSY: &str = "idle = \"busy\"";
/// The thread falls asleep when no sample has come for a second.
const ADAPTIVE: &str = "idle = \"adaptive\"\nspin_us = 1000000";
const ECHO: &str = "[[pipelines]]\nkind = \"echo\"\n";

/// Starts a daemon that stays awake, and a sealed controller that performs an action.
fn sealed(site: &DaemonSite, idle: &str, what: &str) -> (Process, Process) {
    let config = site.write_config(1, idle, ECHO);
    let daemon = site.start(DYNOCAR, &["run", "--config", config.to_str().expect("UTF-8")]);
    daemon.await_error("serving");
    (daemon, site.start(PEER, &[what, "1"]))
}

fn news(peer: &mut Process) -> u64 {
    let status = peer.wait();
    assert!(status.success(), "{status}: {}", peer.errors());
    peer.await_line("a number", |line| !line.is_empty()).parse().expect("a number")
}

#[test]
fn the_seal_kills_at_a_system_call() {
    use std::os::unix::process::ExitStatusExt;
    let _cores = hold_the_cores();
    let site = DaemonSite::new();
    let (_daemon, mut peer) = sealed(&site, BUSY, "call");
    assert_eq!(peer.wait().signal(), Some(libc::SIGSYS), "{}", peer.errors());
}

#[test]
fn a_poll_without_news_makes_no_system_call() {
    let _cores = hold_the_cores();
    let site = DaemonSite::new();
    let (_daemon, mut peer) = sealed(&site, BUSY, "poll");
    // Nothing is published meanwhile, and all that was published before is answered.
    assert_eq!(news(&mut peer), 0);
}

#[test]
fn publish_and_poll_make_no_system_call_while_the_daemon_is_awake() {
    let _cores = hold_the_cores();
    for idle in [BUSY, ADAPTIVE] {
        let site = DaemonSite::new();
        let (_daemon, mut peer) = sealed(&site, idle, "cycle");
        assert!(news(&mut peer) >= 50, "{idle}");
    }
}
