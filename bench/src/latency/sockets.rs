//! The alternatives' servers: the same estimator behind sockets.

use std::io::ErrorKind;
use std::os::unix::net::UnixDatagram;
use std::path::Path;
use std::sync::Arc;

use dynocar::dataset::load_train;
use dynocar_client::monotonic_now_ns;
use dynocar_core::pipeline::Pipeline;
use dynocar_shared::{ParameterSnapshot, PipelineKind, TrainId, TrainSample};

use super::bytes::{as_bytes, from_bytes};
use crate::output::{Failure, during};
use crate::rig::pipelines::default_pipeline;

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
pub fn pipeline(folder: &Path, train: TrainId) -> Result<Pipeline, Failure> {
    let model = Arc::new(load_train(&folder.join("train.toml"))?);
    Ok(default_pipeline(COMPARED, train, &model, None))
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
