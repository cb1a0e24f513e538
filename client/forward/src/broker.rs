//! One connection to the broker: MQTT 5 over a socket that is never waited for without a limit.

use std::io::{ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

use mqtt_protocol_core::mqtt::common::Cursor;
use mqtt_protocol_core::mqtt::connection::{ConnectionOptions, Event};
use mqtt_protocol_core::mqtt::packet::v5_0::{Connect, Disconnect, Pingreq, Publish, Subscribe};
use mqtt_protocol_core::mqtt::packet::{GenericPacketTrait, Packet, Qos, SubEntry, SubOpts};
use mqtt_protocol_core::mqtt::result_code::{ConnectReasonCode, MqttError};
use mqtt_protocol_core::mqtt::{Connection, Version, role};

use crate::node::Message;

/// How long a broker may take to answer.
pub const PATIENCE: Duration = Duration::from_secs(10);
/// How long a network may take to reach it.
const REACHED_WITHIN: Duration = Duration::from_secs(4);
/// After a time and a half without a word the broker holds the node for dead, in s.
const KEEP_ALIVE_S: u16 = 30;
/// The longest packet that is taken in: commands are short.
const PACKET_BYTES_MAX: u32 = 64 * 1024;

/// Who and where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Login {
    /// Host and port.
    pub address: String,
    /// The name of the client, one for each node.
    pub client: String,
    /// User and password.
    pub credentials: Option<(String, String)>,
}

/// Why there is no connection any more.
#[derive(Debug, thiserror::Error)]
pub enum BrokerError {
    /// The network.
    #[error("the broker cannot be reached: {0}")]
    Network(#[from] std::io::Error),
    /// The broker refuses.
    #[error("the broker refuses the connection: {0}")]
    Refused(String),
    /// The broker closes the connection.
    #[error("the broker has closed the connection{0}")]
    Closed(String),
    /// The broker does not answer.
    #[error("the broker has not answered for {} s", PATIENCE.as_secs())]
    Silent,
    /// What came is no MQTT 5, or what was to be sent cannot be.
    #[error("the broker and this program disagree on MQTT 5: {0:?}")]
    Protocol(MqttError),
}

impl From<MqttError> for BrokerError {
    fn from(error: MqttError) -> Self {
        BrokerError::Protocol(error)
    }
}

/// What the broker says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BrokerEvent {
    /// It has taken all that was sent before the ping.
    Pong,
    /// A command for the node.
    Command(Vec<u8>),
}

/// A connection.
pub struct Broker {
    stream: TcpStream,
    mqtt: Connection<role::Client>,
    out: Vec<u8>,
    received: Vec<BrokerEvent>,
    is_accepted: bool,
}

impl Broker {
    /// Connects with a death to be published, and subscribes to the node's commands. Gives up when it must end.
    ///
    /// # Errors
    ///
    /// When the broker is not there, does not answer or refuses.
    pub fn connect(
        login: &Login,
        death: Message,
        commands: &str,
        must_end: &dyn Fn() -> bool,
    ) -> Result<Self, BrokerError> {
        let stream = reach(&login.address)?;
        stream.set_nodelay(true)?;
        stream.set_write_timeout(Some(PATIENCE))?;
        let options = ConnectionOptions::new().maximum_packet_size_recv(PACKET_BYTES_MAX);
        let mut mqtt = Connection::with_options(Version::V5_0, options);
        mqtt.set_auto_pub_response(true);
        let mut broker =
            Broker { stream, mqtt, out: Vec::new(), received: Vec::new(), is_accepted: false };
        let mut connect = Connect::builder()
            .client_id(login.client.as_str())?
            .clean_start(true)
            .keep_alive(KEEP_ALIVE_S)
            .will_message(death.topic, death.payload, Qos::AtLeastOnce, false)?;
        if let Some((user, password)) = &login.credentials {
            connect = connect.user_name(user.as_str())?.password(password.as_str())?;
        }
        broker.send(connect.build()?)?;
        broker.flush()?;
        let begun = Instant::now();
        while !broker.is_accepted {
            if begun.elapsed() >= PATIENCE || must_end() {
                return Err(BrokerError::Silent);
            }
            broker.receive(Duration::from_millis(100))?;
        }
        let number = broker.mqtt.acquire_packet_id()?;
        let entry = SubEntry::new(commands, SubOpts::new().set_qos(Qos::AtLeastOnce))?;
        broker.send(Subscribe::builder().packet_id(number).entries(vec![entry]).build()?)?;
        broker.flush()?;
        Ok(broker)
    }

