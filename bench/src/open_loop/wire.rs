//! The controller's end of each transport, and a plain listener, with which Dynocar's own waking is compared.

use std::path::Path;

use dynocar_client::{SamplePublisher, SnapshotReader};
use dynocar_shared::{ParameterSnapshot, PipelineKind, TrainId, TrainSample};
use dynocar_tests::process::DaemonSite;
use dynocar_transport::Host;
use dynocar_transport::channel::{Receiver, Sender, Transport};
use iceoryx2::port::notifier::Notifier;
use iceoryx2::prelude::{
    Config, FileName, NodeBuilder, Path as TransportPath, SemanticString, ServiceName,
    SignalHandlingMode, ipc,
};
use iceoryx2::service::port_factory::event::PortFactory;

use crate::output::BenchError;

/// A transport of samples to an estimator and of its answers back.
pub trait BenchTransport {
    /// Sends a numbered sample; a sample that a full queue refuses is lost.
    ///
    /// # Errors
    ///
    /// When the transport fails for good.
    fn send(&mut self, sample: &mut TrainSample) -> Result<(), BenchError>;

    /// Receives the answers that have come, and passes each to `hear`.
    ///
    /// # Errors
    ///
    /// When the transport fails for good.
    fn receive(&mut self, hear: &mut dyn FnMut(&ParameterSnapshot)) -> Result<(), BenchError>;

    /// Returns whether snapshots of other pipelines come too, which a controller's next poll takes first.
    fn carries_others(&self) -> bool {
        false
    }
}

/// The client library that a controller links.
pub struct Client {
    publisher: SamplePublisher,
    reader: SnapshotReader,
    polled: Option<PipelineKind>,
}

impl Client {
    /// Opens publisher and reader; the answers of one pipeline are heard, or of all.
    ///
    /// # Errors
    ///
    /// When a channel cannot be opened.
    pub fn open(
        site: &DaemonSite,
        train: TrainId,
        polled: Option<PipelineKind>,
    ) -> Result<Self, BenchError> {
        let publisher = SamplePublisher::open(&site.host(), train)?;
        Ok(Client { publisher, reader: SnapshotReader::open(&site.host(), train)?, polled })
    }
}

impl BenchTransport for Client {
    fn send(&mut self, sample: &mut TrainSample) -> Result<(), BenchError> {
        // It numbers by itself.
        Ok(self.publisher.publish(sample).map(|_| ())?)
    }

    fn receive(&mut self, hear: &mut dyn FnMut(&ParameterSnapshot)) -> Result<(), BenchError> {
        if self.reader.poll() > 0 {
            match self.polled {
                Some(kind) => self.reader.latest(kind, 0).iter().for_each(|it| hear(it.snapshot)),
                None => self.reader.readings(0).for_each(|it| hear(it.snapshot)),
            }
        }
        Ok(())
    }

    fn carries_others(&self) -> bool {
        true
    }
}

/// The plain transport with a notification for every sample: the floor of the event strategy.
pub struct Notifying {
    sender: Sender<TrainSample>,
    receiver: Receiver<ParameterSnapshot>,
    notifier: Notifier<ipc::Service>,
}

impl Notifying {
    /// Opens the ports.
    ///
    /// # Errors
    ///
    /// When the transport refuses one.
    pub fn open(site: &DaemonSite, train: TrainId) -> Result<Self, BenchError> {
        let transport = Transport::open(&site.host(), "dynocar-bench")?;
        let service = service(&site.host(), site.path())?;
        Ok(Notifying {
            sender: transport.sender(train)?,
            receiver: transport.receiver(train)?,
            notifier: service.notifier_builder().create().map_err(refused("notifier"))?,
        })
    }
}

impl BenchTransport for Notifying {
    fn send(&mut self, sample: &mut TrainSample) -> Result<(), BenchError> {
        self.sender.send(sample)?;
        self.notifier.notify().map(|_| ()).map_err(refused("notification"))
    }

    fn receive(&mut self, hear: &mut dyn FnMut(&ParameterSnapshot)) -> Result<(), BenchError> {
        self.receiver.receive().iter().for_each(hear);
        Ok(())
    }
}

/// Returns the failure for a refusal of the transport.
pub fn refused<E: std::fmt::Debug>(what: &'static str) -> impl FnOnce(E) -> BenchError {
    move |error| format!("iceoryx2 refused a {what}: {error:?}").into()
}

/// Returns the service of the plain transport that notifies and listens within a measurement's folder.
///
/// # Errors
///
/// When the transport refuses.
pub fn service(host: &Host, folder: &Path) -> Result<PortFactory<ipc::Service>, BenchError> {
    let mut config = Config::default();
    let own = host.segment_prefix();
    config.global.prefix = FileName::new(own.as_bytes()).map_err(refused("name"))?;
    let root = folder.join("plain");
    let root = TransportPath::new(root.as_os_str().as_encoded_bytes());
    config.global.set_root_path(&root.map_err(refused("folder"))?);
    let node = NodeBuilder::new()
        .config(&config)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<ipc::Service>()
        .map_err(refused("node"))?;
    let name = ServiceName::new("dynocar-bench/notify").map_err(refused("service name"))?;
    node.service_builder(&name).event().open_or_create().map_err(refused("service"))
}
