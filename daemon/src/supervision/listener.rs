//! A loopback listener that answers `GET /metrics` and nothing else.
//!
//! One connection at a time, a bounded request, a bounded time: whoever connects can neither grow
//! nor hold up more than this thread.

use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use dynocar_client::SnapshotReader;
use tracing::warn;

use super::metrics;
use crate::shadow::Board;

/// The longest request in bytes.
const REQUEST_BYTES_MAX: usize = 4096;
/// How long a request may take to come, and an answer to be taken.
const PATIENCE: Duration = Duration::from_secs(1);
/// How often the thread looks whether to stop, and whether somebody has come.
const ROUND: Duration = Duration::from_millis(50);

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
    readers: &mut [SnapshotReader],
    names: &[String],
    board: &Board,
    stop: &Arc<AtomicBool>,
) {
    while !stop.load(Ordering::Relaxed) {
        match listener.accept() {
            Ok((stream, _)) => {
                // A client that goes away or dawdles is its own misfortune.
                let _ = answer(stream, || metrics::text(readers, names, &board.read()));
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => {
                // Keeps the channel empty, so that an answer is up to date at once.
                readers.iter_mut().for_each(|reader| {
                    reader.poll();
                });
                std::thread::sleep(ROUND);
            }
            Err(error) => {
                warn!("metrics listener: {error}");
                std::thread::sleep(ROUND);
            }
        }
    }
}

fn answer(mut stream: TcpStream, text: impl FnOnce() -> String) -> std::io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let (status, content_type, body) = match read_request(&mut stream) {
        Request::Metrics => ("200 OK", metrics::CONTENT_TYPE, text()),
        Request::Other => ("404 Not Found", "text/plain", "only GET /metrics\n".to_owned()),
        Request::TooLong => {
            ("431 Request Header Fields Too Large", "text/plain", "too long\n".to_owned())
        }
        Request::None => return Ok(()),
    };
    let length = body.len();
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {content_type}\r\nContent-Length: {length}\r\n\
         Connection: close\r\n\r\n"
    );
    stream.write_all(head.as_bytes())?;
    stream.write_all(body.as_bytes())
}

#[derive(Debug, PartialEq, Eq)]
enum Request {
    Metrics,
    Other,
    TooLong,
    /// The client went away or took too long.
    None,
}

fn read_request(stream: &mut TcpStream) -> Request {
    let deadline = Instant::now() + PATIENCE;
    let mut bytes = [0; REQUEST_BYTES_MAX];
    let mut length = 0;
    loop {
        let left = deadline.saturating_duration_since(Instant::now());
        if left.is_zero() || stream.set_read_timeout(Some(left)).is_err() {
            return Request::None;
        }
        match stream.read(&mut bytes[length..]) {
            Ok(0) => return if length == bytes.len() { Request::TooLong } else { Request::None },
            Ok(read) => length += read,
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(_) => return Request::None,
        }
        if bytes[..length].windows(4).any(|end| end == b"\r\n\r\n") {
            return classify(&bytes[..length]);
        }
    }
}

fn classify(request: &[u8]) -> Request {
    let line = request.split(|&byte| byte == b'\r').next().unwrap_or_default();
    let words: Vec<&[u8]> = line.split(|&byte| byte == b' ').collect();
    match &words[..] {
        [b"GET", b"/metrics", version] if version.starts_with(b"HTTP/1.") => Request::Metrics,
        _ => Request::Other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_get_of_metrics_is_a_request_for_metrics() {
        assert_eq!(classify(b"GET /metrics HTTP/1.1\r\nHost: x\r\n\r\n"), Request::Metrics);
        let others = ["POST /metrics HTTP/1.1", "GET / HTTP/1.1", "GET /metrics", "", "\0\u{1}"];
        for other in others {
            let request = format!("{other}\r\n\r\n");
            assert_eq!(classify(request.as_bytes()), Request::Other, "{other:?}");
        }
    }
}