    fn send<P: Into<Packet>>(&mut self, packet: P) -> Result<(), BrokerError> {
        let events = self.mqtt.send(packet.into());
        self.act(events)
    }

    /// Puts a message among what is sent with the next [`Broker::flush`].
    ///
    /// # Errors
    ///
    /// When the broker takes no message of this size.
    pub fn publish(&mut self, message: Message) -> Result<(), BrokerError> {
        let publish = Publish::builder().topic_name(message.topic)?.payload(message.payload);
        self.send(publish.qos(Qos::AtMostOnce).build()?)
    }

    /// Asks for a sign of life that follows all that was published before.
    ///
    /// # Errors
    ///
    /// When the connection is lost.
    pub fn ping(&mut self) -> Result<(), BrokerError> {
        self.send(Pingreq::new())
    }

    /// Sends what there is.
    ///
    /// # Errors
    ///
    /// When the broker does not take it for too long.
    pub fn flush(&mut self) -> Result<(), BrokerError> {
        let sent = self.stream.write_all(&self.out);
        self.out.clear();
        sent.map_err(|error| match error.kind() {
            ErrorKind::WouldBlock | ErrorKind::TimedOut => BrokerError::Silent,
            _ => error.into(),
        })
    }

    /// Waits for at most so long for what the broker says.
    ///
    /// # Errors
    ///
    /// When the connection is lost.
    pub fn receive(&mut self, patience: Duration) -> Result<Vec<BrokerEvent>, BrokerError> {
        self.stream.set_read_timeout(Some(patience))?;
        let mut bytes = [0; 4096];
        let count = match self.stream.read(&mut bytes) {
            Ok(0) => return Err(BrokerError::Closed(String::new())),
            Ok(count) => count,
            Err(error) => match error.kind() {
                ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted => 0,
                _ => return Err(error.into()),
            },
        };
        let mut cursor = Cursor::new(&bytes[..count]);
        while (cursor.position() as usize) < count {
            let events = self.mqtt.recv(&mut cursor);
            self.act(events)?;
        }
        if !self.out.is_empty() {
            self.flush()?;
        }
        Ok(std::mem::take(&mut self.received))
    }

    fn act(&mut self, events: Vec<Event>) -> Result<(), BrokerError> {
        // Why a connection is to be closed comes after that it is.
        let mut is_closed = false;
        for event in events {
            match event {
                Event::RequestSendPacket { packet, .. } => {
                    self.out.extend(packet.to_continuous_buffer());
                }
                Event::NotifyPacketReceived(packet) => self.take(packet)?,
                Event::NotifyError(error) => return Err(error.into()),
                Event::RequestClose => is_closed = true,
                // Pings are sent more often than any timer asks for.
                Event::NotifyPacketIdReleased(_)
                | Event::RequestTimerReset { .. }
                | Event::RequestTimerCancel(_) => {}
            }
        }
        if is_closed { Err(BrokerError::Closed(String::new())) } else { Ok(()) }
    }

    fn take(&mut self, packet: Packet) -> Result<(), BrokerError> {
        match packet {
            Packet::V5_0Connack(it) if it.reason_code() == ConnectReasonCode::Success => {
                self.is_accepted = true;
            }
            Packet::V5_0Connack(it) => {
                return Err(BrokerError::Refused(it.reason_code().to_string()));
            }
            Packet::V5_0Publish(it) => {
                self.received.push(BrokerEvent::Command(it.payload().as_slice().to_vec()));
            }
            Packet::V5_0Pingresp(_) => self.received.push(BrokerEvent::Pong),
            Packet::V5_0Disconnect(it) => {
                let why = it.reason_code().map_or(String::new(), |it| format!(": {it}"));
                return Err(BrokerError::Closed(why));
            }
            _ => {}
        }
        Ok(())
    }

    /// Ends the connection; the death that was left with the broker is not published.
    ///
    /// # Errors
    ///
    /// When the connection is lost before.
    pub fn disconnect(mut self) -> Result<(), BrokerError> {
        match self.send(Disconnect::builder().build()?) {
            // The protocol closes after it what is open until it is sent.
            Ok(()) | Err(BrokerError::Closed(_)) => self.flush(),
            Err(error) => Err(error),
        }
    }
}

fn reach(address: &str) -> Result<TcpStream, BrokerError> {
    let mut last = std::io::Error::new(ErrorKind::NotFound, "the name has no address");
    for place in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&place, REACHED_WITHIN) {
            Ok(stream) => return Ok(stream),
            Err(error) => last = error,
        }
    }
    Err(last.into())
}
