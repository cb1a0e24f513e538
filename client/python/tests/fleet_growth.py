"""Time and memory of `explain_fleet` for 1, 8 and 64 simulated trains with one and two workers.

    python client/python/tests/fleet_growth.py

Every train has two runs of 7.5 minutes; there are eight different ones, 64 are eight of each. Rounds with
one and with two workers take turns, so that what else the machine does meets both.
"""

from __future__ import annotations

import shutil
import tempfile
import time
from pathlib import Path

import fleet_simulator as simulator
from dynocar.fleet import explain_fleet
from dynocar.fleet._cluster import connected
from fleet_simulator import Truth

DAYS = ["2026-05-03"]


def fleet_of(trains: int, kinds: Path, folder: Path) -> Path:
    simulator.write_description(folder)
    for number in range(trains):
        shutil.copytree(kinds / f"train={number % 8}", folder / f"train={100 + number}")
    return folder


def measure(fleet: Path, out: Path, workers: int) -> tuple[float, float, float]:
    """Wall time in s, processor time for a train in s, greatest memory of a worker in MiB."""
    with connected(None, workers) as client:
        start_s = time.perf_counter()
        done = explain_fleet(fleet, out, client=client, report_line=lambda words: None)
        wall_s = time.perf_counter() - start_s
    assert not done.failed, done.failed
    work = [train["work"] for train in done.report["trains"]]
    cpu_s = sum(it["cpu_s"] for it in work) / len(work)
    return wall_s, cpu_s, max(it["peak_memory_mib"] for it in work)


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for number in range(8):
            truth = Truth(((5000.0, 6500.0, 1.2),))
            simulator.write_parquet_train(folder / "kinds", str(number), DAYS, truth, number)
        print("| trains | workers | s | processor s for a train | MiB of a worker |", flush=True)
        print("| ---: | ---: | ---: | ---: | ---: |", flush=True)
        for trains in (1, 8, 64):
            fleet = fleet_of(trains, folder / "kinds", folder / f"fleet-{trains}")
            for workers in (1, 2):
                report = measure(fleet, folder / f"report-{trains}-{workers}", workers)
                print(
                    f"| {trains} | {workers} | {report[0]:.1f} | {report[1]:.2f} | {report[2]:.0f} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
