"""Fleets: many trains on Dask workers, and one report."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import dynocar
import fleet_simulator as simulator
import pyarrow
import pyarrow.parquet
import pytest
from conftest import PATIENCE_S
from distributed import Client
from dynocar.fleet import Fleet, explain_fleet, write_report
from dynocar.fleet import _folder, _partitions, _toml
from dynocar.fleet._cluster import connected
from dynocar.fleet._work import Order, explained
from fleet_simulator import Truth

APRIL, MAY = ["2026-04-02", "2026-04-20"], ["2026-05-03", "2026-05-21"]
COMMON, OWN = (5000.0, 6500.0), (8500.0, 9900.0)
AT_COMMON, AT_OWN = (*COMMON, 1.2), (*OWN, 1.5)


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    with connected(None, 2) as client:
        yield client


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six trains over two months: the line has an undeclared resistance, train 13 has another mass than
    declared, and train 12 gets a place of its own in May."""
    folder = tmp_path_factory.mktemp("fleets") / "fleet"
    simulator.write_description(folder)
    for number in range(10, 16):
        truth = Truth((AT_COMMON,), mass_factor=1.08 if number == 13 else 1.0)
        days = APRIL + MAY if number != 12 else APRIL
        simulator.write_parquet_train(folder, str(number), days, truth, number)
    simulator.write_parquet_train(folder, "12", MAY, Truth((AT_COMMON, AT_OWN)), 112)
    return folder


@pytest.fixture(scope="module")
def done(fleet: Path, client: Client, tmp_path_factory: pytest.TempPathFactory) -> Fleet:
    return explain_fleet(fleet, tmp_path_factory.mktemp("report"), client=client)


def answer_of(done: Fleet, name: str) -> Any:
    return json.loads((done.json_file.parent / f"answers/{name}.json").read_text())


def test_two_workers_give_the_answer_of_one_process_to_the_last_digit(
    fleet: Path, done: Fleet, client: Client, tmp_path: Path
) -> None:
    for unit in _folder.units(fleet)[:3]:
        folder = tmp_path / unit.name
        folder.mkdir()
        _partitions.write_dataset(unit, folder)
        alone = dynocar.explain(folder).to_dict()
        assert answer_of(done, unit.name)["answer"] == json.loads(json.dumps(alone))
    for number in (1, 2):
        simulator.write_dataset(tmp_path / f"csv/{number}", Truth((AT_COMMON,)), number)
    report = explain_fleet(tmp_path / "csv", tmp_path / "report", client=client)
    for number in (1, 2):
        alone = dynocar.explain(tmp_path / f"csv/{number}").to_dict()
        assert answer_of(report, str(number))["answer"] == json.loads(json.dumps(alone))


def test_the_train_with_another_mass_is_distinguished_from_the_others(done: Fleet) -> None:
    differing = [it for it in done.report["differing"] if it["is_found"]]
    assert {it["train"] for it in differing if it["parameter"] == "mass"} == {"13"}
    own = next(it["own"] for it in differing if it["parameter"] == "mass")
    assert abs(own["value"] - 1.08) < 3 * own["std"] and own["std"] < 0.01


def common_at(done: Fleet, place_m: tuple[float, float]) -> Any:
    at = [it for it in done.report["common"] if it["interval_m"]]
    here = [it for it in at if abs(sum(it["interval_m"]) - sum(place_m)) < 400]
    assert len(here) == 1, at
    return here[0]


def test_a_place_that_all_trains_find_is_the_lines_and_pooled(done: Fleet) -> None:
    effect = common_at(done, COMMON)
    assert effect["kind"] == "local_resistance" and effect["belongs_to"] == "line"
    states = {it["train"]: it["state"] for it in effect["trains"]}
    assert set(states) == {"10", "11", "12", "13", "14", "15"}
    assert list(states.values()).count("found") >= 5 and "absent" not in states.values()
    assert effect["pooled"]["low"] < 1.2 < effect["pooled"]["high"]
    for end, true in zip(effect["ends_m"], COMMON):
        assert abs(end["mean"] - true) < 60


