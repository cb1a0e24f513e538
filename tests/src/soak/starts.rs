//! `kill -9` of daemon, controller and client at random moments of their start, and of their work.
//!
//! Invariants after every round: after all processes of a root have ended, the next daemon serves it; after another
//! process was killed, the present daemon still serves it. In both cases a sample comes through.

use std::time::Duration;

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::Programs;
use crate::process::{DaemonSite, Process};

/// Greatest time in ms from the start of a process until it is killed.
const START_MS: u64 = 60;
/// Processes that are killed in one round, on one root.
const STARTS_PER_ROUND: u64 = 10;

/// Summary of the rounds.
#[derive(Clone, Copy, Debug, Default)]
pub struct StartsSummary {
    /// Processes started and killed.
    pub starts: u64,
    /// Roots that were served afterwards.
    pub served: u64,
    /// Refused starts of the other processes of a round; a refused process must not hang.
    pub refused: u64,
}

/// Kills starting processes on a root of its own in each round.
///
/// # Panics
///
/// When a root cannot be served any more, with the daemon's messages.
pub fn run(programs: &Programs, rounds: u64, seed: u64) -> StartsSummary {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut summary = StartsSummary::default();
    for _ in 0..rounds {
        round(programs, &mut random, &mut summary);
    }
    summary
}

/// Part that a round starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    Daemon,
    Controller,
    Client,
}

fn round(programs: &Programs, random: &mut impl Rng, summary: &mut StartsSummary) {
    let site = DaemonSite::new();
    let config = site.write_config(1, "", "[[pipelines]]\nkind = \"echo\"\n");
    let config = config.to_str().expect("a UTF-8 path");
    let dynocar = programs.dynocar.to_str().expect("a UTF-8 path");
    let peer = programs.peer.to_str().expect("a UTF-8 path");
    let start = |part| match part {
        Part::Daemon => site.start(dynocar, &["run", "--config", config]),
        Part::Controller => site.start(peer, &["controller", "1", "1000"]),
        Part::Client => site.start(peer, &["client", "1", "1000"]),
    };
    // Who lives on while others are killed.
    let mut company: Option<(Part, Process)> = None;
    for _ in 0..STARTS_PER_ROUND {
        let part = [Part::Daemon, Part::Controller, Part::Client][random.random_range(0..3)];
        let mut process = start(part);
        std::thread::sleep(Duration::from_micros(random.random_range(0..START_MS * 1000)));
        summary.starts += 1;
        if process.try_wait().is_some() {
            summary.refused += 1;
        } else if company.is_none() && random.random_bool(0.3) {
            company = Some((part, process));
        } else {
            process.kill();
        }
        if random.random_bool(0.2) {
            company.take().into_iter().for_each(|it| it.1.kill());
        }
    }
    // Half of the last ones are alone; the others have the company of who lives on.
    if random.random_bool(0.5) {
        company.take().into_iter().for_each(|it| it.1.kill());
    }
    let lives = |part| company.as_ref().is_some_and(|it| it.0 == part);
    let daemon = (!lives(Part::Daemon)).then(|| start(Part::Daemon));
    let daemon = daemon.as_ref().or(company.as_ref().map(|it| &it.1)).expect("a daemon");
    daemon.await_error("serving");
    let _controller = (!lives(Part::Controller)).then(|| start(Part::Controller));
    let client = start(Part::Client);
    let is_served = |line: &str| {
        let words: Vec<&str> = line.split(' ').collect();
        words.get(6) == Some(&"false") && words[3] != "0"
    };
    client.await_line(&format!("samples that come through; {}", daemon.errors()), is_served);
    summary.served += 1;
}
