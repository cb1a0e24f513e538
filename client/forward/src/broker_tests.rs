//! Brokers that refuse, hang, talk nonsense or go away, each as bytes on a socket of this process.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::broker::{Broker, BrokerError, BrokerEvent, Login};
use crate::forwarder::{Settings, forward, send};
use crate::node::{Known, Message, NodeName, locked};
use crate::queue::Publication;
use crate::train::Train;
use dynocar::observing::Wanted;
use dynocar_client::Host;
use dynocar_shared::TrainId;

const TRAIN: TrainId = TrainId(7);
/// A broker's answers in MQTT 5.
const ACCEPTED: &[u8] = &[0x20, 3, 0, 0, 0];
const NOT_AUTHORIZED: &[u8] = &[0x20, 3, 0, 0x87, 0];
const PONG: &[u8] = &[0xd0, 0];
/// How a ping from a client begins.
const PING: u8 = 0xc0;
/// More than any machine needs.
const WATCHDOG: Duration = Duration::from_secs(120);

fn listener() -> (TcpListener, Login) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    (listener, Login { address, client: "dynocar".into(), credentials: None })
}

/// The next client, after its first packet.
fn client(listener: &TcpListener) -> (TcpStream, Vec<u8>) {
    let (mut stream, _) = listener.accept().unwrap();
    stream.set_read_timeout(Some(WATCHDOG)).unwrap();
    let mut packet = vec![0; 4096];
    let count = stream.read(&mut packet).unwrap();
    packet.truncate(count);
    assert_eq!(packet[0], 0x10, "a connection begins with CONNECT");
    (stream, packet)
}

/// What a client says until these bytes are among it.
fn hear(stream: &mut TcpStream, wanted: &[u8]) -> Vec<u8> {
    let (mut heard, mut bytes) = (Vec::new(), [0; 4096]);
    while !contains(&heard, wanted) {
        let count = stream.read(&mut bytes).unwrap();
        assert!(count > 0, "closed before {wanted:?}; heard {heard:?}");
        heard.extend(&bytes[..count]);
    }
    heard
}

/// Takes packets one by one up to a ping: others may hold its bytes.
fn await_ping(stream: &mut TcpStream) {
    let mut byte = || {
        let mut byte = [0];
        stream.read_exact(&mut byte).unwrap();
        byte[0]
    };
    loop {
        let kind = byte();
        let (mut length, mut place) = (0_usize, 0);
        loop {
            let part = byte();
            length += usize::from(part & 0x7f) << place;
            place += 7;
            if part & 0x80 == 0 {
                break;
            }
        }
        (0..length).for_each(|_| _ = byte());
        if kind == PING {
            return;
        }
    }
}

fn contains(heard: &[u8], wanted: &[u8]) -> bool {
    heard.windows(wanted.len()).any(|bytes| bytes == wanted)
}

fn connect(login: &Login) -> Result<Broker, BrokerError> {
    let death = Message { topic: "death".into(), payload: b"gone".to_vec() };
    Broker::connect(login, death, "commands", &|| false)
}

/// What becomes of a connection to a broker that answers with these bytes and closes.
fn answered(bytes: &'static [u8]) -> BrokerError {
    let (listener, login) = listener();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let (mut stream, packet) = client(&listener);
            assert!(contains(&packet, b"death"), "the death is left with the broker");
            stream.write_all(bytes).unwrap();
        });
        connect(&login).map(|_| ()).unwrap_err()
    })
}

#[test]
fn a_broker_that_refuses_closes_in_mid_packet_or_talks_nonsense_is_distinguished_from_one_that_is_not_there()
 {
    let refused = answered(NOT_AUTHORIZED);
    assert!(matches!(refused, BrokerError::Refused(_)), "{refused}");
    assert!(refused.to_string().contains("refuses the connection: "), "{refused}");
    let closed = answered(&ACCEPTED[..3]);
    assert!(matches!(closed, BrokerError::Closed(_)), "{closed}");
    // A web server; read as MQTT its second letter is a length, which has to come whole.
    let nonsense = answered(
        b"HTTP/1.1 400 Bad Request\r\nContent-Type: text/html\r\nConnection: close\r\n\r\n\
          <html><title>400 Bad Request</title></html>\r\n",
    );
    assert!(matches!(nonsense, BrokerError::Protocol(_)), "{nonsense}");
    let (listener, login) = listener();
    drop(listener);
    let absent = connect(&login).map(|_| ()).unwrap_err();
    assert!(matches!(absent, BrokerError::Network(_)), "{absent}");
}

#[test]
fn a_broker_that_takes_the_connection_and_says_nothing_is_given_up() {
    let (listener, login) = listener();
    // The system takes the connection; nobody ever answers it.
    let silent = connect(&login).map(|_| ()).unwrap_err();
    assert!(matches!(silent, BrokerError::Silent), "{silent}");
    let death = Message { topic: "death".into(), payload: Vec::new() };
    let ended = Broker::connect(&login, death, "commands", &|| true);
    assert!(matches!(ended.map(|_| ()), Err(BrokerError::Silent)), "an end is not waited for");
    drop(listener);
}

