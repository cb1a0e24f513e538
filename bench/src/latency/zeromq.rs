//! The alternative ZeroMQ: the same estimator behind its pair sockets, and the controller's end.

use std::path::Path;

use dynocar_core::pipeline::Pipeline;
use dynocar_shared::{ParameterSnapshot, TrainSample};

use super::bytes::{as_bytes, from_bytes};
use super::link::{BLOCK, Link};
use super::sockets::answer;
use crate::rig::RigError;
use crate::rig::site::Site;

fn address(folder: &Path) -> String {
    format!("ipc://{}/zeromq.socket", folder.display())
}

/// Answers ZeroMQ messages until killed; `pin` is called once the library's own threads run, so
/// that they are not bound to the same core.
///
/// # Errors
///
/// When the library refuses.
pub fn serve(
    folder: &Path,
    mut pipeline: Pipeline,
    blocks: bool,
    pin: impl FnOnce(),
) -> Result<(), RigError> {
    let socket = zmq::Context::new().socket(zmq::PAIR)?;
    socket.set_linger(0)?;
    socket.bind(&address(folder))?;
    pin();
    let flags = if blocks { 0 } else { zmq::DONTWAIT };
    let mut bytes = [0; size_of::<TrainSample>()];
    loop {
        match socket.recv_into(&mut bytes, flags) {
            Ok(count) => {
                let bytes = &bytes[..count.min(size_of::<TrainSample>())];
                let Some(sample) = from_bytes::<TrainSample>(bytes) else { continue };
                match socket.send(as_bytes(answer(&mut pipeline, &sample)), zmq::DONTWAIT) {
                    // A controller that does not read loses its answer.
                    Ok(()) | Err(zmq::Error::EAGAIN) => {}
                    Err(error) => return Err(error.into()),
                }
            }
            Err(zmq::Error::EAGAIN) => std::hint::spin_loop(),
            Err(zmq::Error::EINTR) => {}
            Err(error) => return Err(error.into()),
        }
    }
}

/// ZeroMQ's pair sockets over its `ipc` transport.
pub struct ZeroMqLink {
    socket: zmq::Socket,
    flags: i32,
    sequence: u64,
    newest: u64,
}

impl ZeroMqLink {
    /// Connects to the server's socket; see [`DatagramLink::open`] for `blocks`.
    ///
    /// # Errors
    ///
    /// When the library refuses.
    pub fn open(site: &Site, blocks: bool) -> Result<Self, RigError> {
        let socket = zmq::Context::new().socket(zmq::PAIR)?;
        socket.set_linger(0)?;
        socket.set_rcvtimeo(BLOCK.as_millis() as i32)?;
        socket.connect(&address(site.path()))?;
        let flags = if blocks { 0 } else { zmq::DONTWAIT };
        Ok(ZeroMqLink { socket, flags, sequence: 0, newest: 0 })
    }
}

impl Link for ZeroMqLink {
    fn publish(&mut self, sample: &mut TrainSample) -> Result<u64, RigError> {
        self.sequence += 1;
        sample.sequence = self.sequence;
        match self.socket.send(as_bytes(sample), zmq::DONTWAIT) {
            Ok(()) | Err(zmq::Error::EAGAIN) => Ok(self.sequence),
            Err(error) => Err(error.into()),
        }
    }

    fn poll(&mut self) -> Result<u64, RigError> {
        let mut bytes = [0; size_of::<ParameterSnapshot>()];
        match self.socket.recv_into(&mut bytes, self.flags) {
            Ok(count) => {
                let bytes = &bytes[..count.min(size_of::<ParameterSnapshot>())];
                if let Some(snapshot) = from_bytes::<ParameterSnapshot>(bytes) {
                    self.newest = self.newest.max(snapshot.sample_sequence);
                }
            }
            Err(zmq::Error::EAGAIN | zmq::Error::EINTR) => {}
            Err(error) => return Err(error.into()),
        }
        Ok(self.newest)
    }
}
