"""Publishing and polling, against a daemon that is played and against the real one."""

from __future__ import annotations

import gc
import inspect
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import dynocar
import numpy as np
import pytest
from conftest import PATIENCE_S, PROGRAMS, ROOT, TRAIN, Lines, PlayedDaemon, dynocar_command, wait_for
from dynocar import Code, Manoeuvre, Parameter, PipelineKind, RejectionReason, _native

EXAMPLE = ROOT / "client/examples/controller.py"


def publish(publisher: dynocar.SamplePublisher, cycle: int) -> int:
    return publisher.publish(
        time_ns=1000 + cycle,
        direction=-1,
        wheel_slide=True,
        position_m=cycle + 0.5,
        speed_mps=cycle + 1.5,
        traction_force_n=cycle + 2.5,
        brake_force_n=cycle + 3.5,
        brake_cylinder_pressure_pa=cycle + 4.5,
        acceleration_mps2=cycle + 5.5,
        specific_force_mps2=cycle + 6.5,
        mass_kg=cycle + 7.5,
        ambient_temperature_degc=cycle + 8.5,
        gradient_permille=cycle + 9.5,
        curve_radius_m=cycle + 10.5,
    )


def drive(
    publisher: dynocar.SamplePublisher, reader: dynocar.SnapshotReader
) -> tuple[dynocar.Snapshot, int]:
    """Publishes until an answer to the 20th sample or a later one is usable."""
    deadline_s = time.monotonic() + PATIENCE_S
    cycle = 0
    while time.monotonic() < deadline_s:
        publish(publisher, cycle)
        reader.poll()
        snapshot = reader.resistance()
        if snapshot.is_usable and snapshot.raw.sample_sequence >= 20:
            return snapshot, cycle
        cycle += 1
        time.sleep(0.001)
    raise AssertionError("no answer")


def test_a_python_controller_goes_the_whole_way(played: PlayedDaemon) -> None:
    state, words = dynocar.daemon_state(TRAIN, played.root)
    assert state == dynocar.DaemonState.COMPATIBLE and words
    with (
        dynocar.SamplePublisher(TRAIN, played.root) as publisher,
        dynocar.SnapshotReader(TRAIN, played.root) as reader,
    ):
        reader.set_stale_after_ns(100_000_000)
        before = reader.resistance()
        assert (before.code, before.why, before.is_usable) == (Code.NO_SNAPSHOT, "no_snapshot", False)
        with pytest.raises(dynocar.ChannelError, match="already has a controller") as refusal:
            dynocar.SamplePublisher(TRAIN, played.root)
        assert refusal.value.code == Code.OCCUPIED
        played.order("answer")
        snapshot, cycle = drive(publisher, reader)
        assert_is_the_played_answer(snapshot)
        assert_it_prints_itself(snapshot)
        mass = reader.mass()
        assert (mass.why, mass.is_usable, mass.is_stale) == ("not_provided", False, True)
        assert (str(mass), repr(mass)) == (
            "not_provided, not usable",
            "<Snapshot not_provided, not usable>",
        )
        assert reader.latest(PipelineKind.RESISTANCE_KALMAN) is not None
        assert reader.latest_by_index(3) is not None
        assert reader.latest(PipelineKind.MASS_KALMAN) is None and reader.latest_by_index(4) is None
        played.order("silence")
        publisher.start_run()
        publish(publisher, cycle + 1)
        assert publisher.flush(PATIENCE_S) == 0
        assert_is_silent_at_last(reader)
        assert reader.refused == 0
    wait_for(lambda: len(played.samples) == cycle + 2)
    assert_samples_came_through(played)


