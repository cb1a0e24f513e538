//! What the alternatives need: the same estimator behind sockets, and the bytes that a socket carries.

use std::io::ErrorKind;
use std::os::unix::net::UnixDatagram;
use std::path::Path;
use std::sync::Arc;

use dynocar::dataset::load_train;
use dynocar_client::channel::Payload;
use dynocar_client::monotonic_now_ns;
use dynocar_core::pipeline::Pipeline;
use dynocar_shared::{ParameterSnapshot, PipelineKind, TrainId, TrainSample};

use crate::output::{Failure, during};
use crate::rig::pipelines::default_pipeline;

/// The train of every latency case.
pub const TRAIN: TrainId = TrainId(1);

/// The pipeline that is compared with the floor and the alternatives.
pub const COMPARED: PipelineKind = PipelineKind::RegularisedRls;
/// The controller's socket, in the site's folder.
pub const CLIENT_SOCKET: &str = "client.socket";
/// The server's socket, in the site's folder.
pub const SERVER_SOCKET: &str = "server.socket";

/// The estimator that every alternative runs, as the daemon builds it.
///
/// # Errors
///
/// When the train's file or a setting is wrong.
pub fn pipeline(folder: &Path) -> Result<Pipeline, Failure> {
    let model = Arc::new(load_train(&folder.join("train.toml"))?);
    Ok(default_pipeline(COMPARED, TRAIN, &model, None))
}

pub(super) fn answer<'a>(
    pipeline: &'a mut Pipeline,
    sample: &TrainSample,
) -> &'a ParameterSnapshot {
    pipeline.process(sample);
    let snapshot = pipeline.snapshot_mut();
    snapshot.published_ns = monotonic_now_ns();
    snapshot
}

/// Answers datagrams until killed; `blocks` waits in the kernel instead of asking again.
///
/// # Errors
///
/// When the system refuses the socket.
pub fn serve_datagrams(folder: &Path, mut pipeline: Pipeline, blocks: bool) -> Result<(), Failure> {
    let socket = UnixDatagram::bind(folder.join(SERVER_SOCKET)).map_err(during("bind"))?;
    socket.set_nonblocking(!blocks)?;
    let client = folder.join(CLIENT_SOCKET);
    let mut bytes = [0; size_of::<TrainSample>()];
    loop {
        match socket.recv(&mut bytes) {
            Ok(count) => {
                let Some(sample) = from_bytes::<TrainSample>(&bytes[..count]) else { continue };
                // A controller that does not read loses its answer.
                let _ = socket.send_to(as_bytes(answer(&mut pipeline, &sample)), &client);
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => std::hint::spin_loop(),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(during("receiving a datagram")(error)),
        }
    }
}

/// The bytes of a payload.
pub fn as_bytes<T: Payload>(payload: &T) -> &[u8] {
    // SAFETY: a payload is a `repr(C)` struct of plain numbers without padding (checked when it
    // is compiled), so that every one of its bytes is initialised.
    unsafe { std::slice::from_raw_parts(std::ptr::from_ref(payload).cast(), size_of::<T>()) }
}

/// A payload from its bytes; `None` when they are too few or too many.
pub fn from_bytes<T: Payload>(bytes: &[u8]) -> Option<T> {
    if bytes.len() != size_of::<T>() {
        return None;
    }
    // SAFETY: the length is right, every pattern of bytes is a value of a struct of plain
    // numbers, and the read does not ask for alignment.
    Some(unsafe { std::ptr::read_unaligned(bytes.as_ptr().cast()) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynocar_shared::{SampleField, TrainId, TrainSample};

    #[test]
    fn a_sample_survives_its_bytes() {
        let sample = TrainSample::empty(TrainId(7)).with(SampleField::Speed, 21.5);
        assert_eq!(from_bytes::<TrainSample>(as_bytes(&sample)), Some(sample));
        assert_eq!(from_bytes::<TrainSample>(&as_bytes(&sample)[1..]), None);
    }
}