def test_a_place_that_one_train_finds_is_the_trains_and_the_others_do_not_count_as_zero(
    done: Fleet,
) -> None:
    effect = common_at(done, OWN)
    assert effect["belongs_to"] == "train"
    states = {it["train"]: it for it in effect["trains"]}
    assert states["12"]["state"] == "found" and effect["pooled"]["estimates"] == 1
    # The others were asked with it declared: what they then find shows what theirs is.
    absent = [it for it in states.values() if it["state"] == "absent"]
    assert absent and all(abs(it["value"]) <= 2 * it["std"] for it in absent)
    without = [it for it in states.values() if it["state"] in ("cannot_tell", "not_asked")]
    assert all(it["value"] is None for it in without)


def test_what_came_since_the_month_before_is_reported(done: Fleet) -> None:
    assert (done.report["month"], done.report["month_before"]) == ("2026-05", "2026-04")
    came = [it for it in done.report["effects_changed"] if it["what"] == "came"]
    places = [it for it in came if it["train"] == "12" and it["kind"] == "local_resistance"]
    assert len(places) == 1 and abs(places[0]["interval_m"][0] - OWN[0]) < 200
    mass = [it for it in done.report["changes"] if it["parameter"] == "mass"]
    assert len(mass) == 6 and not any(it["is_found"] for it in mass)


def test_a_restart_does_only_what_is_missing_or_changed(
    fleet: Path, done: Fleet, client: Client, tmp_path: Path
) -> None:
    out, changed = tmp_path / "report", tmp_path / "changed"
    shutil.copytree(done.json_file.parent, out)
    shutil.copytree(fleet, changed)
    lines: list[str] = []
    again = explain_fleet(changed, out, client=client, report_line=lines.append)
    assert lines and all(": kept" in line for line in lines)
    assert again.report == done.report
    (out / "answers/10.2026-05.json").unlink()
    (out / "answers/11.2026-05.json").write_text("{broken")
    (changed / "train=14/day=2026-04-02/up.parquet").unlink()
    lines.clear()
    explain_fleet(changed, out, client=client, report_line=lines.append)
    redone = {line.split(":")[0] for line in lines if "kept" not in line and "~" not in line}
    assert redone == {"10.2026-05", "11.2026-05", "14.2026-04"}


def test_the_report_is_written_anew_from_kept_answers(done: Fleet, tmp_path: Path) -> None:
    out = tmp_path / "report"
    shutil.copytree(done.json_file.parent, out)
    assert write_report(out).report == done.report
    assert write_report(out, month="2026-04").report["month_before"] is None
    with pytest.raises(
        dynocar.InputError, match="2025-01: no answers of that month; there are 2026-04"
    ):
        write_report(out, month="2025-01")


def test_a_failed_train_is_reported_and_the_rest_is_done(
    fleet: Path, client: Client, tmp_path: Path
) -> None:
    folder = tmp_path / "fleet"
    shutil.copytree(fleet, folder, ignore=shutil.ignore_patterns("train=1[2-5]", "day=2026-04*"))
    broken = folder / "train=11/day=2026-05-03/up.parquet"
    broken.write_bytes(b"no parquet")
    report = explain_fleet(folder, tmp_path / "report", client=client)
    assert [it["train"] for it in report.report["trains"]] == ["10"]
    assert [(it["train"], it["month"]) for it in report.failed] == [("11", "2026-05")]
    assert report.failed[0]["error"].startswith(f"{broken}: not a Parquet file: ")
    assert (
        "no parquet" not in report.html_file.read_text() and "11 failed" in report.html_file.read_text()
    )
    shutil.copy(fleet / "train=11/day=2026-05-03/up.parquet", broken)
    lines: list[str] = []
    assert explain_fleet(folder, tmp_path / "report", client=client, report_line=lines.append).failed == []
    assert {line.rsplit(" (", 1)[0] for line in lines if "~" not in line} == {
        "10.2026-05: kept",
        "11.2026-05: done",
    }


def test_a_worker_that_dies_is_replaced_and_a_train_that_kills_is_reported(
    fleet: Path, client: Client, tmp_path: Path
) -> None:
    folder, marks = tmp_path / "fleet", tmp_path / "marks"
    shutil.copytree(fleet, folder, ignore=shutil.ignore_patterns("train=1[3-5]", "day=2026-04*"))
    marks.mkdir()

    def work(order: Order) -> dict[str, Any] | None:
        mark = marks / order.unit.train
        is_first = not mark.exists()
        mark.touch()
        if order.unit.train == "11" or (order.unit.train == "10" and is_first):
            os._exit(1)
        return explained(order)

    report = explain_fleet(folder, tmp_path / "report", client=client, work=work)
    assert [it["train"] for it in report.report["trains"]] == ["10", "12"]
    assert [it["train"] for it in report.failed] == ["11"]
    assert report.failed[0]["error"].startswith("the workers that explained it died")


