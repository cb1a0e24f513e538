//! The alternative ZeroMQ: both ends of its pair sockets.

use std::path::Path;

use super::wire::{BLOCK, Socket, SocketEnd};
use crate::output::BenchError;

/// An end of a pair socket.
pub struct ZeroMq {
    socket: zmq::Socket,
    flags: i32,
}

impl ZeroMq {
    /// Opens an end in a site's folder; `blocks` waits in the kernel for messages.
    ///
    /// # Errors
    ///
    /// When the library fails.
    pub fn open(folder: &Path, end: SocketEnd, blocks: bool) -> Result<Self, BenchError> {
        let socket = zmq::Context::new().socket(zmq::PAIR)?;
        socket.set_linger(0)?;
        socket.set_rcvtimeo(BLOCK.as_millis() as i32)?;
        let address = format!("ipc://{}/zeromq.socket", folder.display());
        match end {
            SocketEnd::Controller => socket.connect(&address)?,
            SocketEnd::Server => socket.bind(&address)?,
        }
        Ok(ZeroMq { socket, flags: if blocks { 0 } else { zmq::DONTWAIT } })
    }
}

impl Socket for ZeroMq {
    fn send(&mut self, bytes: &[u8]) -> Result<(), BenchError> {
        unless_passing(self.socket.send(bytes, zmq::DONTWAIT)).map(|_| ())
    }

    fn receive(&mut self, bytes: &mut [u8]) -> Result<Option<usize>, BenchError> {
        let count = unless_passing(self.socket.recv_into(bytes, self.flags))?;
        Ok(count.filter(|count| *count <= bytes.len()))
    }
}

/// Returns the result of a call, or `None` for errors that a receiver or sender has to tolerate.
fn unless_passing<T>(result: zmq::Result<T>) -> Result<Option<T>, BenchError> {
    match result {
        Ok(given) => Ok(Some(given)),
        Err(zmq::Error::EAGAIN | zmq::Error::EINTR) => Ok(None),
        Err(error) => Err(error.into()),
    }
}
