//! A loopback listener that answers `GET` and `HEAD` of `/metrics` and nothing else.
//!
//! The number of connections is bounded, and so are the request and the time of each; the listener waits for none of
//! them. A client can fill and delay only its own connection.

use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use tracing::warn;

use super::metrics;
use crate::observing::ObservedTrain;
use crate::shadow::Board;

/// The longest request in bytes.
const REQUEST_BYTES_MAX: usize = 4096;
/// How long a request may take to arrive, and an answer to be read.
const PATIENCE: Duration = Duration::from_secs(1);
/// Time between two checks whether to stop.
const ROUND: Duration = Duration::from_millis(50);
/// Connections that stay open; a further client takes the place of the oldest.
const CONNECTIONS_MAX: usize = 32;

/// Opens the listener.
///
/// # Errors
///
/// The system's answer, for instance when the port is taken.
pub fn open(address: SocketAddr) -> std::io::Result<TcpListener> {
    let listener = TcpListener::bind(address)?;
    listener.set_nonblocking(true)?;
    Ok(listener)
}

/// Answers until the daemon stops.
pub fn serve(
    listener: &TcpListener,
    trains: &mut [ObservedTrain],
    names: &[String],
    board: &Board,
    stop: &Arc<AtomicBool>,
) {
    let mut connections: Vec<Connection> = Vec::new();
    while !stop.load(Ordering::Relaxed) {
        wait_for_any(listener, &connections);
        // Keeps the channel empty, so that an answer is up to date at once.
        trains.iter_mut().for_each(|train| {
            train.poll();
        });
        for _ in 0..CONNECTIONS_MAX {
            match listener.accept() {
                Ok((stream, _)) => connections.extend(Connection::new(stream)),
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) => {
                    warn!("metrics listener: {error}");
                    std::thread::sleep(ROUND);
                    break;
                }
            }
        }
        // A client that goes away or dawdles is its own misfortune.
        connections.retain_mut(|it| {
            it.advance(&mut || metrics::text(trains, names, &board.read()))
                .is_ok_and(|is_done| !is_done)
        });
        connections.drain(..connections.len().saturating_sub(CONNECTIONS_MAX));
    }
}

/// Waits until somebody comes, or goes on, for one round at most.
fn wait_for_any(listener: &TcpListener, connections: &[Connection]) {
    let mut polled: Vec<PollFd<'_>> = connections
        .iter()
        .map(|it| {
            let answers = it.answer.is_empty();
            PollFd::new(&it.stream, if answers { PollFlags::IN } else { PollFlags::OUT })
        })
        .collect();
    polled.push(PollFd::new(listener, PollFlags::IN));
    let round = Timespec { tv_sec: 0, tv_nsec: ROUND.subsec_nanos().into() };
    // A failed wait is a short one.
    let _ = poll(&mut polled, Some(&round));
}

/// A client, from the first byte of its request to the last of its answer.
struct Connection {
    stream: TcpStream,
    request: Vec<u8>,
    /// Answer that is not sent yet; empty until the request is whole.
    answer: Vec<u8>,
    deadline: Instant,
}

impl Connection {
    fn new(stream: TcpStream) -> Option<Self> {
        stream.set_nonblocking(true).ok()?;
        let deadline = Instant::now() + PATIENCE;
        Some(Connection { stream, request: Vec::new(), answer: Vec::new(), deadline })
    }

    /// Goes on as far as it does without waiting; true when all is sent.
    fn advance(&mut self, text: &mut impl FnMut() -> String) -> std::io::Result<bool> {
        match self.go_on(text) {
            Err(error)
                if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) =>
            {
                if Instant::now() < self.deadline {
                    Ok(false)
                } else {
                    Err(error)
                }
            }
            result => result.map(|()| true),
        }
    }

    fn go_on(&mut self, text: &mut impl FnMut() -> String) -> std::io::Result<()> {
        while self.answer.is_empty() {
            let mut bytes = [0; REQUEST_BYTES_MAX];
            let room = REQUEST_BYTES_MAX - self.request.len();
            let read = self.stream.read(&mut bytes[..room])?;
            self.request.extend(&bytes[..read]);
            if self.request.windows(4).any(|end| end == b"\r\n\r\n") {
                self.answer = classify(&self.request).answer(&mut *text);
                self.deadline = Instant::now() + PATIENCE;
            } else if self.request.len() == REQUEST_BYTES_MAX {
                self.answer = Request::TooLong.answer(&mut *text);
            } else if read == 0 {
                return Err(ErrorKind::UnexpectedEof.into());
            }
        }
        while !self.answer.is_empty() {
            let sent = self.stream.write(&self.answer)?;
            self.answer.drain(..sent);
        }
        Ok(())
    }
}

#[derive(Debug, PartialEq, Eq)]
enum Request {
    Metrics,
    /// The metrics' head alone.
    Head,
    Other,
    TooLong,
}

impl Request {
    fn answer(&self, text: impl FnOnce() -> String) -> Vec<u8> {
        let (status, content_type, body) = match self {
            Request::Metrics | Request::Head => ("200 OK", metrics::CONTENT_TYPE, text()),
            Request::Other => ("404 Not Found", "text/plain", "only GET /metrics\n".to_owned()),
            Request::TooLong => {
                ("431 Request Header Fields Too Large", "text/plain", "too long\n".to_owned())
            }
        };
        let length = body.len();
        let head = format!(
            "HTTP/1.1 {status}\r\nContent-Type: {content_type}\r\nContent-Length: {length}\r\n\
             Connection: close\r\n\r\n"
        );
        let body = if *self == Request::Head { String::new() } else { body };
        (head + &body).into_bytes()
    }
}

fn classify(request: &[u8]) -> Request {
    let line = request.split(|&byte| byte == b'\r').next().unwrap_or_default();
    let words: Vec<&[u8]> = line.split(|&byte| byte == b' ').collect();
    let [method, target, version] = words[..] else { return Request::Other };
    let path = target.split(|&byte| byte == b'?').next().unwrap_or_default();
    match (method, path.strip_suffix(b"/").unwrap_or(path)) {
        (b"GET", b"/metrics") if version.starts_with(b"HTTP/1.") => Request::Metrics,
        (b"HEAD", b"/metrics") if version.starts_with(b"HTTP/1.") => Request::Head,
        _ => Request::Other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_get_or_a_head_of_metrics_is_a_request_for_metrics() {
        for target in ["/metrics", "/metrics/", "/metrics?name=x", "/metrics/?"] {
            let request = |method| format!("{method} {target} HTTP/1.1\r\nHost: x\r\n\r\n");
            assert_eq!(classify(request("GET").as_bytes()), Request::Metrics, "{target}");
            assert_eq!(classify(request("HEAD").as_bytes()), Request::Head, "{target}");
        }
        let others = ["POST /metrics HTTP/1.1", "GET / HTTP/1.1", "GET /metrics", "", "\0\u{1}"];
        for other in others {
            let request = format!("{other}\r\n\r\n");
            assert_eq!(classify(request.as_bytes()), Request::Other, "{other:?}");
        }
    }
}
