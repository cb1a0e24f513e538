//! Several trains with some pipelines, against one daemon.

use dynocar::config::IdleStrategy;
use dynocar_shared::PipelineKind;

use crate::ending;
use crate::open_loop::trial::{Answerer, Extent, OpenLoopTrial, Setting, run};
use crate::output::BenchError;
use crate::rig::cores::in_thread;

/// Several trains with some pipelines.
#[derive(Clone, Debug)]
pub struct Load {
    /// The pipelines of the daemon.
    pub pipelines: Vec<PipelineKind>,
    /// Idle strategy of its threads.
    pub idle: IdleStrategy,
    /// Extent of the load.
    pub extent: Extent,
}

impl Load {
    /// Puts it on a daemon.
    ///
    /// # Errors
    ///
    /// When a process or channel fails.
    pub fn run(&self) -> Result<OpenLoopTrial, BenchError> {
        let answerer = Answerer::Daemon(self.pipelines.clone(), None);
        let setting = Setting { answerer, idle: self.idle, companions: &[], candidates: 0 };
        in_thread(|| run(&setting, &self.extent, ending::flag()))
    }
}
