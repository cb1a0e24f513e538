//! A viewer with the part of the protocol that it takes to see and to stall.

use std::collections::HashMap;
use std::io::ErrorKind;
use std::net::TcpStream;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest;
use tungstenite::{Error, Message, WebSocket};

use crate::support_site::WATCHDOG;

/// A message on a channel that was subscribed to.
pub struct ReceivedMessage {
    pub topic: String,
    pub log_time_ns: u64,
    pub message: Vec<u8>,
}

pub struct Viewer {
    socket: WebSocket<TcpStream>,
    /// Topics by the number of their channel.
    channels: HashMap<u64, String>,
    subscribed: Vec<String>,
}

impl Viewer {
    pub fn connect(port: u16) -> Self {
        Viewer::offer(port, "foxglove.sdk.v1").expect("a connection")
    }

    /// A viewer that offers this protocol; `None` where it is refused.
    pub fn offer(port: u16, protocol: &str) -> Option<Self> {
        let mut request = format!("ws://127.0.0.1:{port}/").into_client_request().unwrap();
        request.headers_mut().insert("sec-websocket-protocol", protocol.parse().unwrap());
        let stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
        let (socket, _) = tungstenite::client(request, stream).ok()?;
        socket.get_ref().set_read_timeout(Some(Duration::from_millis(50))).unwrap();
        Some(Viewer { socket, channels: HashMap::new(), subscribed: Vec::new() })
    }

    /// The topics that are advertised now.
    pub fn topics(&self) -> Vec<&str> {
        let mut topics: Vec<&str> = self.channels.values().map(String::as_str).collect();
        topics.sort_unstable();
        topics
    }

    /// Takes one message, if there is one; returns it when it is of a subscribed channel.
    fn take(&mut self) -> Option<ReceivedMessage> {
        match self.socket.read() {
            Ok(Message::Text(text)) => self.control(&serde_json::from_str(&text).unwrap()),
            Ok(Message::Binary(bytes)) => {
                let (&opcode, rest) = bytes.split_first().unwrap();
                assert_eq!(opcode, 1, "message data");
                let (subscription, rest) = rest.split_first_chunk::<4>().unwrap();
                let (log_time, message) = rest.split_first_chunk::<8>().unwrap();
                let index = u32::from_le_bytes(*subscription) as usize;
                return Some(ReceivedMessage {
                    topic: self.subscribed[index].clone(),
                    log_time_ns: u64::from_le_bytes(*log_time),
                    message: message.to_vec(),
                });
            }
            Ok(other) => panic!("expected text or data, found {other:?}"),
            Err(Error::Io(error))
                if [ErrorKind::WouldBlock, ErrorKind::TimedOut, ErrorKind::Interrupted]
                    .contains(&error.kind()) => {}
            Err(error) => panic!("{error}"),
        }
        None
    }

    fn control(&mut self, it: &Value) {
        match it["op"].as_str().unwrap() {
            "advertise" => {
                for channel in it["channels"].as_array().unwrap() {
                    assert_eq!(channel["encoding"], "protobuf");
                    assert_eq!(channel["schemaEncoding"], "protobuf");
                    let topic = channel["topic"].as_str().unwrap().to_owned();
                    self.channels.insert(channel["id"].as_u64().unwrap(), topic);
                }
            }
            "unadvertise" => {
                for id in it["channelIds"].as_array().unwrap() {
                    self.channels.remove(&id.as_u64().unwrap()).unwrap();
                }
            }
            "serverInfo" => assert_eq!(it["name"], "dynocar live"),
            other => panic!("{other}: {it}"),
        }
    }

    /// Reads messages until the expected one arrives.
    pub fn await_seen(
        &mut self,
        what: &str,
        mut is_it: impl FnMut(&ReceivedMessage) -> bool,
    ) -> ReceivedMessage {
        let start = Instant::now();
        loop {
            if let Some(seen) = self.take().filter(&mut is_it) {
                return seen;
            }
            assert!(start.elapsed() < WATCHDOG, "waited in vain for {what}");
        }
    }

    /// Takes messages until these topics and no others are advertised.
    pub fn await_topics(&mut self, topics: &[&str]) {
        let start = Instant::now();
        while self.topics() != topics {
            self.take();
            assert!(start.elapsed() < WATCHDOG, "{topics:?}: found {:?}", self.topics());
        }
    }

    /// Subscribes to a topic as soon as it is advertised.
    pub fn subscribe(&mut self, topic: &str) {
        let start = Instant::now();
        let id = loop {
            let found = self.channels.iter().find(|(_, name)| *name == topic);
            if let Some((&id, _)) = found {
                break id;
            }
            self.take();
            assert!(start.elapsed() < WATCHDOG, "{topic}: found {:?}", self.topics());
        };
        let subscriptions = json!([{ "id": self.subscribed.len(), "channelId": id }]);
        let message = json!({ "op": "subscribe", "subscriptions": subscriptions });
        self.subscribed.push(topic.to_owned());
        self.socket.send(Message::text(message.to_string())).unwrap();
    }
}