#[test]
fn a_command_that_comes_byte_by_byte_is_one_command() {
    let (listener, login) = listener();
    let publish = [&[0x30, 16, 0, 8][..], b"commands", &[0], b"again"].concat();
    let events = std::thread::scope(|scope| {
        scope.spawn(|| {
            let (mut stream, _) = client(&listener);
            stream.write_all(ACCEPTED).unwrap();
            hear(&mut stream, b"commands");
            for byte in publish.iter().chain(PONG) {
                stream.set_nodelay(true).unwrap();
                stream.write_all(&[*byte]).unwrap();
            }
            // Closed by the client.
            while stream.read(&mut [0; 64]).is_ok_and(|count| count > 0) {}
        });
        let mut broker = connect(&login).unwrap();
        let (begun, mut events) = (Instant::now(), Vec::new());
        while events.len() < 2 && begun.elapsed() < WATCHDOG {
            events.extend(broker.receive(Duration::from_millis(50)).unwrap());
        }
        events
    });
    assert_eq!(events, [BrokerEvent::Command(b"again".to_vec()), BrokerEvent::Pong]);
}

/// Ends what works until its flag is set, however its test ends.
struct Ended<'a>(&'a AtomicBool);

impl Drop for Ended<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

fn settings(login: Login, queue: usize, folder: &tempfile::TempDir) -> Settings {
    Settings {
        wanted: Wanted { host: Host::at(folder.path()).unwrap(), trains: Vec::new() },
        login,
        name: NodeName { group: "depot".into(), node: "host".into() },
        every: Duration::from_millis(100),
        queue,
    }
}

#[test]
fn after_a_refusal_and_a_loss_in_mid_packet_the_forwarder_connects_again_and_says_farewell() {
    let (listener, login) = listener();
    let folder = tempfile::tempdir().unwrap();
    let settings = settings(login, 8, &folder);
    let must_end = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let forwarding = scope.spawn(|| forward(&settings, &must_end));
        let ended = Ended(&must_end);
        client(&listener).0.write_all(NOT_AUTHORIZED).unwrap();
        client(&listener).0.write_all(&ACCEPTED[..2]).unwrap();
        let (mut stream, packet) = client(&listener);
        assert!(contains(&packet, b"spBv1.0/depot/NDEATH/host"), "{packet:?}");
        stream.write_all(ACCEPTED).unwrap();
        hear(&mut stream, b"spBv1.0/depot/NBIRTH/host");
        drop(ended);
        hear(&mut stream, b"spBv1.0/depot/NDEATH/host");
        assert_eq!(forwarding.join().unwrap().made, 0);
    });
}

/// A publication as the watcher makes them.
fn publish(known: &Mutex<Known>) {
    let publication = Publication {
        train: TRAIN,
        metric_count: 0,
        payload: Box::default(),
        is_historical: false,
    };
    locked(known).publish(Some(publication));
}

#[test]
fn while_a_broker_hangs_the_queue_stays_bounded_and_every_publication_is_accounted_for() {
    const QUEUE: u64 = 6;
    let (listener, login) = listener();
    let folder = tempfile::tempdir().unwrap();
    let settings = settings(login, QUEUE as usize, &folder);
    let mut known = Known::new(QUEUE as usize);
    // Of a train that is known, what is published is sent, and a ping follows it at once.
    known.trains.insert(TRAIN, Train::new(TRAIN, 1));
    let (known, must_end) = (Mutex::new(known), AtomicBool::new(false));
    let counts = || {
        let counts = locked(&known).queue.counts();
        assert_eq!(counts.made, counts.taken + counts.dropped + counts.waiting, "{counts:?}");
        assert!(counts.waiting <= QUEUE, "{counts:?}");
        counts
    };
    std::thread::scope(|scope| {
        scope.spawn(|| send(&settings, &known, &|| must_end.load(Ordering::Relaxed)));
        let _ended = Ended(&must_end);
        let (mut hanging, _) = client(&listener);
        hanging.write_all(ACCEPTED).unwrap();
        publish(&known);
        await_ping(&mut hanging);
        // No answer to the ping: what was sent is not taken, and the oldest of the rest go.
        (0..20).for_each(|_| publish(&known));
        let hung = counts();
        assert_eq!((hung.made, hung.taken, hung.waiting), (21, 0, QUEUE), "{hung:?}");
        // The forwarder gives up, and what it sent is sent again.
        let (mut stream, _) = client(&listener);
        stream.write_all(ACCEPTED).unwrap();
        while counts().waiting > 0 {
            await_ping(&mut stream);
            let (begun, taken) = (Instant::now(), counts().taken);
            stream.write_all(PONG).unwrap();
            while counts().taken == taken && counts().waiting > 0 {
                assert!(begun.elapsed() < WATCHDOG, "{:?}", counts());
                std::thread::sleep(Duration::from_millis(5));
            }
        }
    });
    let end = counts();
    assert_eq!((end.taken, end.dropped), (QUEUE, 21 - QUEUE), "{end:?}");
}
