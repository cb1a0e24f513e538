//! The command line of `dynocar forward`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use clap::{CommandFactory, Parser};
use dynocar::cli::{Failure, carry_out};
use dynocar::dataset::read_text;
use dynocar::ending;
use dynocar::observing::Wanted;
use dynocar::output::report_line;
use dynocar_client::Host;
use dynocar_shared::TrainId;

use crate::broker::Login;
use crate::forwarder::{Settings, forward};
use crate::node::NodeName;

/// The port of a broker that is given without one.
const PORT: &str = "1883";

/// Forward estimates and events to an MQTT broker, as Sparkplug B.
///
/// MQTT 5, one edge node for this host, a device for each train. Without options it forwards all trains that
/// any daemon of this host serves to a broker on this host. No controller and no daemon waits for the
/// broker: what it does not take waits in a bounded queue, and what the queue cannot hold is dropped and
/// counted. SIGINT, SIGTERM and SIGHUP end it.
#[derive(Debug, Parser)]
#[command(name = "dynocar forward", bin_name = "dynocar forward", version)]
struct Arguments {
    /// The broker. There is no TLS: leave that to a broker on this host that bridges to another
    #[arg(long, value_name = "HOST[:PORT]", default_value = "127.0.0.1:1883")]
    broker: String,
    /// Sparkplug's group
    #[arg(long, value_name = "NAME", default_value = "dynocar")]
    group: String,
    /// Sparkplug's edge node, one for each host; by default the host's name
    #[arg(long, value_name = "NAME")]
    node: Option<String>,
    /// Only this train; may be given several times
    #[arg(long = "train", value_name = "ID")]
    trains: Vec<u64>,
    /// A file with the user in the first line and the password in the second
    #[arg(long, value_name = "FILE")]
    credentials: Option<PathBuf>,
    /// How often a train's changes are published, in ms; events are at once
    #[arg(long, value_name = "MS", default_value_t = 1000, value_parser = clap::value_parser!(u64).range(50..=3_600_000))]
    every_ms: u64,
    /// The most publications that wait for the broker; the oldest go
    #[arg(long, value_name = "N", default_value_t = 10_000, value_parser = clap::value_parser!(u32).range(2..=10_000_000))]
    queue: u32,
}

/// The command line of `dynocar forward`.
pub fn command() -> clap::Command {
    Arguments::command()
}

/// Parses the command line, forwards until asked to end, reports a failure on standard error.
pub fn main() -> ExitCode {
    carry_out("dynocar forward", |_| None, execute)
}

fn execute(arguments: &Arguments) -> Result<(), Failure> {
    let node = match &arguments.node {
        Some(node) => node.clone(),
        None => host_name()?,
    };
    let name = NodeName {
        group: require_name("--group", &arguments.group)?,
        node: require_name("--node", &node)?,
    };
    let login = Login {
        address: address(&arguments.broker)?,
        client: format!("dynocar-{}-{}", name.group, name.node),
        credentials: arguments.credentials.as_deref().map(credentials).transpose()?,
    };
    let settings = Settings {
        wanted: Wanted {
            host: Host::from_environment().map_err(Failure::work)?,
            trains: arguments.trains.iter().map(|&id| TrainId(id)).collect(),
        },
        login,
        name,
        every: Duration::from_millis(arguments.every_ms),
        queue: arguments.queue as usize,
    };
    let must_end = ending::flag().map_err(Failure::work)?;
    let counts = forward(&settings, &must_end);
    report_line(&format!(
        "dynocar forward: {} publications made: {} taken by the broker, {} dropped, {} not sent",
        counts.made, counts.taken, counts.dropped, counts.waiting
    ));
    Ok(())
}

fn host_name() -> Result<String, Failure> {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    match name.trim() {
        "" => Err(Failure::Input("this host has no name: give --node NAME".into())),
        name => Ok(name.to_owned()),
    }
}

/// A part of a topic.
fn require_name(option: &str, name: &str) -> Result<String, Failure> {
    let is_sign = |it: char| ['/', '+', '#'].contains(&it) || it.is_control();
    if !name.is_empty() && !name.contains(is_sign) {
        return Ok(name.to_owned());
    }
    Err(Failure::Input(format!(
        "{option} {name:?}: expected a name without /, + and #, which stands in topics"
    )))
}

/// Host and port of `HOST`, `HOST:PORT`, `[ADDRESS]` and `[ADDRESS]:PORT`.
fn address(broker: &str) -> Result<String, Failure> {
    let (host, port) = match broker.rsplit_once(':') {
        Some((host, port)) if !port.ends_with(']') => (host, port),
        _ => (broker, PORT),
    };
    let is_host = !host.is_empty() && (!host.contains(':') || host.starts_with('['));
    if is_host && port.parse::<u16>().is_ok_and(|port| port > 0) {
        return Ok(format!("{host}:{port}"));
    }
    Err(Failure::Input(format!(
        "--broker {broker:?}: expected HOST or HOST:PORT, as 127.0.0.1:1883"
    )))
}

fn credentials(path: &Path) -> Result<(String, String), Failure> {
    let file = path.display();
    let text = read_text(path).map_err(|why| Failure::Input(format!("{file}: {why}")))?;
    let mut lines = text.lines().map(str::trim_end);
    match (lines.next(), lines.next(), lines.next()) {
        (Some(user), Some(password), None) if !user.is_empty() => {
            Ok((user.to_owned(), password.to_owned()))
        }
        _ => Err(Failure::Input(format!("{file}: expected two lines, the user and the password"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_broker_is_a_host_with_or_without_a_port() {
        for (given, meant) in [
            ("broker", "broker:1883"),
            ("10.0.0.7:8883", "10.0.0.7:8883"),
            ("[::1]", "[::1]:1883"),
            ("[::1]:1884", "[::1]:1884"),
        ] {
            assert_eq!(address(given).ok().as_deref(), Some(meant), "{given}");
        }
        for wrong in ["", ":1883", "broker:", "broker:x", "broker:0", "::1", "mqtt://broker:1883"] {
            assert!(address(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn what_stands_in_topics_has_no_signs_of_topics() {
        assert!(require_name("--node", "tram 7").is_ok());
        for wrong in ["", "a/b", "a+", "#", "a\nb"] {
            assert!(require_name("--node", wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn credentials_are_two_lines() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("credentials");
        for (text, is_fit) in
            [("me\nsecret\n", true), ("me\n", false), ("\nx\n", false), ("", false)]
        {
            std::fs::write(&file, text).unwrap();
            assert_eq!(credentials(&file).is_ok(), is_fit, "{text:?}");
        }
        assert!(credentials(&folder.path().join("nowhere")).is_err());
    }
}
