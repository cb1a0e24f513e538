"""Recorded runs: the same answers as the commands, as objects, arrays and tables."""

from __future__ import annotations

import csv
import json
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import dynocar
import numpy as np
import pandas
import polars
import pyarrow
import pytest
from conftest import PATIENCE_S, PROGRAMS, ROOT, Lines, dynocar_command, wait_for


@pytest.fixture(scope="module")
def explanation(recordings: Path) -> dynocar.Explanation:
    return dynocar.explain(recordings)


def answer_of(*arguments: object) -> Any:
    done = dynocar_command(*arguments, "--json", "-")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_runs_are_arrays_in_si_units(recordings: Path) -> None:
    dataset = dynocar.read_dataset(recordings)
    assert dataset.name == "demo" and len(dataset.runs) == 4
    run = dataset.runs[0]
    assert (run.file, run.role, run.direction, run.samples) == ("runs/01.csv", "fit", 1, 2000)
    assert run.mass_kg == 1_755_700.0 and dataset.train.mass_kg > 0
    assert dataset.runs[3].role == "holdout" and dataset.track is not None
    with open(recordings / run.file) as file:
        rows = list(csv.DictReader(file))
    for name, column in [
        ("time_s", "time_s"),
        ("position_m", "position_m"),
        ("speed_mps", "speed_mps"),
        ("brake_cylinder_pressure_pa", "brake_pressure_pa"),
        ("ambient_temperature_degc", "ambient_temperature_c"),
    ]:
        expected = [float(row[column]) for row in rows]
        np.testing.assert_allclose(run.columns[name], expected, rtol=1e-12, err_msg=name)
    assert "curve_radius_m" not in run.columns, "nobody measured it"
    with pytest.raises(ValueError, match="read-only"):
        run.columns["speed_mps"][0] = 1.0


def test_numpy_and_arrow_share_the_memory_of_a_column(recordings: Path) -> None:
    run = dynocar.read_dataset(recordings).runs[0]
    array = run.columns["speed_mps"]
    column = pyarrow.table(run).column("speed_mps")
    assert column.num_chunks == 1
    assert column.chunk(0).buffers()[1].address == array.__array_interface__["data"][0]
    kept = array[-1]
    del run, column
    assert array[-1] == kept, "the array holds the memory"


def test_pandas_polars_and_pyarrow_take_runs_and_datasets(recordings: Path) -> None:
    dataset = dynocar.read_dataset(recordings)
    run = dataset.runs[1]
    for frame in (
        pyarrow.table(run).to_pandas(),
        polars.DataFrame(run).to_pandas(),
        pandas.DataFrame.from_arrow(run),
    ):
        assert list(frame.columns) == list(run.columns)
        np.testing.assert_array_equal(frame["speed_mps"].to_numpy(), run.columns["speed_mps"])
    whole = pyarrow.table(dataset)
    assert whole.num_rows == sum(run.samples for run in dataset.runs) == len(dataset.table)
    counts = polars.DataFrame(dataset).group_by("run").len().sort("run")
    assert counts.rows() == [(number, 2000) for number in (1, 2, 3, 4)]


def test_a_missing_value_is_nan_and_null(recordings: Path, tmp_path: Path) -> None:
    folder = tmp_path / "gap"
    subprocess.run(["cp", "-r", recordings, folder], check=True)
    file = folder / "runs/01.csv"
    lines = file.read_text().splitlines()
    cells = lines[5].split(",")
    cells[6] = ""
    lines[5] = ",".join(cells)
    file.write_text("\n".join(lines) + "\n")
    run = dynocar.read_dataset(folder).runs[0]
    assert np.flatnonzero(np.isnan(run.columns["ambient_temperature_degc"])).tolist() == [4]
    column = pyarrow.table(run).column("ambient_temperature_degc")
    assert column.null_count == 1 and not column[4].is_valid


