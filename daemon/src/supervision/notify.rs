//! Readiness and watchdog by systemd's notification protocol (sd_notify(3)): datagrams of
//! `KEY=value` lines to the socket that `NOTIFY_SOCKET` names.
//!
//! The watchdog is fed only while every pipeline thread shows life, so that a thread that hangs
//! brings the restart that the unit asks for.

use std::cell::RefCell;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::sync::Arc;
use std::time::{Duration, Instant};

use tracing::{error, warn};

use crate::runtime::tally::Tally;

/// A pipeline thread without a sign of life for this long hangs; it gives one every heartbeat, at least every 0.1 s.
const SILENCE_MAX: Duration = Duration::from_secs(2);

/// The supervisor's socket, if there is a supervisor.
#[derive(Debug)]
pub struct Supervisor {
    socket: Option<(UnixDatagram, SocketAddr)>,
    /// Interval between signs of life: half of the watchdog's limit.
    feeding: Option<Duration>,
}

impl Supervisor {
    /// Returns the supervisor that the environment names.
    pub fn from_environment() -> Self {
        let variable = |name| std::env::var(name).ok();
        let limit = variable("WATCHDOG_USEC").and_then(|text| text.parse().ok());
        let is_ours = variable("WATCHDOG_PID")
            .is_none_or(|process| process == std::process::id().to_string());
        Supervisor::at(variable("NOTIFY_SOCKET").as_deref(), limit.filter(|_| is_ours))
    }

    /// Returns the supervisor at a socket, with its watchdog's limit in µs.
    pub fn at(path: Option<&str>, limit_us: Option<u64>) -> Self {
        let socket = path.filter(|path| !path.is_empty()).and_then(|path| {
            let address = match path.strip_prefix('@') {
                Some(name) => SocketAddr::from_abstract_name(name),
                None => SocketAddr::from_pathname(path),
            };
            let opened = address.and_then(|address| Ok((UnixDatagram::unbound()?, address)));
            opened
                .and_then(|(socket, address)| {
                    // A supervisor that does not read must not stop the daemon.
                    socket.set_nonblocking(true)?;
                    Ok((socket, address))
                })
                .inspect_err(|error| warn!("NOTIFY_SOCKET = {path:?}: {error}"))
                .ok()
        });
        Supervisor { socket, feeding: limit_us.map(|limit| Duration::from_micros(limit / 2)) }
    }

    /// Reports a state to the supervisor, as `READY=1`.
    pub fn notify(&self, state: &str) {
        if let Some((socket, address)) = &self.socket
            && let Err(error) = socket.send_to_addr(state.as_bytes(), address)
        {
            warn!("the supervisor was not informed of {state:?}: {error}");
        }
    }
}

/// When each pipeline was last seen to live.
#[derive(Debug)]
struct SeenAlive {
    beats: u64,
    at: Instant,
    is_missed: bool,
}

/// Feeds the supervisor's watchdog while the pipelines live.
#[derive(Debug)]
pub struct Watchdog<'a> {
    supervisor: &'a Supervisor,
    pipelines: Vec<(String, Arc<Tally>)>,
    state: RefCell<(Vec<SeenAlive>, Option<Instant>)>,
}

impl<'a> Watchdog<'a> {
    /// Returns a watchdog over pipelines by name.
    pub fn new(supervisor: &'a Supervisor, pipelines: Vec<(String, Arc<Tally>)>) -> Self {
        let now = Instant::now();
        let seen = pipelines.iter().map(|_| SeenAlive { beats: 0, at: now, is_missed: false });
        let state = RefCell::new((seen.collect(), None));
        Watchdog { supervisor, pipelines, state }
    }

    /// Feeds the watchdog if it is time and every pipeline lives; to be called often.
    pub fn round(&self, now: Instant) {
        let Some(feeding) = self.supervisor.feeding else { return };
        let (seen, fed) = &mut *self.state.borrow_mut();
        let mut all_alive = true;
        for ((name, tally), seen) in self.pipelines.iter().zip(seen) {
            let beats = tally.beats();
            if beats != seen.beats {
                *seen = SeenAlive { beats, at: now, is_missed: false };
            } else if now.duration_since(seen.at) > SILENCE_MAX {
                if !seen.is_missed {
                    error!(pipeline = name, "no sign of life; the watchdog is no longer fed");
                }
                seen.is_missed = true;
                all_alive = false;
            }
        }
        if all_alive && fed.is_none_or(|fed| now.duration_since(fed) >= feeding) {
            *fed = Some(now);
            self.supervisor.notify("WATCHDOG=1");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Listening {
        _folder: tempfile::TempDir,
        socket: UnixDatagram,
        path: String,
    }

    fn listening() -> Listening {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("notify").to_str().unwrap().to_owned();
        let socket = UnixDatagram::bind(&path).unwrap();
        socket.set_nonblocking(true).unwrap();
        Listening { _folder: folder, socket, path }
    }

    fn heard(socket: &UnixDatagram) -> Vec<String> {
        let mut buffer = [0; 64];
        std::iter::from_fn(|| {
            let length = socket.recv(&mut buffer).ok()?;
            Some(String::from_utf8_lossy(&buffer[..length]).into_owned())
        })
        .collect()
    }

    #[test]
    fn the_watchdog_is_fed_at_half_its_limit_while_every_pipeline_lives() {
        let Listening { socket, path, _folder } = listening();
        let supervisor = Supervisor::at(Some(&path), Some(2_000_000));
        let tallies: Vec<_> = (0..2).map(|_| Arc::new(Tally::default())).collect();
        let named = tallies.iter().map(|tally| ("p".to_owned(), Arc::clone(tally))).collect();
        let watchdog = Watchdog::new(&supervisor, named);
        let start = Instant::now();
        let at = |seconds: f64| start + Duration::from_secs_f64(seconds);
        for round in 0..50 {
            tallies.iter().for_each(|tally| tally.note_beat());
            watchdog.round(at(0.1 * f64::from(round)));
        }
        assert_eq!(heard(&socket), vec!["WATCHDOG=1"; 5]);
        // One of the two falls silent: fed for as long as that may be an accident, then no more.
        for round in 50..120 {
            tallies[0].note_beat();
            watchdog.round(at(0.1 * f64::from(round)));
        }
        assert_eq!(heard(&socket).len(), 2);
        tallies[1].note_beat();
        watchdog.round(at(12.0));
        assert_eq!(heard(&socket), ["WATCHDOG=1"], "it lives again");
    }

    #[test]
    fn without_a_supervisor_or_with_a_dead_one_nothing_happens() {
        Supervisor::at(None, Some(1)).notify("READY=1");
        Supervisor::at(Some("/nowhere/notify"), None).notify("READY=1");
        let supervisor = Supervisor::at(Some("@dynocar-no-such-socket"), None);
        supervisor.notify("READY=1");
        Watchdog::new(&supervisor, Vec::new()).round(Instant::now());
    }
}
