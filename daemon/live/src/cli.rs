//! The command line of `dynocar live`, and the server that reads the channels and serves viewers until it is asked to end.

use std::net::{IpAddr, SocketAddr};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use clap::{CommandFactory, Parser};
use dynocar::cli::{Failure, carry_out};
use dynocar::ending;
use dynocar::output::report_line;
use dynocar_recording::cli::WantedArguments;
use dynocar_recording::train_channels::{ChannelSelection, PAUSE, TrainChannels};
use foxglove::{FoxgloveError, WebSocketServerHandle};
use tokio::runtime::Builder;
use tokio::time::{sleep, timeout};

use crate::viewers::{LiveError, Viewers, report_viewers};

/// Messages that wait for one viewer; then the oldest are dropped.
const QUEUE: usize = 1024;
/// Time between two comparisons of the clocks.
const COMPARE: Duration = Duration::from_millis(400);
/// Time that viewers have to close their connections.
const LEAVE: Duration = Duration::from_secs(1);

/// Serve samples, snapshots and events live to Foxglove or Lichtblick.
///
/// By the Foxglove WebSocket protocol, with the topics and messages of a recording. Trains and daemons
/// may come and go. It is one more reader of the trains' channels, which nobody waits for.
#[derive(Debug, Parser)]
#[command(name = "dynocar live", bin_name = "dynocar live", version)]
struct Arguments {
    #[command(flatten)]
    wanted: WantedArguments,
    /// Samples a second that viewers get of each train; 0 for every one
    #[arg(long, value_name = "HZ", default_value_t = 50,
          value_parser = clap::value_parser!(u32).range(0..=100_000))]
    samples_hz: u32,
    /// The address to serve on. Nothing is encrypted and nobody is asked who they are: name another
    /// than the default only where all who reach it may see everything
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1")]
    host: IpAddr,
    /// The port; 0 for any that is free
    #[arg(long, value_name = "PORT", default_value_t = 8765)]
    port: u16,
}

/// Returns the command line of `dynocar live`.
pub fn command() -> clap::Command {
    Arguments::command()
}

/// Parses the command line, serves until asked to end, reports a failure on standard error.
pub fn main() -> ExitCode {
    carry_out("dynocar live", execute)
}

fn execute(arguments: &Arguments) -> Result<(), Failure> {
    let wanted = arguments.wanted.wanted()?;
    let stop = ending::flag().map_err(Failure::work)?;
    live(arguments, wanted, &stop).map_err(Failure::work)
}

/// Serves until the flag is set.
fn live(
    arguments: &Arguments,
    wanted: ChannelSelection,
    stop: &AtomicBool,
) -> Result<(), LiveError> {
    report_viewers();
    // One thread reads and serves by turns: the protocol's library refuses a viewer that subscribes to
    // a channel while it is still being advertised on another thread.
    let runtime = Builder::new_current_thread().enable_all().build().map_err(LiveError::System)?;
    let served = runtime.block_on(serve(arguments, wanted, stop));
    // Nobody waits for tasks that viewers left unfinished.
    runtime.shutdown_background();
    served
}

async fn serve(
    arguments: &Arguments,
    wanted: ChannelSelection,
    stop: &AtomicBool,
) -> Result<(), LiveError> {
    let mut viewers = Viewers::new(arguments.samples_hz)?;
    let mut channels = TrainChannels::open(wanted, "dynocar-live", &mut viewers)?;
    let server = start(SocketAddr::new(arguments.host, arguments.port), &viewers).await?;
    let address = SocketAddr::new(arguments.host, server.port());
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