def test_partitions_become_a_dataset_with_every_value(tmp_path: Path) -> None:
    simulator.write_description(tmp_path)
    columns = simulator.run(Truth(), 1, 5, seconds=60.0)
    rows = len(columns["time_s"])
    # Two runs in one file, times as timestamps, speeds as float32, a hole, and a column of no use.
    microseconds = [int(1e6 * (1.77e9 + time)) for time in columns["time_s"]]
    table = pyarrow.table(
        {
            "run": pyarrow.array([k * 2 // rows for k in range(rows)]),
            "run_direction": pyarrow.array([1 - 2 * (k * 2 // rows) for k in range(rows)]),
            "run_role": ["holdout" if k * 2 // rows else "fit" for k in range(rows)],
            "time_s": pyarrow.array(microseconds, pyarrow.timestamp("us")).cast(
                pyarrow.timestamp("ms")
            ),
            "position_m": columns["position_m"],
            "speed_mps": pyarrow.array([None, *columns["speed_mps"][1:]], pyarrow.float32()),
            "traction_force_n": columns["traction_force_n"],
            "brake_force_n": columns["brake_force_n"],
            "notes": [["nested"]] * rows,
        }
    )
    day = tmp_path / "train=7/day=2026-05-03"
    day.mkdir(parents=True)
    pyarrow.parquet.write_table(table, day / "both.parquet", row_group_size=7)
    (unit,) = _folder.units(tmp_path)
    written = tmp_path / "written"
    written.mkdir()
    _partitions.write_dataset(unit, written)
    dataset = dynocar.read_dataset(written)
    assert [(run.role, run.direction) for run in dataset.runs] == [("fit", 1), ("holdout", -1)]
    report = [value for run in dataset.runs for value in run.columns["position_m"]]
    assert report == columns["position_m"]
    speeds = [value for run in dataset.runs for value in run.columns["speed_mps"]]
    assert speeds[0] != speeds[0] and speeds[1:] == table.column("speed_mps").to_pylist()[1:]
    times = dataset.runs[0].columns["time_s"]
    assert times[1] - times[0] == pytest.approx(0.5)


def broken_fleet(folder: Path, change: str) -> None:
    """A fleet of one train with something wrong."""
    simulator.write_description(folder)
    day = folder / "train=7" / ("day=3.5.2026" if change == "day" else "day=2026-05-03")
    day.mkdir(parents=True)
    columns: dict[str, Any] = {name: [0.0, 1.0] for name in simulator.COLUMNS}
    if change == "nested":
        columns["speed_mps"] = [[1.0], [2.0]]
    elif change == "several":
        columns["run_direction"] = [1, -1]
    elif change == "without_run":
        columns["run"] = ["a", None]
    elif change == "missing":
        del columns["brake_force_n"]
    elif change == "empty":
        columns = {name: pyarrow.array([], "float64") for name in columns}
    pyarrow.parquet.write_table(pyarrow.table(columns), day / "x.parquet")
    if change == "train":
        (folder / "train.toml").unlink()
    elif change == "manifest":
        (folder / "dataset.toml").write_text("[columns\n")
    elif change == "mass":
        text = simulator.TRAIN_TOML.replace("mass_t = 200.0", "mass_t = -1")
        (folder / "train.toml").write_text(text)


OF_A_TRAIN = {
    "nested": r"x\.parquet: column 'speed_mps': expected numbers, found list<",
    "several": r"x\.parquet: column 'run_direction': expected one value in all rows of a run",
    "without_run": r"x\.parquet: column 'run': a row without a run",
    "missing": r"x\.parquet: no column 'brake_force_n'; it has time_s, position_m",
    "empty": r"x\.parquet: no rows",
    "manifest": r"/dataset\.toml: not valid TOML: ",
    "mass": r"^/.*/train\.toml:3: .*mass_t = -1: expected a mass",
}
OF_THE_FLEET = {
    "day": r"day=3\.5\.2026: expected a day as day=2026-05-03",
    "train": r"train=7: no train\.toml, nor beside the trains' folders",
}


@pytest.mark.parametrize("change", OF_A_TRAIN)
def test_what_is_wrong_with_a_train_is_named_by_file_and_column(
    change: str, tmp_path: Path
) -> None:
    broken_fleet(tmp_path, change)
    (unit,) = _folder.units(tmp_path)
    report = explained(Order(unit, False, None, None))
    assert report is not None and re.search(OF_A_TRAIN[change], report["error"]), report["error"]


@pytest.mark.parametrize("change", OF_THE_FLEET)
def test_a_folder_that_holds_no_fleet_is_refused(change: str, tmp_path: Path) -> None:
    broken_fleet(tmp_path, change)
    with pytest.raises(dynocar.InputError, match=OF_THE_FLEET[change]):
        _folder.units(tmp_path)


def command(*arguments: object, **more: Any) -> subprocess.CompletedProcess[str]:
    line = [sys.executable, "-m", "dynocar.fleet", *map(str, arguments)]
    return subprocess.run(line, text=True, timeout=PATIENCE_S, **more)


def test_the_command_ends_with_its_status(fleet: Path, done: Fleet, tmp_path: Path) -> None:
    folder = tmp_path / "fleet"
    keep = shutil.ignore_patterns("train=1[1-5]", "day=2026-04*")
    shutil.copytree(fleet, folder, ignore=keep)
    # As the guide does: folders as they are called from where one stands.
    words = ("explain", "fleet", "-o", "report", "--workers", 1)
    report = command(*words, capture_output=True, cwd=tmp_path)
    assert report.returncode == 0 and "10.2026-05: done (0 left)\n" in report.stderr, report
    assert report.stdout.startswith("1 trains explained, 2026-05, 0 failed\n")
    (folder / "train=10/day=2026-05-03/up.parquet").write_bytes(b"")
    report = command("explain", folder, "-o", tmp_path / "report", "--workers", 1, capture_output=True)
    assert report.returncode == 1 and "failed: 10 2026-05: " in report.stdout
    for arguments, words in [
        (("explain", tmp_path / "none", "-o", tmp_path), "none: no such folder"),
        (("explain", tmp_path / "report", "-o", tmp_path), "no trains: expected folders train=NAME/"),
        (("explain", fleet, "-o", tmp_path, "--month", "May"), "May: expected a month as 2026-05"),
        (
            ("explain", fleet, "-o", tmp_path, "--month", "2025-01"),
            "no recordings of that month; there",
        ),
        (("explain", fleet, "-o", tmp_path, "--scheduler", "nonsense://x"), "no scheduler answers"),
        (
            ("explain", fleet, "-o", tmp_path, "--workers", "0"),
            "expected a number of workers from 1",
        ),
        (("report", tmp_path / "none"), "none: no answers of a fleet: run `explain` with -o"),
    ]:
        refused = command(*arguments, capture_output=True)
        assert refused.returncode == 2 and words in refused.stderr, refused


def test_a_reader_that_has_gone_and_a_full_disk_are_met(done: Fleet) -> None:
    out = done.json_file.parent
    read, write = os.pipe()
    os.close(read)
    report = command("report", out, stdout=write, stderr=subprocess.PIPE)
    os.close(write)
    assert (report.returncode, report.stderr) == (0, "")
    with open("/dev/full", "w") as full:
        report = command("report", out, stdout=full, stderr=subprocess.PIPE)
    assert report.returncode == 1
    assert (
        report.stderr
        == "dynocar.fleet: standard output: cannot be written: No space left on device\n"
    )


def test_the_page_is_complete_in_itself(done: Fleet) -> None:
    page = done.html_file.read_text()
    assert page.startswith("<!DOCTYPE html>") and "default-src 'none'" in page
    assert not re.search(r"<script|<link|<img|https?:|url\(|@import", page)
    assert "prefers-color-scheme: dark" in page
    assert "13 differs from the others in mass over the declared one" in page
    assert "a local resistance from km 5.0" in page and "it belongs to the line" in page


def test_descriptions_are_written_as_they_were_read(tmp_path: Path) -> None:
    tables = {
        "track": {"name": 'Zürich 🚂 "x"\n', "curves": [[0.0, 1e16, float("inf")]], "is": True},
        "extra": [{"n_per_kn": 1.0, "factor": [{"of": "speed_mps", "to": 2}]}],
    }
    _toml.write(tables, tmp_path / "written.toml")
    assert _toml.read(tmp_path / "written.toml") == tables