def test_answers_are_those_of_the_commands(
    recordings: Path, explanation: dynocar.Explanation
) -> None:
    assert dynocar.check(recordings).to_dict() == answer_of("check", recordings)
    train = dynocar.check(recordings / "train.toml")
    assert train.valid and train.kind == "train" and train.dataset is None
    one = dynocar.identify(recordings, estimator="ls", per_run=True, traction_only=True)
    asked = ["--estimator", "ls", "--per-run", "--traction-only"]
    assert one.to_dict() == answer_of("identify", recordings, *asked)
    two = dynocar.identify(recordings, estimator=["ls", "mass_kalman"])
    asked = ["--estimator", "ls", "--estimator", "mass_kalman"]
    assert two.to_dict() == answer_of("identify", recordings, *asked)
    usual = dynocar.identify(recordings)
    assert usual.to_dict() == answer_of("identify", recordings)
    every = dynocar.identify(recordings, all=True)
    names = [it.name for it in usual.estimators]
    assert names[0] == "train_kalman" and not every.not_run
    assert sorted(names + usual.not_run) == sorted(it.name for it in every.estimators)
    expected = answer_of("explain", recordings)
    assert expected.pop("predictions") == {}
    assert {key: value for key, value in explanation.to_dict().items() if key != "predictions"} == (
        expected
    )
    assert str(explanation) == dynocar_command("explain", recordings).stdout
    assert str(train) == dynocar_command("check", recordings / "train.toml").stdout


def test_an_explanation_is_an_object(recordings: Path, tmp_path: Path) -> None:
    folder = tmp_path / "slow"
    subprocess.run(["cp", "-r", recordings, folder], check=True)
    # The drive gives more than it reports.
    manifest = (folder / "dataset.toml").read_text()
    stated = 'traction_force = { column = "traction_force_n", unit = "N"'
    assert stated in manifest
    (folder / "dataset.toml").write_text(manifest.replace(stated, f"{stated}, scale = 0.85"))
    explanation = dynocar.explain(folder)
    assert explanation.verdict in ("effect", "ambiguous"), explanation
    effect = explanation.effects[0]
    assert "traction_gain" in (effect.kind, *explanation.ambiguous_with), explanation
    assert effect.parameters.to_dict().keys() == effect.std.to_dict().keys()
    assert all(std > 0 for std in effect.std.to_dict().values())
    assert effect.p_value < 0.05 and effect.where.intervals_m is None
    assert explanation.base.a > 0 and explanation.base.std.a > 0
    assert 0 <= explanation.base.told_by_data.c <= 1
    assert explanation.rmse_after is not None and explanation.rmse_before is not None
    assert explanation.rmse_after < explanation.rmse_before
    with pytest.raises(AttributeError, match="no 'kinds'; it has kind, where"):
        effect.kinds
    with pytest.raises(AttributeError, match="cannot be changed"):
        effect.kind = "wind"
    grown = explanation.write_grown(tmp_path / "grown")
    assert [file.name for file in grown.files] == ["train.toml", "track.toml", "dataset.toml"]
    assert all(dynocar.check(file).valid for file in grown.files)
    assert explanation.statement in grown.files[0].read_text()


def test_an_explanation_shows_its_report(
    explanation: dynocar.Explanation, recordings: Path, tmp_path: Path
) -> None:
    done = dynocar_command("explain", recordings, "--plots", tmp_path / "plots")
    assert done.returncode == 0, done.stderr
    files = {file.name: file.read_text() for file in (tmp_path / "plots").iterdir()}
    assert {plot.name: plot._repr_svg_() for plot in explanation.plots} == files
    assert len(files) > 3
    shown = explanation._repr_html_()
    assert all(svg in shown for svg in files.values())
    page = explanation.report()
    assert page.startswith("<!DOCTYPE html>")
    assert f"dynocar explain {recordings} --report report.html" in page


