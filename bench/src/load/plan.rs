//! So many trains with some pipelines, against one daemon.

use dynocar::config::IdleStrategy;
use dynocar_shared::PipelineKind;

use crate::open_loop::trial::{Answerer, Extent, Setting, Trial, run};
use crate::output::Failure;
use crate::rig::cores::in_thread;

/// So many trains with some pipelines.
#[derive(Clone, Debug)]
pub struct Load {
    /// The pipelines of the daemon.
    pub pipelines: Vec<PipelineKind>,
    /// What its threads do while no sample comes.
    pub idle: IdleStrategy,
    /// What is put on it.
    pub extent: Extent,
}

impl Load {
    /// Puts it on a daemon.
    ///
    /// # Errors
    ///
    /// When a process or channel fails.
    pub fn run(&self) -> Result<Trial, Failure> {
        let answerer = Answerer::Daemon(self.pipelines.clone(), None);
        let setting = Setting { answerer, idle: self.idle, companions: &[], candidates: 0 };
        in_thread(|| run(&setting, &self.extent))
    }
}
