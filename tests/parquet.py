"""Reads with pyarrow what tests/recordings.sh made Parquet, and writes the demo's runs with pandas."""

import math
import pathlib
import sys

import pandas
import pyarrow as pa
import pyarrow.parquet as pq
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

place = pathlib.Path(sys.argv[1])
folder = place / "ended.parquet"


def raw(name):
    """Every message with its topic and times, as bytes."""
    with open(place / name, "rb") as file:
        messages = make_reader(file).iter_messages(log_time_order=False)
        return [
            (channel.topic, message.sequence, message.log_time, message.publish_time, message.data)
            for _, channel, message in messages
        ]


assert raw("back.mcap") == raw("ended.mcap"), "the same messages in the same order"

decoded = {}
with open(place / "ended.mcap", "rb") as file:
    reader = make_reader(file, decoder_factories=[DecoderFactory()])
    for _, channel, message, value in reader.iter_decoded_messages(log_time_order=False):
        decoded.setdefault(channel.topic, []).append((message, value))
    attached = {it.name: it.data for it in reader.iter_attachments()}


def same(one, other):
    return one == other or (
        isinstance(one, float) and math.isnan(one) and isinstance(other, float) and math.isnan(other)
    )


def compare(name, messages, value_of):
    """Every cell of a table against the field of the message."""
    table = pq.read_table(folder / name)
    assert table.num_rows == len(messages), name
    logged = table["log_time"].cast(pa.int64()).to_pylist()
    assert logged == [message.log_time for message, _ in messages], name
    cells = 0
    for column in table.column_names[2:]:
        for found, (_, value) in zip(table[column].to_pylist(), messages):
            expected = value_of(value, column)
            if isinstance(found, list):
                # What is 0 at the end of an array is left out of a message.
                expected = list(expected) + [0] * (len(found) - len(expected))
                assert all(map(same, found, expected)), (name, column)
            else:
                assert same(found, expected), (name, column, found, expected)
            cells += 1
    return table, cells


def plain(value, column):
    field = value.DESCRIPTOR.fields_by_name[column]
    return getattr(value, column) if not field.has_presence or value.HasField(column) else None


def of_snapshot(value, column):
    if column in value.DESCRIPTOR.fields_by_name:
        return plain(value, column)
    if column.startswith("rejected_"):
        return getattr(value.rejected, column.removeprefix("rejected_"))
    return plain(value.estimate, column.removeprefix("estimate_"))


samples, count = compare("samples-1.parquet", decoded["/train/1/samples"], plain)
assert samples["acceleration_mps2"].null_count == samples.num_rows, "missing is null"
field = samples.schema.field("speed_mps")
assert field.type == pa.float64() and field.nullable, field
assert field.metadata[b"unit"] == b"m/s" and b"never negative" in field.metadata[b"meaning"], field.metadata
assert samples.schema.field("log_time").type == pa.timestamp("ns", tz="UTC")
said = pq.read_metadata(folder / "samples-1.parquet").metadata
for name in ["daemon", "train-1", "track-1"]:
    key = f"configuration-1/{name}.toml"
    assert said[key.encode()] == attached[key], key
for topic in decoded:
    if topic.startswith("/train/1/") and not topic.endswith("/samples"):
        name = f"snapshots-1-{topic.removeprefix('/train/1/')}.parquet"
        table, cells = compare(name, decoded[topic], of_snapshot)
        count += cells
        assert b"estimated" in table.schema.field("status").metadata[b"names"]
_, cells = compare("events.parquet", decoded["/events"], plain)
count += cells
kept = pq.read_table(folder / "attachments.parquet").to_pylist()
assert {it["name"]: it["content"] for it in kept} == attached
print(f"{count} cells, read by pyarrow {pa.__version__}, are those that mcap-protobuf-support decodes")

# The demo's runs as pandas writes them: times as timestamps, forces as floats of 32 bits are others' habits; the
# second run has its times in ms, the third is compressed otherwise.
for path in sorted((place / "of_pandas/runs").glob("*.csv")):
    run = pandas.read_csv(path)
    number = int(path.stem)
    if number != 1:
        unit = "ms" if number == 2 else "ns"
        run["time_s"] = pandas.to_timedelta((run["time_s"] * 1000).round(), unit="ms").astype(f"timedelta64[{unit}]")
    run["note"] = "a text that no column is mapped to"
    run.to_parquet(path.with_suffix(".parquet"), compression="gzip" if number == 3 else "snappy")
    path.unlink()
pandas.DataFrame({"time_s": [0.0], "position_m": [0.0], "speed_mps": [[1.0]], "traction_force_n": [0.0],
                  "brake_force_n": [0.0], "brake_pressure_pa": [0.0], "ambient_temperature_c": [0.0]}).to_parquet(
    place / "wrong.parquet"
)