def assert_is_the_played_answer(snapshot: dynocar.Snapshot) -> None:
    assert (snapshot.code, snapshot.status.name, snapshot.why) == (Code.OK, "ESTIMATED", "none")
    assert snapshot.pipeline_kind == PipelineKind.RESISTANCE_KALMAN
    assert snapshot.raw.pipeline_index == 3
    names = [Parameter.MASS, Parameter.DAVIS_C, Parameter.DAVIS_A, Parameter.DAVIS_B]
    assert snapshot.parameters == names
    assert snapshot.values == dict(zip(names, [114.5, 0.0013, 1.7, 0.021]))
    # Entries of the covariance: 0.25 on the diagonal, else 0.01, over one and both places.
    expected = [
        [(0.25 if row == column else 0.01) / (1 + row + column) for column in range(4)]
        for row in range(4)
    ]
    assert snapshot.covariance_matrix == expected
    assert snapshot.std(Parameter.DAVIS_B) == (0.25 / 7) ** 0.5
    with pytest.raises(KeyError):
        snapshot.std(Parameter.ADHESION)
    found = snapshot.resistance_at(20.0, 1e5)
    assert found is not None and not found.is_extrapolated
    powers = {1: 20.0**2, 2: 1.0, 3: 20.0}
    variance = sum(expected[i][j] * powers[i] * powers[j] for i in powers for j in powers)
    w0 = 1.7 + 20.0 * (0.021 + 20.0 * 0.0013)
    assert found.w0_n_per_kn == pytest.approx(w0)
    assert found.w0_std_n_per_kn == pytest.approx(variance**0.5)
    assert found.force_n / found.w0_n_per_kn == pytest.approx(found.force_std_n / found.w0_std_n_per_kn)
    assert found.force_n == pytest.approx(w0 * 1e5 * 9.81 / 1000, rel=1e-3)
    far = snapshot.resistance_at(40.0)
    assert far is not None and far.is_extrapolated
    with pytest.raises(dynocar.ChannelError):
        snapshot.resistance_at(float("nan"))
    assert snapshot.rejected == {RejectionReason.WHEEL_SLIDE: 4}
    assert snapshot.missing_manoeuvres == Manoeuvre.COAST_SLOW | Manoeuvre.ACCELERATE


def test_a_stop_is_computed_as_in_rust_and_c() -> None:
    stop = dynocar.Stop(from_speed_mps=20.0, mass_kg=1e5, brake_scale_std=0.05, dead_time_s=1.0)
    found = stop.estimate([(0.0, 1e5), (40.0, 1e5)], 0.95)
    # 20 m/s at 1 m/s² after 1 s; at the edge with 1.645 standard deviations less brake.
    assert found.distance_m == pytest.approx(220.0, rel=1e-6)
    assert found.time_s == pytest.approx(21.0, rel=1e-6)
    assert found.distance_bound_m == pytest.approx(20.0 + 200.0 / (1.0 - 0.05 * 1.6448536), rel=1e-6)
    slope = dynocar.Stop(from_speed_mps=20.0, mass_kg=1e5, gradient_permille=-200.0)
    for wrong, effort, code in (
        (slope, [(0.0, 1e5)], Code.DOES_NOT_STOP),
        (stop, [], Code.BAD_NUMBER),
        (stop, [(0.0, float("nan"))], Code.BAD_NUMBER),
    ):
        with pytest.raises(dynocar.ChannelError) as error:
            wrong.estimate(effort, 0.95)
        assert error.value.code == code


def assert_it_prints_itself(snapshot: dynocar.Snapshot) -> None:
    # The halves of the intervals: 1.96 of the roots of 0.25, 0.25/3, 0.25/5 and 0.25/7.
    assert str(snapshot).splitlines() == [
        "resistance_kalman estimated, usable",
        "    mass     114.50 ± 0.98 t",
        "    davis_c  0.00 ± 0.57 N/kN per (m/s)²",
        "    davis_a  1.70 ± 0.44 N/kN",
        "    davis_b  0.02 ± 0.37 N/kN per m/s",
        "± is the half width of the 95 % interval",
    ]
    assert repr(snapshot).startswith(
        "<Snapshot resistance_kalman estimated, usable: mass 114.50 ± 0.98 t, davis_c 0.00"
    )


def assert_is_silent_at_last(reader: dynocar.SnapshotReader) -> None:
    def is_silent() -> bool:
        reader.poll()
        return reader.resistance().is_stale

    wait_for(is_silent)
    snapshot = reader.resistance()
    shown = (snapshot.status.name, snapshot.why, snapshot.is_usable)
    assert shown == ("INVALID", "daemon_silent", False)
    words = "resistance_kalman invalid (daemon_silent), not usable (unavailable)"
    assert str(snapshot).splitlines()[0] == words


def assert_samples_came_through(played: PlayedDaemon) -> None:
    samples = played.samples
    assert [sample["sequence"] for sample in samples] == list(range(1, len(samples) + 1))
    for cycle, sample in enumerate(samples):
        assert (sample["time_ns"], sample["train_id"]) == (1000 + cycle, TRAIN)
        assert (sample["direction"], sample["flags"]) == (-1, 1)
        assert sample["values"] == [cycle + place + 0.5 for place in range(11)]
    runs = [sample["run"] for sample in samples]
    assert len(set(runs[:-1])) == 1 and runs[-1] == runs[0] + 1


