//! A listener and a notifier of the plain transport, compared with Dynocar's own waking.

use std::path::Path;

use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::prelude::{
    Config, FileName, Node, NodeBuilder, Path as TransportPath, SemanticString, ServiceName,
    SignalHandlingMode, ipc,
};
use iceoryx2::service::port_factory::event::PortFactory;

use crate::rig::RigError;

const SERVICE: &str = "dynocar-bench/notify";

fn refused<E: std::fmt::Debug>(what: &'static str) -> impl FnOnce(E) -> RigError {
    move |error| RigError::Transport { what, reason: format!("{error:?}") }
}

/// Access to the plain transport within a measurement's folder.
#[derive(Debug)]
pub struct PlainNode {
    node: Node<ipc::Service>,
}

impl PlainNode {
    /// Enters the transport; `folder` is the site's.
    ///
    /// # Errors
    ///
    /// When the transport refuses.
    pub fn open(folder: &Path) -> Result<Self, RigError> {
        let mut config = Config::default();
        let own = folder.file_name().unwrap_or_default().as_encoded_bytes();
        config.global.prefix = FileName::new(own).map_err(refused("name"))?;
        let root = folder.join("plain");
        let root = TransportPath::new(root.as_os_str().as_encoded_bytes());
        config.global.set_root_path(&root.map_err(refused("folder"))?);
        let node = NodeBuilder::new()
            .config(&config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<ipc::Service>()
            .map_err(refused("node"))?;
        Ok(PlainNode { node })
    }

    fn service(&self) -> Result<PortFactory<ipc::Service>, RigError> {
        let name = ServiceName::new(SERVICE).map_err(refused("service name"))?;
        self.node.service_builder(&name).event().open_or_create().map_err(refused("service"))
    }

    /// A notifying end.
    ///
    /// # Errors
    ///
    /// When the transport refuses.
    pub fn notifier(&self) -> Result<PlainNotifier, RigError> {
        let port = self.service()?.notifier_builder().create().map_err(refused("notifier"))?;
        Ok(PlainNotifier(port))
    }

    /// A waiting end.
    ///
    /// # Errors
    ///
    /// When the transport refuses.
    pub fn listener(&self) -> Result<PlainListener, RigError> {
        let port = self.service()?.listener_builder().create().map_err(refused("listener"))?;
        Ok(PlainListener(port))
    }
}

/// Wakes who listens.
#[derive(Debug)]
pub struct PlainNotifier(Notifier<ipc::Service>);

impl PlainNotifier {
    /// Notifies every listener.
    ///
    /// # Errors
    ///
    /// When the transport refuses.
    pub fn notify(&self) -> Result<(), RigError> {
        self.0.notify().map(|_| ()).map_err(refused("notification"))
    }
}

/// Waits for a notification.
#[derive(Debug)]
pub struct PlainListener(Listener<ipc::Service>);

impl PlainListener {
    /// Waits until notified.
    ///
    /// # Errors
    ///
    /// When the transport refuses.
    pub fn wait(&self) -> Result<(), RigError> {
        self.0.blocking_wait(|_| {}).map(|_| ()).map_err(refused("wait"))
    }
}
