//! Kills, stops and restarts of daemon, controller and client at random moments.
//!
//! Invariants after every round: the client reads fresh snapshots of the daemon that lives, without anything reopened;
//! no epoch came twice or ran backwards; while the daemon was dead or stopped, no older snapshot passed as fresh. When
//! all processes are gone, so are their segments of shared memory.

use std::time::Duration;

use dynocar_client::reader::STALE_AFTER_NS;
use dynocar_transport::monotonic_now_ns;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rustix::process::Signal;

use super::Programs;
use crate::process::{DaemonSite, Process, await_true};

/// Faults of the processes in one round.
#[derive(Clone, Copy, Debug)]
enum Fault {
    KillDaemon,
    StopDaemon,
    EndDaemon,
    KillController,
    StopController,
    KillClient,
    StopClient,
    KillDaemonAndController,
    KillAll,
    SecondDaemon,
}

const FAULTS: [Fault; 10] = [
    Fault::KillDaemon,
    Fault::StopDaemon,
    Fault::EndDaemon,
    Fault::KillController,
    Fault::StopController,
    Fault::KillClient,
    Fault::StopClient,
    Fault::KillDaemonAndController,
    Fault::KillAll,
    Fault::SecondDaemon,
];

/// One poll of the client, see `dynocar-test-peer`.
#[derive(Clone, Copy, Debug)]
struct ClientPoll {
    epoch: u64,
    sequence: u64,
    used: u64,
    is_stale: bool,
    is_invalid: bool,
    time_ns: i64,
}

fn parse(line: &str) -> Option<ClientPoll> {
    let words: Vec<&str> = line.split(' ').collect();
    let number = |index: usize| words.get(index)?.parse().ok();
    Some(ClientPoll {
        epoch: number(0)?,
        sequence: number(1)?,
        used: number(3)?,
        is_stale: words.get(6)?.parse().ok()?,
        is_invalid: *words.get(7)? == "invalid",
        time_ns: number(8)? as i64,
    })
}

/// The processes and their known state.
struct Cast<'a> {
    site: DaemonSite,
    programs: &'a Programs,
    config: String,
    daemon: Process,
    controller: Process,
    client: Process,
    epoch: u64,
    /// Lines of the client that were checked.
    checked: usize,
    newest: Option<ClientPoll>,
    /// Times in ns between which no daemon was at work.
    silences_ns: Vec<(i64, i64)>,
}

/// Summary of the rounds.
#[derive(Clone, Copy, Debug, Default)]
pub struct FaultsSummary {
    /// Polls of the clients that were checked.
    pub polls: u64,
    /// Daemons started.
    pub daemons: u64,
}

fn start(site: &DaemonSite, program: &std::path::Path, arguments: &[&str]) -> Process {
    site.start(program.to_str().expect("a UTF-8 path"), arguments)
}

fn start_daemon(site: &DaemonSite, programs: &Programs, config: &str) -> (Process, u64) {
    let daemon = start(site, &programs.dynocar, &["run", "--config", config]);
    daemon.await_error("serving");
    let log = daemon.errors();
    let epoch = log.split("epoch=").nth(1).and_then(|rest| rest.split_whitespace().next());
    let epoch = epoch.and_then(|word| word.parse().ok());
    (daemon, epoch.unwrap_or_else(|| panic!("no epoch in the log:\n{log}")))
}

impl<'a> Cast<'a> {
    fn new(programs: &'a Programs) -> Self {
        let site = DaemonSite::new();
        let pipelines = "[[pipelines]]\nkind = \"echo\"\n";
        let config = site.write_config(1, "idle = \"adaptive\"", pipelines);
        let config = config.to_str().expect("a UTF-8 path").to_owned();
        let (daemon, epoch) = start_daemon(&site, programs, &config);
        let controller = start(&site, &programs.peer, &["controller", "1", "2000"]);
        let client = start(&site, &programs.peer, &["client", "1", "2000"]);
        Cast {
            site,
            programs,
            config,
            daemon,
            controller,
            client,
            epoch,
            checked: 0,
            newest: None,
            silences_ns: Vec::new(),
        }
    }

    fn restart_daemon(&mut self, dead_ns: i64) {
        self.silences_ns.push((dead_ns, monotonic_now_ns()));
        let (daemon, epoch) = start_daemon(&self.site, self.programs, &self.config);
        assert!(epoch > self.epoch, "epoch {epoch} after {}", self.epoch);
        (self.daemon, self.epoch) = (daemon, epoch);
    }

    fn restart_controller(&mut self) {
        self.controller = start(&self.site, &self.programs.peer, &["controller", "1", "2000"]);
    }

    fn restart_client(&mut self) {
        self.check_polls();
        self.client = start(&self.site, &self.programs.peer, &["client", "1", "2000"]);
        (self.checked, self.newest) = (0, None);
    }