def test_missing_values_stay_missing(played: PlayedDaemon) -> None:
    with dynocar.SamplePublisher(TRAIN, played.root) as publisher:
        assert publisher.publish(speed_mps=21.5) == 1
        assert publisher.flush(PATIENCE_S) == 0
    wait_for(lambda: played.samples)
    assert played.samples[0]["values"] == [None, 21.5, *[None] * 9]


def test_ends_that_are_dropped_give_their_places_back(played: PlayedDaemon) -> None:
    for _ in range(100):
        dynocar.SnapshotReader(TRAIN, played.root)
        dynocar.SamplePublisher(TRAIN, played.root)
    for _ in range(50):
        drop_in_another_thread(played.root)
    for _ in range(50):
        open_in_a_thread_that_ends(played.root)
    for _ in range(100):
        cycle: list[object] = [dynocar.SnapshotReader(TRAIN, played.root)]
        cycle.append(cycle)
        del cycle
        gc.collect()
    held = []
    with pytest.raises(dynocar.ChannelError, match="all 12 places are taken") as refusal:
        while len(held) < 100:
            held.append(dynocar.SnapshotReader(TRAIN, played.root))
    assert (len(held), refusal.value.code) == (12, Code.NO_PLACE_LEFT)
    held.pop().close()
    dynocar.SnapshotReader(TRAIN, played.root).close()


def drop_in_another_thread(root: str) -> None:
    """The end's own thread, this one, closes it when it opens the next."""
    held = [dynocar.SnapshotReader(TRAIN, root)]
    thread = threading.Thread(target=held.clear)
    thread.start()
    thread.join()


def open_in_a_thread_that_ends(root: str) -> None:
    held = []
    thread = threading.Thread(target=lambda: held.append(dynocar.SnapshotReader(TRAIN, root)))
    thread.start()
    thread.join()
    assert len(held) == 1


def test_a_forked_child_is_refused_and_takes_nothing_of_its_parents(played: PlayedDaemon) -> None:
    publisher = dynocar.SamplePublisher(TRAIN, played.root)
    reader = dynocar.SnapshotReader(TRAIN, played.root)
    played.order("answer")
    drive(publisher, reader)
    child = os.fork()
    if child == 0:
        codes = []
        for call in [lambda: publish(publisher, 0), reader.poll, reader.resistance, reader.close]:
            try:
                call()
            except dynocar.ChannelError as error:
                codes.append(error.code)
        del publisher, reader
        gc.collect()
        os._exit(0 if codes == [Code.FORKED_PROCESS] * 4 else 1)
    assert os.waitpid(child, 0)[1] == 0
    drive(publisher, reader)


def test_another_thread_is_refused_and_the_end_stays_good(played: PlayedDaemon) -> None:
    reader = dynocar.SnapshotReader(TRAIN, played.root)
    errors = []

    def poll() -> None:
        try:
            reader.poll()
        except dynocar.ChannelError as error:
            errors.append(error)

    thread = threading.Thread(target=poll)
    thread.start()
    thread.join()
    assert [error.code for error in errors] == [Code.WRONG_THREAD]
    assert str(errors[0]) == "the handle was opened by another thread"
    assert reader.poll() == 0
    reader.close()
    reader.close()
    with pytest.raises(ValueError, match="the reader is closed"):
        reader.poll()


def test_a_flush_ends_with_ctrl_c(played: PlayedDaemon) -> None:
    publisher = dynocar.SamplePublisher(TRAIN, played.root)
    played.process.send_signal(signal.SIGSTOP)
    try:
        publisher.publish(speed_mps=1.0)
        main = os.getpid()
        threading.Timer(0.2, os.kill, (main, signal.SIGINT)).start()
        with pytest.raises(KeyboardInterrupt):
            publisher.flush(float("inf"))
    finally:
        played.process.send_signal(signal.SIGCONT)
    assert publisher.flush(PATIENCE_S) == 0
    publisher.close()


def test_a_wrong_directory_is_reported_in_words() -> None:
    with pytest.raises(dynocar.ChannelError, match="expected an absolute path") as refusal:
        dynocar.SnapshotReader(1, "here")
    assert refusal.value.code == Code.ROOT_NAME
    assert isinstance(refusal.value, dynocar.DynocarError)


