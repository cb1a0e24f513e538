//! A listener and a notifier of the plain transport, compared with Dynocar's own waking.

use std::path::Path;

use dynocar_transport::Host;
use iceoryx2::prelude::{
    Config, FileName, NodeBuilder, Path as TransportPath, SemanticString, ServiceName,
    SignalHandlingMode, ipc,
};
use iceoryx2::service::port_factory::event::PortFactory;

use crate::output::BenchError;

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
