//! Connections to the broker one after the other, until asked to end.

use std::sync::Mutex;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use dynocar::observing::Wanted;
use dynocar::output::report_line;

use crate::broker::{Broker, BrokerError, BrokerEvent, Login, PATIENCE};
use crate::node::{Known, Message, NodeName, Session, is_rebirth, locked};
use crate::payload::utc_ms;
use crate::queue::Counts;
use crate::watcher::watch;

/// How long the broker's words are waited for, before the queue is looked at again.
const PAUSE: Duration = Duration::from_millis(20);
/// The most publications between two pings.
const BATCH: usize = 256;
/// An idle connection is pinged so often: well within the time after which a broker holds a node for dead.
const IDLE_PING: Duration = Duration::from_secs(8);
/// How long to wait after a connection that failed; twice as long after each further one, up to the last.
const RETRY: [Duration; 2] = [Duration::from_millis(500), Duration::from_secs(15)];
/// How long the end waits for the broker to take what is left.
const FAREWELL: Duration = Duration::from_secs(3);
/// How often drops are reported at most.
const REPORT_DROPS: Duration = Duration::from_secs(10);

/// What is forwarded, and where to.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The trains.
    pub wanted: Wanted,
    /// The broker.
    pub login: Login,
    /// The edge node.
    pub name: NodeName,
    /// How often a train's changes are published; events are at once.
    pub every: Duration,
    /// The most publications that wait.
    pub queue: usize,
}

/// Forwards until the flag is set; gives what has become of the publications.
pub fn forward(settings: &Settings, must_end: &AtomicBool) -> Counts {
    let known = Mutex::new(Known::new(settings.queue));
    std::thread::scope(|scope| {
        let watching = scope.spawn(|| watch(&settings.wanted, settings.every, &known, must_end));
        // Sending ends after the last publication is made, however that ends.
        send(settings, &known, &|| watching.is_finished());
    });
    locked(&known).queue.counts()
}

/// Sends what is known over one connection after the other, until it must end and nothing waits.
pub fn send(settings: &Settings, known: &Mutex<Known>, must_end: &dyn Fn() -> bool) {
    let (mut attempts, mut connections) = (0, 0);
    let mut reported = String::new();
    let mut retry = RETRY[0];
    let mut drops = Drops::default();
    while !must_end() {
        let session = Session::new(&settings.name, attempts, connections + 1);
        attempts += 1;
        let commands = settings.name.topic("NCMD");
        let error =
            match Broker::connect(&settings.login, session.death(utc_ms()), &commands, must_end) {
                Err(error) => error,
                Ok(broker) => {
                    connections += 1;
                    (retry, reported) = (RETRY[0], String::new());
                    report_line(&format!(
                        "dynocar forward: connected to {} as {}/{}",
                        settings.login.address, settings.name.group, settings.name.node
                    ));
                    match Sending::begin(broker, session, known).run(
                        settings.every,
                        &mut drops,
                        must_end,
                    ) {
                        Ok(()) => return,
                        Err(error) => error,
                    }
                }
            };
        locked(known).queue.give_back();
        let words = error.to_string();
        if reported != words {
            report_line(&format!(
                "dynocar forward: {}: {words}; trying again",
                settings.login.address
            ));
            reported = words;
        }
        let begun = Instant::now();
        while begun.elapsed() < retry && !must_end() {
            drops.report(locked(known).queue.counts());
            std::thread::sleep(PAUSE);
        }
        retry = (2 * retry).min(RETRY[1]);
    }
}

/// When drops were last reported.
#[derive(Default)]
struct Drops {
    dropped: u64,
    reported: Option<Instant>,
}

impl Drops {
    /// Warns people of drops that they do not know of, now and then.
    fn report(&mut self, counts: Counts) {
        if counts.dropped > self.dropped
            && self.reported.is_none_or(|it| it.elapsed() >= REPORT_DROPS)
        {
            report_line(&format!(
                "dynocar forward: {} publications dropped so far",
                counts.dropped
            ));
            (self.dropped, self.reported) = (counts.dropped, Some(Instant::now()));
        }
    }
}

/// One connection while it lasts.
struct Sending<'a> {
    broker: Broker,
    session: Session,
    known: &'a Mutex<Known>,
    /// When the ping was sent that is not answered yet.
    pinged: Option<Instant>,
    last_ping: Instant,
}

impl<'a> Sending<'a> {
    fn begin(broker: Broker, session: Session, known: &'a Mutex<Known>) -> Self {
        locked(known).queue.begin();
        Sending { broker, session, known, pinged: None, last_ping: Instant::now() }
    }

    fn run(
        mut self,
        every: Duration,
        drops: &mut Drops,
        must_end: &dyn Fn() -> bool,
    ) -> Result<(), BrokerError> {
        self.births()?;
        let mut own_due = Instant::now() + every;
        let mut ending: Option<Instant> = None;
        loop {
            for event in self.broker.receive(PAUSE)? {
                match event {
                    BrokerEvent::Pong => {
                        self.pinged = None;
                        locked(self.known).queue.take_note();
                    }
                    BrokerEvent::Command(command) if is_rebirth(&command) => self.births()?,
                    BrokerEvent::Command(_) => {}
                }
            }
            if self.pinged.is_some_and(|it| it.elapsed() >= PATIENCE) {
                return Err(BrokerError::Silent);
            }
            if self.pinged.is_none() {
                self.send_batch()?;
            }
            if Instant::now() >= own_due {
                own_due = Instant::now() + every;
                drops.report(locked(self.known).queue.counts());
                if self.pinged.is_none() {
                    self.own_data()?;
                }
            }
            if must_end() {
                let begun = *ending.get_or_insert_with(Instant::now);
                let waiting = locked(self.known).queue.counts().waiting;
                if waiting == 0 || begun.elapsed() >= FAREWELL {
                    return self.farewell();
                }
            }
        }
    }

    fn publish(&mut self, messages: Vec<Message>) -> Result<(), BrokerError> {
        messages.into_iter().try_for_each(|message| self.broker.publish(message))
    }

    fn births(&mut self) -> Result<(), BrokerError> {
        let births = self.session.births(&locked(self.known), utc_ms());
        self.publish(births)?;
        self.broker.flush()
    }

    /// Sends what waits, and asks whether it was taken; births and deaths when nothing waits.
    fn send_batch(&mut self) -> Result<(), BrokerError> {
        let mut count = 0;
        while count < BATCH {
            let messages = self.session.next(&mut locked(self.known), utc_ms());
            if messages.is_empty() {
                break;
            }
            self.publish(messages)?;
            count += 1;
        }
        let changes = {
            let known = locked(self.known);
            let is_all = known.queue.next().is_none();
            if is_all { self.session.births_and_deaths(&known, utc_ms()) } else { Vec::new() }
        };
        let is_idle = count == 0 && changes.is_empty();
        self.publish(changes)?;
        if !is_idle || self.last_ping.elapsed() >= IDLE_PING {
            self.broker.ping()?;
            self.last_ping = Instant::now();
            self.pinged = Some(self.last_ping);
        }
        self.broker.flush()
    }

    /// The node's own counts, where they have changed.
    fn own_data(&mut self) -> Result<(), BrokerError> {
        let message = self.session.own_data(&locked(self.known), utc_ms());
        self.publish(message.into_iter().collect())?;
        self.broker.flush()
    }

    /// The node's death by its own hand; what waits still is left.
    fn farewell(mut self) -> Result<(), BrokerError> {
        let death = self.session.death(utc_ms());
        self.publish(vec![death])?;
        self.broker.disconnect()
    }
}
