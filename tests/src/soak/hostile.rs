//! Garbage written into shared memory by a process of the same user.

use std::fs::OpenOptions;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::Programs;
use crate::process::{DaemonSite, await_true};

/// A part of the transport's shared memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SegmentKind {
    /// The memory of samples and snapshots.
    Payload,
    /// The administration of that memory.
    PayloadBooks,
    /// The messages on their way between two ports.
    Connections,
    /// The ports of a service.
    Services,
    /// The threads that wait to be woken.
    Events,
    /// The counts of the samples.
    Counts,
}

impl SegmentKind {
    /// All of them.
    pub const ALL: [SegmentKind; 6] = [
        SegmentKind::Payload,
        SegmentKind::PayloadBooks,
        SegmentKind::Connections,
        SegmentKind::Services,
        SegmentKind::Events,
        SegmentKind::Counts,
    ];

    const fn suffix(self) -> &'static str {
        match self {
            SegmentKind::Payload | SegmentKind::PayloadBooks => ".data",
            SegmentKind::Connections => ".connection",
            SegmentKind::Services => ".dynamic",
            SegmentKind::Events => ".event_mgmt",
            SegmentKind::Counts => ".count",
        }
    }

    /// Returns the first byte and the end of the overwritten part of a segment of this length.
    const fn range(self, length: u64) -> (u64, u64) {
        match self {
            SegmentKind::Payload => (length / 2, length),
            SegmentKind::PayloadBooks => (0, length / 8),
            _ => (0, length),
        }
    }
}

/// Overwritten memory.
#[derive(Clone, Copy, Debug, Default)]
pub struct Vandalism {
    /// Segments of the kind.
    pub segments: usize,
    /// Writes of eight random bytes each.
    pub writes: u64,
}

/// Overwrites eight random bytes at random places for a while, twenty thousand times a second at
/// most.
///
/// # Panics
///
/// When `/dev/shm` cannot be read.
pub fn vandalise(site: &DaemonSite, kind: SegmentKind, duration: Duration, seed: u64) -> Vandalism {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let paths: Vec<PathBuf> = site
        .segments()
        .into_iter()
        .filter(|name| name.ends_with(kind.suffix()))
        .map(|name| Path::new("/dev/shm").join(name))
        .collect();
    let files: Vec<_> = paths
        .iter()
        .filter_map(|path| {
            let file = OpenOptions::new().write(true).open(path).ok()?;
            let length = file.metadata().ok()?.len();
            Some((file, kind.range(length)))
        })
        .collect();
    let mut done = Vandalism { segments: files.len(), writes: 0 };
    let start = Instant::now();
    while start.elapsed() < duration && !files.is_empty() {
        let (file, (from, to)) = &files[random.random_range(0..files.len())];
        let index = random.random_range(*from..to.saturating_sub(8).max(from + 1));
        let garbage: [u8; 8] = random.random();
        // A segment that was removed meanwhile can still be written.
        done.writes += u64::from(file.write_at(&garbage, index).is_ok());
        std::thread::sleep(Duration::from_micros(50));
    }
    done
}

/// Who lives after garbage in one kind of segment.
#[derive(Clone, Debug)]
pub struct Survivors {
    /// The kind.
    pub kind: SegmentKind,
    /// Daemon, controller, client.
    pub alive: [bool; 3],
    /// How the dead ended.
    pub ends: Vec<String>,
}

/// Writes garbage into each kind of segment of a fresh cast; says who lives.
///
/// # Panics
///
/// When a cast does not start.
pub fn measure(programs: &Programs, rounds: u64, seed: u64) -> Vec<Survivors> {
    let text = |path: &Path| path.to_str().expect("a UTF-8 path").to_owned();
    let (dynocar, peer) = (text(&programs.dynocar), text(&programs.peer));
    let mut found = Vec::new();
    for (kind, round) in
        SegmentKind::ALL.into_iter().flat_map(|kind| (0..rounds).map(move |it| (kind, it)))
    {
        let site = DaemonSite::new();
        let config = site.write_config(1, "", "[[pipelines]]\nkind = \"echo\"\n");
        let daemon = site.start(&dynocar, &["run", "--config", &text(&config)]);
        daemon.await_error("serving");
        let controller = site.start(&peer, &["controller", "1", "2000"]);
        let client = site.start(&peer, &["client", "1", "2000"]);
        await_true(
            || client.last_line().is_some_and(|it| !it.starts_with("none")),
            || "a snapshot".into(),
        );
        vandalise(&site, kind, Duration::from_secs(1), seed + round);
        let mut cast = [daemon, controller, client];
        let ends = cast.each_mut().map(|process| process.try_wait());
        let names = ["daemon", "controller", "client"];
        let sentences =
            ends.iter().zip(names).filter_map(|(end, name)| Some(format!("{name}: {}", (*end)?)));
        found.push(Survivors {
            kind,
            alive: ends.map(|end| end.is_none()),
            ends: sentences.collect(),
        });
    }
    found
}
