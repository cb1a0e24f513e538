//! `kill -9` of daemon, controller or client, and the view of the others, with real processes.

use std::time::Instant;

use dynocar_tests::process::{DaemonSite, Process};

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");
const PEER: &str = env!("CARGO_BIN_EXE_dynocar-test-peer");

const ECHO: &str = "[[pipelines]]\nkind = \"echo\"\n";

/// A line of the test client.
#[derive(Debug)]
struct ClientLine {
    epoch: u64,
    sequence: u64,
    used: u64,
    lost: u64,
    age_ms: i64,
    is_stale: bool,
    status: String,
}

fn parse(line: &str) -> Option<ClientLine> {
    let words: Vec<&str> = line.split(' ').collect();
    let number = |index: usize| words.get(index)?.parse().ok();
    Some(ClientLine {
        epoch: number(0)?,
        sequence: number(1)?,
        used: number(3)?,
        lost: number(4)?,
        age_ms: words.get(5)?.parse().ok()?,
        is_stale: words.get(6)?.parse().ok()?,
        status: (*words.get(7)?).to_owned(),
    })
}

fn await_seen(client: &Process, what: &str, condition: impl Fn(&ClientLine) -> bool) -> ClientLine {
    let line = client.await_line(what, |line| parse(line).is_some_and(|seen| condition(&seen)));
    parse(&line).expect("a parsed line")
}

struct Cast {
    site: DaemonSite,
    config: String,
}

impl Cast {
    fn new() -> Self {
        let site = DaemonSite::new();
        let config = site.write_config(1, "idle = \"adaptive\"", ECHO);
        Cast { site, config: config.to_str().expect("a UTF-8 path").to_owned() }
    }

    fn daemon(&self) -> Process {
        self.site.start(DYNOCAR, &["run", "--config", &self.config])
    }

    fn controller(&self) -> Process {
        self.site.start(PEER, &["controller", "1", "5000"])
    }

    fn client(&self) -> Process {
        self.site.start(PEER, &["client", "1", "5000"])
    }
}

#[test]
fn dead_daemon_is_noticed_and_the_next_one_is_read_without_reopening() {
    let cast = Cast::new();
    let mut daemon = cast.daemon();
    let _controller = cast.controller();
    let client = cast.client();
    let mut last = await_seen(&client, "a first snapshot", |seen| seen.used > 0 && !seen.is_stale);
    for _round in 0..5 {
        daemon.kill();
        let stale = await_seen(&client, "growing age", |seen| seen.is_stale && seen.age_ms > 300);
        assert_eq!((stale.epoch, stale.status.as_str()), (last.epoch, "invalid"));
        daemon = cast.daemon();
        daemon.await_error("serving");
        let back = Instant::now();
        let fresh = await_seen(&client, "a new epoch", |seen| {
            seen.epoch > last.epoch && !seen.is_stale && seen.used > 0
        });
        println!("fresh snapshot seen {} ms after the daemon was back", back.elapsed().as_millis());
        last = fresh;
    }
    let mut polls_ns: Vec<u64> =
        client.lines().iter().filter_map(|line| line.rsplit(' ').next()?.parse().ok()).collect();
    polls_ns.sort_unstable();
    println!("longest of {} polls: {} ns", polls_ns.len(), polls_ns[polls_ns.len() - 1]);
}

#[test]
fn dead_controller_is_replaced_and_its_samples_are_counted() {
    let cast = Cast::new();
    let _daemon = cast.daemon();
    let mut controller = cast.controller();
    let client = cast.client();
    for _round in 0..4 {
        let before = await_seen(&client, "samples in use", |seen| seen.used > 20);
        controller.kill();
        controller = cast.controller();
        let after = await_seen(&client, "samples of the next controller", |seen| {
            seen.used > before.used + 50
        });
        assert_eq!(after.epoch, before.epoch);
        assert_eq!(after.lost, 0, "nothing was lost between the two");
        assert!(after.sequence > before.sequence);
    }
}

#[test]
fn dead_client_is_replaced_and_reads_on() {
    let cast = Cast::new();
    let _daemon = cast.daemon();
    let _controller = cast.controller();
    let mut used = 0;
    for _round in 0..4 {
        let client = cast.client();
        let seen = await_seen(&client, "newer samples", |seen| seen.used > used && !seen.is_stale);
        used = seen.used;
        client.kill();
    }
}

#[test]
fn a_client_that_comes_before_the_daemon_is_served() {
    let cast = Cast::new();
    let client = cast.client();
    client.await_line("no snapshot yet", |line| line.starts_with("none"));
    let _daemon = cast.daemon();
    await_seen(&client, "the first snapshot", |seen| {
        !seen.is_stale && seen.status == "unestimated"
    });
    let _controller = cast.controller();
    await_seen(&client, "samples in use", |seen| seen.used > 0);
}

#[test]
fn nothing_is_left_in_shared_memory_after_deaths_and_a_clean_stop() {
    let cast = Cast::new();
    for _round in 0..3 {
        let daemon = cast.daemon();
        let controller = cast.controller();
        let client = cast.client();
        await_seen(&client, "samples in use", |seen| seen.used > 0);
        daemon.kill();
        controller.kill();
        client.kill();
    }
    let mut daemon = cast.daemon();
    daemon.await_error("serving");
    daemon.signal(rustix::process::Signal::TERM);
    assert!(daemon.wait().success());
    assert_eq!(cast.site.segments(), Vec::<String>::new());
}
