//! Allocations on a sample's way through the channels once the peers know each other: none in our code, and in the
//! transport one reference count of fixed size for each sent message, allocated and freed within the call (iceoryx2
//! 0.10, `ChunkMutSharedState`).

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::path::Path;
use std::sync::Arc;

use dynocar::runtime::exchange::Exchange;
use dynocar_analysis::identify::published_samples;
use dynocar_client::{NoAnswer, SamplePublisher, SnapshotReader};
use dynocar_core::pipeline::Pipeline;
use dynocar_estimators::EstimatorSettings;
use dynocar_shared::{
    ParameterSnapshot, PipelineKind, Quantity, SampleField, TrainId, TrainSample,
};
use dynocar_tests::process::DaemonSite;
use dynocar_transport::channel::{Sender, Transport};
use dynocar_transport::monotonic_now_ns;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
    static LIVE_BYTES: Cell<i64> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call is handed on to the system's allocator unchanged; counting touches only
// thread-local numbers that need no allocation.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        LIVE_BYTES.with(|bytes| bytes.set(bytes.get() + layout.size() as i64));
        // SAFETY: the caller's promises are passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        LIVE_BYTES.with(|bytes| bytes.set(bytes.get() - layout.size() as i64));
        // SAFETY: the caller's promises are passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn allocations_of(work: impl FnOnce()) -> u64 {
    let before = ALLOCATIONS.with(Cell::get);
    work();
    ALLOCATIONS.with(Cell::get) - before
}

#[test]
fn the_counter_sees_an_allocation() {
    assert!(allocations_of(|| drop(std::hint::black_box(vec![1_u8; 64]))) > 0);
}

#[test]
fn another_models_pipelines_go_to_work_without_an_allocation() {
    let demo = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/demo");
    let dataset = dynocar::dataset::load(&demo).expect("the demo's runs");
    let samples = published_samples(&dataset, TrainId(1));
    let kind = PipelineKind::TrajectoryKalman;
    let settings = EstimatorSettings::default_of(kind).expect("a kind that can be built");
    let made = || {
        let (train, track) = (Arc::clone(&dataset.train), dataset.track.clone());
        let estimator = settings.build(&train).expect("default settings");
        Pipeline::new(TrainId(1), 0, train, track, estimator)
    };
    let (mut at_work, mut other) = (made(), made());
    for sample in &samples[..2000] {
        at_work.process(sample);
        other.process(sample);
    }
    let before = *at_work.snapshot();
    let exchange = Exchange::new(1);
    exchange.hand_over(vec![vec![other]]);
    let allocated = allocations_of(|| {
        let mut set = exchange.take(0, before.sample_sequence, true).expect("it stands");
        set[0].take_over(&mut at_work);
        std::mem::swap(&mut set[0], &mut at_work);
        exchange.give_back(0, set);
    });
    assert_eq!(allocated, 0);
    let counts = |it: &ParameterSnapshot| {
        (it.sequence, it.samples_used, it.samples_rejected, it.samples_lost, it.sample_sequence)
    };
    assert_eq!(counts(at_work.snapshot()), counts(&before));
    let allocated = allocations_of(|| {
        for sample in &samples[2000..] {
            at_work.process(sample);
        }
    });
    assert_eq!(allocated, 0);
    assert_eq!(at_work.snapshot().samples_lost, 0);
}

#[test]
fn receiving_and_polling_allocate_nothing_and_sending_only_the_transports_reference_count() {
    const TRAIN: TrainId = TrainId(1);
    const CYCLES: u64 = 10_000;
    let site = DaemonSite::new();
    let host = site.host();
    let transport = Transport::open(&host, "test-daemon").unwrap();
    let samples = transport.receiver::<TrainSample>(TRAIN).unwrap();
    let snapshots: Sender<ParameterSnapshot> = transport.sender(TRAIN).unwrap();
    let mut publisher = SamplePublisher::open(&host, TRAIN).unwrap();
    let mut reader = SnapshotReader::open(&host, TRAIN).unwrap();

    let (mut sending, mut receiving) = (0, 0);
    let mut cycle = |sequence: u64| {
        sending += allocations_of(|| {
            let mut sample = TrainSample::empty(TRAIN).with(SampleField::Speed, 20.0);
            publisher.publish(&mut sample).unwrap();
        });
        receiving += allocations_of(|| assert!(samples.receive().is_some()));
        let mut snapshot = ParameterSnapshot::empty();
        (snapshot.train_id, snapshot.sequence) = (TRAIN.0, sequence);
        snapshot.pipeline_kind = PipelineKind::Rls as u32;
        snapshot.quantities = Quantity::Resistance.bit();
        sending += allocations_of(|| snapshots.send(&snapshot).unwrap());
        receiving += allocations_of(|| {
            assert_eq!(reader.poll(), 1);
            assert!(reader.latest(PipelineKind::Rls, monotonic_now_ns()).is_some());
            assert!(reader.resistance(monotonic_now_ns()).is_ok());
            assert_eq!(reader.mass(0).unwrap_err(), NoAnswer::NotProvided);
        });
        (sending, receiving)
    };
    // The first messages connect the ports, which allocates.
    let before = (1..=10).map(&mut cycle).last().unwrap();
    let bytes_before = LIVE_BYTES.with(Cell::get);
    let after = (11..=10 + CYCLES).map(&mut cycle).last().unwrap();
    assert_eq!(after.1 - before.1, 0, "receiving and polling");
    assert_eq!(after.0 - before.0, 2 * CYCLES, "one reference count for each of two messages");
    assert_eq!(LIVE_BYTES.with(Cell::get), bytes_before, "and all of them given back");
}