def test_the_example_uses_the_daemon_and_falls_back(played: PlayedDaemon) -> None:
    environment = {**os.environ, "DYNOCAR_ROOT": played.root}
    example = Lines(sys.executable, EXAMPLE, TRAIN, 6000, env=environment)
    try:
        example.wait_for_line("the built-in parameters (no_snapshot)")
        played.order("answer")
        example.wait_for_line("the daemon (usable)")
        played.order("silence")
        example.wait_for_line("the built-in parameters (daemon_silent)")
    finally:
        example.process.kill()
        example.process.wait(PATIENCE_S)


@pytest.fixture
def root() -> Iterator[str]:
    """A run-time directory of a short name: sockets lie in it."""
    with tempfile.TemporaryDirectory(prefix="dynocar-") as folder:
        yield folder


def test_the_shipped_example_is_answered_by_the_shipped_daemon(root: str) -> None:
    environment = {**os.environ, "DYNOCAR_ROOT": root}
    command = [PROGRAMS / "dynocar", "run", "--config", ROOT / "config/daemon.toml"]
    daemon = Lines(*command, env=environment, stderr=subprocess.STDOUT)
    try:
        daemon.wait_for_line("serving")
        replay = dynocar_command("replay", ROOT / "config/demo", "--rate", 1000, env=environment)
        assert replay.returncode == 0, replay.stderr
        example = Lines(sys.executable, EXAMPLE, 1, PATIENCE_S, env=environment)
        example.wait_for_line("the daemon (usable)")
        example.process.kill()
        example.process.wait(PATIENCE_S)
    finally:
        daemon.process.terminate()
        daemon.process.wait(PATIENCE_S)


def test_numbers_names_and_fields_are_those_of_the_library() -> None:
    for name, members in _native.vocabularies():
        vocabulary = getattr(dynocar, name)
        expected = {re.sub("(?<!^)(?=[A-Z])", "_", it).upper(): number for it, number in members}
        assert {member.name: int(member) for member in vocabulary} == expected, name
    assert PipelineKind.LEAST_SQUARES == PipelineKind.LS
    assert dynocar.Status(99).name == "NUMBER_99"
    header = (ROOT / "client/include/dynocar.h").read_text()
    _, sample, snapshot = _native.layouts()
    for layout in (sample, snapshot):
        assert f"{layout:#x}" in header
    assert dynocar.__version__ == dynocar_command("--version").stdout.split()[1]


def test_numpy_reads_a_snapshot_as_it_lies_in_shared_memory(tmp_path: Path) -> None:
    with dynocar.SnapshotReader(1, tmp_path / "root") as reader:
        raw = reader.resistance().raw
    assert len(bytes(raw)) == dynocar.SNAPSHOT_DTYPE.itemsize
    read = np.frombuffer(bytes(raw), dynocar.SNAPSHOT_DTYPE)[0]
    names = dynocar.SNAPSHOT_DTYPE.names
    assert names is not None and set(names) <= set(dir(raw))
    for name in names:
        assert np.array_equal(read[name], getattr(raw, name)), name
    with pytest.raises(AttributeError, match="no field 'speed_kmh'"):
        raw.speed_kmh  # type: ignore[attr-defined]
    # What a type checker sees, and what publish takes, are the same fields.
    stub = (Path(dynocar.__file__).parent / "_native.pyi").read_text()
    block = stub.split("class ParameterSnapshot:")[1].split("    def ")[0]
    assert tuple(re.findall(r"^    (\w+): ", block, re.MULTILINE)) == names
    measured = list(inspect.signature(dynocar.SamplePublisher.publish).parameters)[4:]
    sample_names = dynocar.SAMPLE_DTYPE.names
    assert sample_names is not None and list(sample_names[-len(measured) :]) == measured


def test_the_page_of_the_fields_says_the_types_for_numpy() -> None:
    page = (ROOT / "docs/recording_fields.md").read_text()
    for title, dtype in [
        ("TrainSample", dynocar.SAMPLE_DTYPE),
        ("ParameterSnapshot", dynocar.SNAPSHOT_DTYPE),
    ]:
        table = page.split(f"## `dynocar.{title}`")[1].split("\n## ")[0]
        shown = re.findall(r"^\| `(\w+)` .*\| `(\S+)` at (\d+) \|", table, re.MULTILINE)
        fields = dtype.fields
        assert fields is not None and [name for name, _, _ in shown] == list(fields)
        for name, kind, offset in shown:
            assert (np.dtype(kind), int(offset)) == tuple(fields[name][:2]), name