def test_predictions_are_tables(
    explanation: dynocar.Explanation, recordings: Path, tmp_path: Path
) -> None:
    done = dynocar_command("explain", recordings, "--predictions", tmp_path / "stated")
    assert done.returncode == 0, done.stderr
    stated = pandas.read_csv(tmp_path / "stated/06.csv")
    predicted = pandas.DataFrame.from_arrow(explanation.predictions["runs/06.csv"])
    assert list(predicted.columns) == list(stated.columns) == ["time_s", "speed_mps"]
    np.testing.assert_allclose(predicted.to_numpy(), stated.to_numpy(), atol=1e-3)
    assert set(explanation.predictions) == {f"runs/0{number}.csv" for number in (1, 2, 3, 6)}


def words_of(*arguments: object) -> str:
    done = dynocar_command(*arguments)
    assert done.returncode in (1, 2), done
    return done.stderr.strip().removeprefix("dynocar: ")


def test_a_train_of_a_recording_is_chosen(
    recordings: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A recording is unpacked by the program for recordings.
    monkeypatch.setenv("PATH", f"{PROGRAMS}{os.pathsep}{os.environ['PATH']}")
    path = tmp_path / "run.mcap"
    done = dynocar_command("convert", recordings, "-o", path)
    assert done.returncode == 0, done.stderr
    assert dynocar.check(path, train=1).valid
    assert len(dynocar.read_dataset(path, train=1).runs) == 4
    chosen = dynocar.identify(path, estimator="ls", train=1)
    only = dynocar.identify(path, estimator="ls")
    assert chosen.estimators[0].values.a == only.estimators[0].values.a
    words = "expected samples of train 7; those in it are of 1"
    assert words in dynocar.check(path, train=7).errors[0]
    asked: list[Any] = [dynocar.read_dataset, dynocar.identify, dynocar.explain]
    for ask in asked:
        with pytest.raises(dynocar.InputError, match=words):
            ask(path, train=7)


def test_errors_are_in_the_words_of_the_commands(recordings: Path, tmp_path: Path) -> None:
    folder = tmp_path / "wrong"
    subprocess.run(["cp", "-r", recordings, folder], check=True)
    train = folder / "train.toml"
    lines = train.read_text().splitlines()
    place = next(place for place, line in enumerate(lines) if line.startswith("mass_t"))
    lines[place] = "mass_t = -1"
    train.write_text("\n".join(lines))
    for call in (dynocar.read_dataset, dynocar.identify, dynocar.explain):
        with pytest.raises(dynocar.InputError) as refusal:
            call(folder)
        assert str(refusal.value) == words_of("explain", folder)
        assert (refusal.value.file, refusal.value.line) == (str(train), place + 1)
        again = pickle.loads(pickle.dumps(refusal.value))
        assert (str(again), again.line) == (str(refusal.value), place + 1)
    checked = dynocar.check(folder)
    assert not checked.valid and checked.errors == [words_of("check", folder)]
    with pytest.raises(dynocar.InputError) as refusal:
        dynocar.explain(tmp_path / "nowhere")
    assert str(refusal.value) == words_of("explain", tmp_path / "nowhere")
    with pytest.raises(dynocar.InputError) as refusal:
        dynocar.identify(recordings, estimator="guess")
    assert str(refusal.value) == words_of("identify", recordings, "--estimator", "guess")
    with pytest.raises(dynocar.InputError) as refusal:
        dynocar.identify(recordings, estimator="ls", all=True)
    assert str(refusal.value) == words_of("identify", recordings, "--all", "--estimator", "ls")
    with pytest.raises(dynocar.InputError, match="expected a dataset's folder"):
        dynocar.read_dataset(recordings / "train.toml")


def test_results_take_the_place_of_no_data(
    explanation: dynocar.Explanation, recordings: Path
) -> None:
    before = (recordings / "train.toml").read_text()
    with pytest.raises(dynocar.InputError, match="is none of this command's results"):
        explanation.write_grown(recordings)
    assert (recordings / "train.toml").read_text() == before


def test_progress_is_reported_while_other_threads_run(recordings: Path) -> None:
    steps: list[tuple[float, str, int]] = []
    counts = [0]
    is_done = threading.Event()

    def count() -> None:
        while not is_done.is_set():
            counts[0] += 1
            time.sleep(0.001)

    def stated(share: float, what: str) -> None:
        assert threading.current_thread() is threading.main_thread()
        steps.append((share, what, counts[0]))

    thread = threading.Thread(target=count)
    thread.start()
    try:
        dynocar.explain(recordings, progress=stated)
    finally:
        is_done.set()
        thread.join()
    assert len(steps) > 10 and steps[0][0] == 0.0 and steps[-1][:2] == (1.0, "done")
    assert {"reading the runs", "traction gain"} <= {what for _, what, _ in steps}
    assert steps[-1][2] > steps[0][2]


def test_what_progress_raises_ends_the_work(recordings: Path) -> None:
    def stated(share: float, what: str) -> None:
        raise LookupError("enough")

    before = threads()
    with pytest.raises(LookupError, match="enough"):
        dynocar.explain(recordings, progress=stated)
    wait_for(lambda: threads() <= before)


def threads() -> int:
    """Threads of this process, Python's own or not."""
    return len(os.listdir("/proc/self/task"))


INTERRUPTED = """
import sys, time
import dynocar

def is_busy():
    before = time.process_time()
    time.sleep(0.5)
    return time.process_time() - before > 0.1

try:
    dynocar.explain(sys.argv[1], progress=lambda share, what: print(what, flush=True))
except KeyboardInterrupt:
    while is_busy():
        pass
    print("interrupted", flush=True)
"""


def test_ctrl_c_ends_an_explanation() -> None:
    program = Lines(sys.executable, "-c", INTERRUPTED, ROOT / "config/demo")
    program.wait_for_line("fitting a, b, c")
    program.process.send_signal(signal.SIGINT)
    assert program.process.wait(PATIENCE_S) == 0
    program.wait_for_line("interrupted")
    assert "done" not in program.lines


def test_a_terminal_sees_how_far_the_work_is(recordings: Path) -> None:
    main, other = os.openpty()
    code = f"import dynocar; dynocar.explain({str(recordings)!r})"
    stated = b""
    with subprocess.Popen([sys.executable, "-c", code], stderr=other) as process:
        os.close(other)
        while chunk := read_some(main):
            stated += chunk
        assert process.wait(PATIENCE_S) == 0
    assert b"100 %  done" in stated and stated.endswith(b"\r\x1b[K")
    quiet = subprocess.run([sys.executable, "-c", code], capture_output=True, timeout=PATIENCE_S)
    assert (quiet.returncode, quiet.stderr, quiet.stdout) == (0, b"", b"")


def read_some(terminal: int) -> bytes:
    try:
        return os.read(terminal, 4096)
    except OSError:  # the other side is closed
        return b""


def test_results_go_to_other_processes_and_back(recordings: Path, tmp_path: Path) -> None:
    dataset = pickle.loads(pickle.dumps(dynocar.read_dataset(recordings)))
    again = dynocar.read_dataset(recordings)
    for name, column in again.runs[0].columns.items():
        np.testing.assert_array_equal(dataset.runs[0].columns[name], column)
    assert pyarrow.table(dataset).equals(pyarrow.table(again))
    explanation = dynocar.explain(recordings)
    carried = pickle.loads(pickle.dumps(pickle.loads(pickle.dumps(explanation))))
    assert carried == explanation and str(carried) == str(explanation)
    assert carried.report() == explanation.report() and carried.plots == explanation.plots
    assert list(carried.predictions) == list(explanation.predictions)
    grown = [it.write_grown(tmp_path / name) for it, name in ((explanation, "a"), (carried, "b"))]
    texts = [[Path(file).read_text() for file in files.files] for files in grown]
    assert texts[0] == texts[1]


def test_a_forked_child_answers_as_its_parent(recordings: Path) -> None:
    here = [str(dynocar.check(recordings)), str(dynocar.identify(recordings))]
    with multiprocessing.get_context("fork").Pool(2) as pool:
        check = pool.map_async(dynocar.check, [recordings] * 4)
        identify = pool.apply_async(dynocar.identify, (recordings,))
        assert {str(it) for it in check.get(120)} == {here[0]}
        assert str(identify.get(120)) == here[1]
