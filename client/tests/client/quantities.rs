//! Asking for a quantity: the reader follows the pipeline that the daemon's snapshots name.

use dynocar_client::{NoAnswer, SnapshotReader};
use dynocar_shared::{ParameterSnapshot, Quantity, Status, TrainId};
use dynocar_transport::channel::{Sender, Transport};
use dynocar_transport::{ChannelError, Host, monotonic_now_ns};

const TRAIN: TrainId = TrainId(11);

struct Bench {
    host: Host,
    transport: Transport,
    // Last, so that it goes after all that uses it.
    _directory: tempfile::TempDir,
}

fn bench() -> Bench {
    let directory = tempfile::tempdir().unwrap();
    let host = Host::at(directory.path()).unwrap();
    let transport = Transport::open(&host, "test-daemon").unwrap();
    Bench { host, transport, _directory: directory }
}

/// Sends a snapshot of a pipeline that answers some of the train's quantities.
fn send(
    sender: &Sender<ParameterSnapshot>,
    epoch: u64,
    pipeline_index: u32,
    answers: &[Quantity],
    train_answers: &[Quantity],
) {
    let bits = |it: &[Quantity]| it.iter().fold(0, |bits, it| bits | it.bit());
    let mut snapshot = ParameterSnapshot::empty();
    (snapshot.epoch, snapshot.sequence, snapshot.train_id) = (epoch, 1, TRAIN.0);
    snapshot.pipeline_index = pipeline_index;
    snapshot.status = Status::Estimated as u32;
    (snapshot.quantities, snapshot.train_quantities) = (bits(answers), bits(train_answers));
    snapshot.usable_quantities = snapshot.quantities;
    snapshot.vouched_ns = monotonic_now_ns();
    sender.send(&snapshot).unwrap();
}

fn answering(reader: &SnapshotReader, quantity: Quantity) -> Result<u32, NoAnswer> {
    reader.quantity(quantity, monotonic_now_ns()).map(|it| it.snapshot.pipeline_index)
}

#[test]
fn not_provided_is_distinguished_from_not_heard_yet() {
    use Quantity::{Adhesion, Mass, Resistance};
    let bench = bench();
    let mut reader = SnapshotReader::open(&bench.host, TRAIN).unwrap();
    assert_eq!(answering(&reader, Resistance), Err(NoAnswer::NoSnapshot), "no daemon yet");
    let sender = bench.transport.sender(TRAIN).unwrap();
    send(&sender, 5, 2, &[Resistance], &[Resistance, Mass]);
    assert_eq!(reader.poll(), 1);
    assert_eq!(answering(&reader, Resistance), Ok(2));
    assert_eq!(answering(&reader, Mass), Err(NoAnswer::NoSnapshot), "its pipeline is not heard");
    assert_eq!(answering(&reader, Adhesion), Err(NoAnswer::NotProvided));
    let now_ns = monotonic_now_ns();
    assert!(reader.resistance(now_ns).unwrap().is_usable());
    assert!(!reader.resistance(now_ns + 1_000_000_000).unwrap().is_usable(), "silent since");
    let missing = [
        reader.mass(now_ns).unwrap_err().name(),
        reader.adhesion(now_ns).unwrap_err().name(),
        reader.brake_friction(now_ns).unwrap_err().name(),
        reader.braking_ratio(now_ns).unwrap_err().name(),
    ];
    assert_eq!(missing, ["no_snapshot", "not_provided", "not_provided", "not_provided"]);
}

#[test]
fn a_reader_follows_the_daemon_to_another_pipeline() {
    use Quantity::{Mass, Resistance};
    let bench = bench();
    let mut reader = SnapshotReader::open(&bench.host, TRAIN).unwrap();
    // One sender for each pipeline, as in the daemon: a reader holds the newest of each.
    let senders = [0; 3].map(|_| bench.transport.sender(TRAIN).unwrap());
    send(&senders[0], 5, 2, &[Resistance, Mass], &[Resistance, Mass]);
    reader.poll();
    assert_eq!([Resistance, Mass].map(|it| answering(&reader, it)), [Ok(2), Ok(2)]);
    // The next daemon's configuration has another order, and no mass.
    send(&senders[1], 6, 0, &[], &[Resistance]);
    reader.poll();
    let nothing = [Err(NoAnswer::NoSnapshot), Err(NoAnswer::NotProvided)];
    assert_eq!([Resistance, Mass].map(|it| answering(&reader, it)), nothing);
    send(&senders[2], 6, 1, &[Resistance], &[Resistance]);
    reader.poll();
    assert_eq!(answering(&reader, Resistance), Ok(1));
    // Messages that the dead one had sent and nobody had read change nothing.
    send(&senders[0], 5, 3, &[Resistance, Mass], &[Resistance, Mass]);
    reader.poll();
    assert_eq!(answering(&reader, Resistance), Ok(1));
    assert_eq!(answering(&reader, Mass), Err(NoAnswer::NotProvided));
}

#[test]
fn the_thirteenth_reader_is_refused_in_words() {
    let bench = bench();
    let mut readers: Vec<_> =
        (0..12).map(|_| SnapshotReader::open(&bench.host, TRAIN).unwrap()).collect();
    let error = SnapshotReader::open(&bench.host, TRAIN).unwrap_err();
    assert!(matches!(error, ChannelError::NoPlaceLeft { limit: 12, .. }), "{error:?}");
    let words = "snapshots of train 11: all 12 places are taken. Each reader";
    assert!(error.to_string().starts_with(words), "{error}");
    let sender = bench.transport.sender(TRAIN).unwrap();
    send(&sender, 5, 0, &[Quantity::Mass], &[Quantity::Mass]);
    for reader in &mut readers {
        assert_eq!(reader.poll(), 1, "who reads is not disturbed");
    }
    readers.pop();
    SnapshotReader::open(&bench.host, TRAIN).unwrap();
}