    fn commit(&mut self, fault: Fault, pause: Duration) {
        let wait = || std::thread::sleep(pause);
        match fault {
            Fault::KillDaemon | Fault::EndDaemon => {
                let is_kill = matches!(fault, Fault::KillDaemon);
                self.daemon.signal(if is_kill { Signal::KILL } else { Signal::TERM });
                self.daemon.wait();
                let dead_ns = monotonic_now_ns();
                wait();
                self.restart_daemon(dead_ns);
            }
            Fault::StopDaemon => {
                self.daemon.stop();
                let stopped_ns = monotonic_now_ns();
                wait();
                self.silences_ns.push((stopped_ns, monotonic_now_ns()));
                self.daemon.signal(Signal::CONT);
            }
            Fault::KillController => {
                self.controller.end(Signal::KILL);
                wait();
                self.restart_controller();
            }
            Fault::StopController | Fault::StopClient => {
                let process = match fault {
                    Fault::StopClient => &self.client,
                    _ => &self.controller,
                };
                process.stop();
                wait();
                process.signal(Signal::CONT);
            }
            Fault::KillClient => {
                self.client.end(Signal::KILL);
                wait();
                self.restart_client();
            }
            Fault::KillDaemonAndController | Fault::KillAll => {
                self.daemon.end(Signal::KILL);
                let dead_ns = monotonic_now_ns();
                self.controller.end(Signal::KILL);
                if matches!(fault, Fault::KillAll) {
                    self.client.end(Signal::KILL);
                    self.restart_client();
                }
                wait();
                self.restart_controller();
                self.restart_daemon(dead_ns);
            }
            Fault::SecondDaemon => {
                let arguments = ["run", "--config", &self.config];
                let mut second = start(&self.site, &self.programs.dynocar, &arguments);
                assert_eq!(second.wait().code(), Some(1), "{}", second.errors());
                assert!(second.errors().contains("already has a daemon"), "{}", second.errors());
            }
        }
    }

    /// Waits until the client reads on from the daemon that lives.
    fn await_progress(&mut self, case: &str) {
        let epoch = self.epoch;
        let last = |it: &Process| it.last_line().as_deref().and_then(parse);
        let before = last(&self.client).filter(|seen| seen.epoch == epoch).map_or(0, |it| it.used);
        await_true(
            || {
                last(&self.client)
                    .is_some_and(|seen| seen.epoch == epoch && !seen.is_stale && seen.used > before)
            },
            || {
                format!(
                    "progress in {case}; client {:?}, {}, controller {}, daemon {}",
                    self.client.last_line(),
                    self.client.errors(),
                    self.controller.errors(),
                    self.daemon.errors()
                )
            },
        );
    }

    /// Checks every poll of the client since the last look; gives their number.
    fn check_polls(&mut self) -> u64 {
        let lines = self.client.lines_from(self.checked);
        self.checked += lines.len();
        for line in &lines {
            let Some(seen) = parse(line) else { continue };
            if let Some(before) = self.newest {
                let is_onward = (seen.epoch, seen.sequence) >= (before.epoch, before.sequence);
                assert!(is_onward, "backwards: {before:?}, then {seen:?}");
            }
            assert_eq!(seen.is_stale, seen.is_stale && seen.is_invalid, "{line}");
            for &(from_ns, to_ns) in &self.silences_ns {
                let is_silent = seen.time_ns > from_ns + STALE_AFTER_NS && seen.time_ns < to_ns;
                assert!(!is_silent || seen.is_stale, "fresh in a silence: {line}");
            }
            self.newest = Some(seen);
        }
        // Silences that all polls to come lie behind.
        if let Some(newest) = self.newest {
            self.silences_ns.retain(|&(_, to_ns)| to_ns >= newest.time_ns);
        }
        lines.len() as u64
    }
}

/// Runs `rounds` rounds of random faults.
///
/// # Panics
///
/// When an invariant of the module does not hold; the message names seed and round.
pub fn run(programs: &Programs, rounds: u64, seed: u64) -> FaultsSummary {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut cast = Cast::new(programs);
    let mut summary = FaultsSummary { polls: 0, daemons: 1 };
    cast.await_progress(&format!("the first round of seed {seed}"));
    for round in 1..=rounds {
        let fault = FAULTS[random.random_range(0..FAULTS.len())];
        std::thread::sleep(Duration::from_micros(random.random_range(0..30_000)));
        let pause = Duration::from_millis(random.random_range(0..500));
        let case = format!("round {round} of seed {seed}, {fault:?} for {pause:?}");
        let epoch = cast.epoch;
        cast.commit(fault, pause);
        cast.await_progress(&case);
        summary.polls += cast.check_polls();
        summary.daemons += u64::from(cast.epoch != epoch);
        if round % 100 == 0 {
            dynocar::output::report_line(&format!("{case}: {summary:?}"));
        }
    }
    cast.client.end(Signal::KILL);
    cast.controller.end(Signal::KILL);
    cast.daemon.end(Signal::KILL);
    // The next process clears away the remains of the dead, and its own.
    let (mut last, _) = start_daemon(&cast.site, programs, &cast.config);
    last.signal(Signal::TERM);
    assert!(last.wait().success(), "{}", last.errors());
    assert_eq!(cast.site.segments(), Vec::<String>::new(), "seed {seed}: left in shared memory");
    summary
}
