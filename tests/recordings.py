"""Reads what tests/recordings.sh recorded with the readers of mcap and mcap-protobuf-support."""

import pathlib
import sys

from mcap.reader import NonSeekingReader, make_reader
from mcap_protobuf.decoder import DecoderFactory

place = pathlib.Path(sys.argv[1])


def messages(name, of_broken):
    """(topic, message) of everything that can be read; the reader of a broken file ends with an error."""
    found = []
    with open(place / name, "rb") as file:
        reader = NonSeekingReader if of_broken else make_reader
        decoded = reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages(
            log_time_order=False
        )
        try:
            for _, channel, message, value in decoded:
                found.append((channel.topic, message, value))
        except Exception as error:
            if not of_broken:
                raise
            print(f"{name}: ends with {type(error).__name__}")
    return found


whole = messages("ended.mcap", of_broken=False)
killed = messages("killed.mcap", of_broken=True)
recovered = messages("recovered.mcap", of_broken=False)


def samples(found):
    return [value for topic, _, value in found if topic == "/train/1/samples"]


expected = samples(whole)
assert len(expected) > 3_000, len(expected)
numbers = [it.sequence for it in expected]
assert numbers == list(range(numbers[0], numbers[0] + len(numbers))), "no number is missing"
for name, found in [("killed", killed), ("recovered", recovered)]:
    assert [it.sequence for it in samples(found)] == numbers, name

first, topics = expected[0], {topic for topic, _, _ in whole}
assert first.HasField("speed_mps") and first.HasField("traction_force_n")
assert not first.HasField("acceleration_mps2"), "missing is missing"
assert {"/train/1/0_train_kalman", "/train/1/1_adhesion_law", "/events"} <= topics, topics

mass = [value for topic, _, value in whole if topic == "/train/1/0_train_kalman"][-1]
assert 1_600 < mass.estimate.mass_t < 1_800 and mass.estimate.mass_std_t > 0, mass
assert mass.estimate.mass_t in mass.values
assert not mass.estimate.HasField("adhesion")
status = mass.DESCRIPTOR.fields_by_name["status"].enum_type.values_by_number[mass.status].name
assert status == "STATUS_ESTIMATED", status
for _, message, value in whole:
    # Wall time, and the monotonic stamps in the message.
    assert message.log_time > 1_700_000_000_000_000_000
texts = [value.text for topic, _, value in whole if topic == "/events"]
assert any(text.startswith("daemon ") for text in texts), texts
with open(place / "ended.mcap", "rb") as file:
    attached = {it.name for it in make_reader(file).iter_attachments()}
assert attached >= {f"configuration-1/{it}.toml" for it in ("daemon", "train-1", "track-1")}, attached
print(f"{len(whole)} messages, {len(expected)} samples, read by mcap and mcap-protobuf-support")
