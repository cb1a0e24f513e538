//! What one publish and one poll cost, by the number of peers.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use dynocar_client::channel::{Sender, Transport};
use dynocar_client::{SamplePublisher, SnapshotReader};
use dynocar_shared::{ParameterSnapshot, TrainId, TrainSample};
use dynocar_tests::process::Site;

const TRAIN: TrainId = TrainId(1);

fn snapshot(pipeline_index: u32) -> ParameterSnapshot {
    let mut snapshot = ParameterSnapshot::empty();
    (snapshot.train_id, snapshot.pipeline_index) = (TRAIN.0, pipeline_index);
    snapshot
}

fn poll(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("crit_poll");
    for pipelines in [1_u32, 4, 8, 16] {
        let site = Site::new();
        let host = site.host();
        let transport = Transport::open(&host, "bench").expect("the transport");
        let senders: Vec<Sender<ParameterSnapshot>> =
            (0..pipelines).map(|_| transport.sender(TRAIN).expect("a sender")).collect();
        let mut reader = SnapshotReader::open(&host, TRAIN).expect("a reader");
        let mut sequence = 0;
        for (sender, index) in senders.iter().zip(0..) {
            sender.send(&snapshot(index)).expect("a message to be taken");
        }
        reader.poll();
        group.bench_function(BenchmarkId::new("without_news", pipelines), |bencher| {
            bencher.iter(|| reader.poll());
        });
        group.bench_function(BenchmarkId::new("send_and_poll", pipelines), |bencher| {
            bencher.iter(|| {
                sequence += 1;
                let mut news = snapshot(0);
                news.sequence = sequence;
                senders[0].send(&news).expect("a message to be taken");
                reader.poll()
            });
        });
    }
    group.finish();
}

fn publish(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("crit_publish");
    for threads in [0_u32, 1, 4, 8] {
        let site = Site::new();
        let host = site.host();
        let transport = Transport::open(&host, "bench").expect("the transport");
        let _receivers: Vec<_> = (0..threads)
            .map(|_| transport.receiver::<TrainSample>(TRAIN).expect("a receiver"))
            .collect();
        let mut publisher = SamplePublisher::open(&host, TRAIN).expect("a publisher");
        let mut sample = TrainSample::empty(TRAIN);
        group.bench_function(BenchmarkId::new("sample", threads), |bencher| {
            bencher.iter(|| publisher.publish(&mut sample));
        });
    }
    group.finish();
}

criterion_group!(benches, poll, publish);
criterion_main!(benches);
