//! The alternative ZeroMQ: the same estimator behind its pair sockets, and the controller's end.

use std::path::Path;

use dynocar_core::pipeline::Pipeline;
use dynocar_shared::{ParameterSnapshot, TrainSample};
use dynocar_tests::process::Site;

use super::link::{Answer, BLOCK, Wire, snapshot};
use super::sockets::{answer, as_bytes, from_bytes};
use crate::output::Failure;

fn address(folder: &Path) -> String {
    format!("ipc://{}/zeromq.socket", folder.display())
}

fn pair() -> Result<zmq::Socket, zmq::Error> {
    let socket = zmq::Context::new().socket(zmq::PAIR)?;
    socket.set_linger(0)?;
    Ok(socket)
}

/// Sends to whoever reads: what nobody takes is lost.
fn send(socket: &zmq::Socket, bytes: &[u8]) -> Result<(), Failure> {
    match socket.send(bytes, zmq::DONTWAIT) {
        Ok(()) | Err(zmq::Error::EAGAIN) => Ok(()),
        Err(error) => Err(error.into()),
    }
}

/// Answers until killed; `blocks` waits in the kernel instead of asking again, `pin` is called once
/// the library's threads are there.
///
/// # Errors
///
/// When the library fails.
pub fn serve(
    folder: &Path,
    mut pipeline: Pipeline,
    blocks: bool,
    pin: impl FnOnce(),
) -> Result<(), Failure> {
    let socket = pair()?;
    socket.bind(&address(folder))?;
    pin();
    let flags = if blocks { 0 } else { zmq::DONTWAIT };
    let mut bytes = [0; size_of::<TrainSample>()];
    loop {
        match socket.recv_into(&mut bytes, flags) {
            Ok(count) => {
                let bytes = &bytes[..count.min(size_of::<TrainSample>())];
                let Some(sample) = from_bytes::<TrainSample>(bytes) else { continue };
                send(&socket, as_bytes(answer(&mut pipeline, &sample)))?;
            }
            Err(zmq::Error::EAGAIN) => std::hint::spin_loop(),
            Err(zmq::Error::EINTR) => {}
            Err(error) => return Err(error.into()),
        }
    }
}

/// The controller's end of a pair socket.
pub struct ZeroMq {
    socket: zmq::Socket,
    flags: i32,
}

impl ZeroMq {
    /// Connects; `blocks` waits in the kernel for answers.
    ///
    /// # Errors
    ///
    /// When the library fails.
    pub fn open(site: &Site, blocks: bool) -> Result<Self, Failure> {
        let socket = pair()?;
        socket.set_rcvtimeo(BLOCK.as_millis() as i32)?;
        socket.connect(&address(site.path()))?;
        Ok(ZeroMq { socket, flags: if blocks { 0 } else { zmq::DONTWAIT } })
    }
}

impl Wire for ZeroMq {
    fn send(&mut self, sample: &mut TrainSample) -> Result<(), Failure> {
        send(&self.socket, as_bytes(sample))
    }

    fn receive(&mut self) -> Result<Option<Answer>, Failure> {
        let mut bytes = [0; size_of::<ParameterSnapshot>()];
        match self.socket.recv_into(&mut bytes, self.flags) {
            Ok(count) => Ok(snapshot(&bytes[..count.min(size_of::<ParameterSnapshot>())])),
            Err(zmq::Error::EAGAIN | zmq::Error::EINTR) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }
}
