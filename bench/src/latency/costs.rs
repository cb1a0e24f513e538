//! Cost of one poll and one publish to the controller, on its own core.

use dynocar_client::{SamplePublisher, SnapshotReader};
use dynocar_shared::{ParameterSnapshot, PipelineKind, TrainId, TrainSample};
use dynocar_tests::process::DaemonSite;
use dynocar_transport::channel::{Receiver, Sender, Transport};
use dynocar_transport::monotonic_now_ns;
use serde::Serialize;

use crate::output::BenchError;
use crate::rig::site::site;
use crate::statistics::median;

const TRAIN: TrainId = TrainId(1);
/// Calls that are timed together, so that the clock's own cost is spread.
const CALLS: u64 = 256;

/// Number of pipelines that counts as many.
pub const MANY: u32 = 16;

/// Costs in ns, each the median over batches or calls.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Costs {
    /// One poll when nothing has come, one pipeline.
    pub poll_without_news_ns: f64,
    /// The same of [`MANY`] pipelines.
    pub poll_of_many_without_news_ns: f64,
    /// One poll that takes a snapshot.
    pub poll_with_news_ns: f64,
    /// One publish, to one awake pipeline thread.
    pub publish_ns: f64,
}

/// Both ends of a train's channels in one process.
struct Ends {
    /// One for each pipeline.
    snapshots: Vec<Sender<ParameterSnapshot>>,
    samples: Receiver<TrainSample>,
    publisher: SamplePublisher,
    reader: SnapshotReader,
    snapshot: ParameterSnapshot,
    _site: DaemonSite,
}

impl Ends {
    /// Opens a train with `pipelines` pipelines, each of which has answered.
    fn open(pipelines: u32) -> Result<Self, BenchError> {
        let site = site();
        let transport = Transport::open(&site.host(), "dynocar-bench-costs")?;
        let mut snapshot = ParameterSnapshot::empty();
        snapshot.train_id = TRAIN.0;
        snapshot.pipeline_kind = PipelineKind::Rls as u32;
        let senders = (0..pipelines).map(|_| transport.sender(TRAIN));
        let mut ends = Ends {
            snapshots: senders.collect::<Result<_, _>>()?,
            samples: transport.receiver(TRAIN)?,
            publisher: SamplePublisher::open(&site.host(), TRAIN)?,
            reader: SnapshotReader::open(&site.host(), TRAIN)?,
            snapshot,
            _site: site,
        };
        for (sender, pipeline_index) in ends.snapshots.iter().zip(0..) {
            sender.send(&ParameterSnapshot { pipeline_index, ..snapshot })?;
        }
        ends.reader.poll();
        Ok(ends)
    }

    fn send_snapshot(&mut self) -> Result<(), BenchError> {
        self.snapshot.sequence += 1;
        Ok(self.snapshots[0].send(&self.snapshot)?)
    }
}

/// Measures the costs over `batches` batches.
///
/// # Errors
///
/// When a channel cannot be used.
pub fn measure(batches: usize) -> Result<Costs, BenchError> {
    let (mut ends, mut of_many) = (Ends::open(1)?, Ends::open(MANY)?);
    let mut sample = TrainSample::empty(TRAIN);
    for _ in 0..100 {
        ends.send_snapshot()?;
        ends.publisher.publish(&mut sample)?;
        ends.reader.poll();
        while ends.samples.receive().is_some() {}
    }
    let of_batches = |call: &mut dyn FnMut()| {
        median((0..batches).map(|_| of_batch(&mut *call)).collect()).unwrap_or(f64::NAN)
    };
    let clock_ns = of_batches(&mut || _ = std::hint::black_box(monotonic_now_ns()));
    let poll_without_news_ns = of_batches(&mut || _ = std::hint::black_box(ends.reader.poll()));
    let poll_of_many_without_news_ns =
        of_batches(&mut || _ = std::hint::black_box(of_many.reader.poll()));
    let (mut with_news, mut publish) = (Vec::new(), Vec::new());
    for _ in 0..batches {
        for _ in 0..CALLS {
            ends.send_snapshot()?;
            let before_ns = monotonic_now_ns();
            ends.reader.poll();
            with_news.push((monotonic_now_ns() - before_ns) as f64);
        }
        let before_ns = monotonic_now_ns();
        for _ in 0..CALLS {
            ends.publisher.publish(&mut sample)?;
        }
        publish.push((monotonic_now_ns() - before_ns) as f64 / CALLS as f64);
        while ends.samples.receive().is_some() {}
    }
    Ok(Costs {
        poll_without_news_ns,
        poll_of_many_without_news_ns,
        poll_with_news_ns: median(with_news).map_or(f64::NAN, |ns| (ns - clock_ns).max(0.0)),
        publish_ns: median(publish).unwrap_or(f64::NAN),
    })
}

/// Returns the time of one call, in ns, from a batch.
fn of_batch(mut call: impl FnMut()) -> f64 {
    let before_ns = monotonic_now_ns();
    for _ in 0..CALLS {
        call();
    }
    (monotonic_now_ns() - before_ns) as f64 / CALLS as f64
}
