//! Reads the channels and serves viewers until it is asked to end.

use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use dynocar::output::report_line;
use dynocar_recording::train_channels::{ChannelSelection, PAUSE, TrainChannels};
use foxglove::{FoxgloveError, WebSocketServerHandle};
use tokio::runtime::Builder;
use tokio::time::{sleep, timeout};

use crate::viewers::{LiveError, Viewers, report_viewers};

/// Messages that wait for one viewer; then the oldest are dropped.
pub const QUEUE: usize = 1024;
/// Time between two comparisons of the clocks.
const COMPARE: Duration = Duration::from_millis(400);
/// Time that viewers have to close their connections.
const LEAVE: Duration = Duration::from_secs(1);

/// Settings of the server: contents and address.
#[derive(Clone, Debug)]
pub struct LiveSettings {
    /// Trains and pipelines to read.
    pub wanted: ChannelSelection,
    /// Samples a second that viewers get of each train; every one, when it is 0.
    pub samples_hz: u32,
    /// Where viewers connect to.
    pub address: SocketAddr,
}

/// Serves until the flag is set.
///
/// # Errors
///
/// When the address cannot be served or a channel cannot be opened.
pub fn live(settings: &LiveSettings, stop: &AtomicBool) -> Result<(), LiveError> {
    report_viewers();
    // One thread reads and serves by turns: the protocol's library refuses a viewer that subscribes to
    // a channel while it is still being advertised on another thread.
    let runtime = Builder::new_current_thread().enable_all().build().map_err(LiveError::System)?;
    let served = runtime.block_on(serve(settings, stop));
    // Nobody waits for tasks that viewers left unfinished.
    runtime.shutdown_background();
    served
}

async fn serve(settings: &LiveSettings, stop: &AtomicBool) -> Result<(), LiveError> {
    let mut viewers = Viewers::new(settings.samples_hz)?;
    let mut channels = TrainChannels::open(settings.wanted.clone(), "dynocar-live", &mut viewers)?;
    let server = start(settings.address, &viewers).await?;
    let address = SocketAddr::new(settings.address.ip(), server.port());
    if !address.ip().is_loopback() {
        report_line(&format!(
            "{address}: whoever reaches this address sees everything: nothing is encrypted, nobody \
             is asked who they are"
        ));
    }
    report_line(&format!(
        "serving ws://{address}; Ctrl-C ends it\n\
         in Foxglove or Lichtblick: Open connection, Foxglove WebSocket, ws://{address}"
    ));
    let mut compared = Instant::now();
    while !stop.load(Ordering::Relaxed) {
        if compared.elapsed() >= COMPARE {
            viewers.set_clock();
            compared = Instant::now();
        }
        channels.take(&mut viewers)?;
        sleep(PAUSE).await;
    }
    // A viewer that does not answer is not waited for.
    let _ = timeout(LEAVE, server.stop().wait()).await;
    Ok(())
}

async fn start(address: SocketAddr, viewers: &Viewers) -> Result<WebSocketServerHandle, LiveError> {
    let host = match address {
        SocketAddr::V4(it) => it.ip().to_string(),
        SocketAddr::V6(it) => format!("[{}]", it.ip()),
    };
    let server = viewers
        .context()
        .websocket_server()
        .name("dynocar live")
        .capabilities([])
        .message_backlog_size(QUEUE)
        .listener(viewers.listener())
        .bind(host, address.port());
    server.start().await.map_err(|error| LiveError::Address {
        address: address.to_string(),
        problem: match error {
            FoxgloveError::Bind(error) => error.to_string(),
            other => other.to_string(),
        },
    })
}
