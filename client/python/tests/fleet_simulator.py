"""Small fleets from seeds: trains as points of mass with a length on one line, whose truth is known.

A train coasts, pulls and brakes by turns; its recorded speeds and forces are noisy. What acts on it
beyond what is declared is given by `Truth`.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet

GRAVITY = 9.81
LINE_M = 14_000.0
GRADIENT = [
    (0.0, 0.0),
    (1500.0, 4.0),
    (3500.0, -3.0),
    (6000.0, 2.0),
    (8500.0, -5.0),
    (11_000.0, 3.0),
]
MASS_T, LENGTH_M, ROTATING, DECLARED = 200.0, 100.0, 0.06, (1.5, 0.01, 0.0006)
STEP_S, RECORDED_EVERY = 0.1, 5
COLUMNS = ("time_s", "position_m", "speed_mps", "traction_force_n", "brake_force_n")

TRAIN_TOML = f"""[train]
name = "simulated"
mass_t = {MASS_T}
length_m = {LENGTH_M}
cars = 4
rotating_mass_factor = {ROTATING}

[resistance]
a = {DECLARED[0]}
b = {DECLARED[1]}
c = {DECLARED[2]}

[traction]
effort = [[0.0, 150.0], [12.0, 150.0], [50.0, 40.0]]

[brake]
max_force_kn = 200.0
"""
TRACK_TOML = f"""[track]
name = "Short line"
length_m = {LINE_M}
gradient = {[list(entry) for entry in GRADIENT]}
curves = []
tunnels = []
"""
DATASET_TOML = """[dataset]
name = "simulated"

[columns]
time = { column = "time_s", unit = "s" }
position = { column = "position_m", unit = "m" }
speed = { column = "speed_mps", unit = "m/s" }
traction_force = { column = "traction_force_n", unit = "N" }
brake_force = { column = "brake_force_n", unit = "N" }
"""


@dataclass(frozen=True)
class Truth:
    """What acts on a train and is not declared."""

    # Stretches in m with their further resistance in N/kN.
    places: tuple[tuple[float, float, float], ...] = ()
    mass_factor: float = 1.0


def run(truth: Truth, direction: int, seed: int, seconds: float = 450.0) -> dict[str, list[float]]:
    """One recorded run, as columns."""
    random = np.random.default_rng(seed)
    grid = np.arange(-200.0, LINE_M + 200.0)
    per_mille = np.array([entry[1] for entry in GRADIENT])
    at = np.searchsorted([entry[0] for entry in GRADIENT], grid, side="right") - 1
    height = np.concatenate([[0.0], np.cumsum(per_mille[np.maximum(at, 0)] / 1000)])
    mass = MASS_T * truth.mass_factor * 1000
    a, b, c = DECLARED
    x, v = (400.0, 6.0) if direction > 0 else (LINE_M - 400.0, 6.0)
    mode, until_s, force, rows = "pull", 0.0, 0.0, []
    for step in range(int(seconds / STEP_S)):
        time_s = step * STEP_S
        if time_s >= until_s or v > 34.0 or v < 5.0:
            mode = (
                "brake"
                if v > 34.0
                else "pull"
                if v < 5.0
                else random.choice(["pull", "coast", "brake", "coast"])
            )
            until_s = time_s + random.uniform(15, 45) * (0.3 if mode == "brake" else 1.0)
        wanted = {"pull": min(150e3, 2.5e6 / v) * 0.6, "coast": 0.0, "brake": -80e3}[mode]
        force += float(np.clip(wanted - force, -8e3, 8e3))
        front, rear = x + LENGTH_M / 2, x - LENGTH_M / 2
        slope = direction * (height[int(front) + 200] - height[int(rear) + 200]) / LENGTH_M
        resistance = a + b * v + c * v * v
        for start, end, further in truth.places:
            resistance += further * max(0.0, min(front, end) - max(rear, start)) / LENGTH_M
        if step % RECORDED_EVERY == 0:
            measured = max(0.0, v + random.normal(0, 0.02))
            shown = force * (1 + random.normal(0, 0.004)) if force else 0.0
            rows.append(
                (
                    time_s,
                    round(x + random.normal(0, 0.5), 1),
                    measured,
                    max(shown, 0.0),
                    max(-shown, 0.0),
                )
            )
        v += (
            STEP_S
            * (force - mass * GRAVITY * (resistance / 1000 + slope))
            / (mass * (1 + ROTATING))
        )
        v = max(v, 1.0)
        x += direction * v * STEP_S
        if not 200.0 < x < LINE_M - 200.0:
            break
    return {name: [float(value) for value in column] for name, column in zip(COLUMNS, zip(*rows))}


def write_parquet_train(fleet: Path, train: str, days: list[str], truth: Truth, seed: int) -> None:
    """A train's partitions: on each day a run either way."""
    for number, day in enumerate(days):
        folder = fleet / f"train={train}" / f"day={day}"
        folder.mkdir(parents=True)
        for direction in (1, -1):
            columns = run(truth, direction, seed * 1000 + number * 2 + (direction > 0))
            table = pyarrow.table(columns)
            for name, value in (("run_direction", direction), ("run_mass_t", MASS_T)):
                table = table.append_column(name, pyarrow.array([value] * table.num_rows))
            way = "up" if direction > 0 else "down"
            pyarrow.parquet.write_table(table, folder / f"{way}.parquet", row_group_size=400)


def write_description(fleet: Path) -> None:
    """What all trains share."""
    fleet.mkdir(parents=True, exist_ok=True)
    texts = {"dataset.toml": DATASET_TOML, "train.toml": TRAIN_TOML, "track.toml": TRACK_TOML}
    for name, text in texts.items():
        (fleet / name).write_text(text)


def write_dataset(folder: Path, truth: Truth, seed: int, runs: int = 4) -> None:
    """A train as a dataset of CSV files."""
    (folder / "runs").mkdir(parents=True)
    manifest = DATASET_TOML + '\n[train]\nfile = "train.toml"\n\n[track]\nfile = "track.toml"\n'
    for number in range(runs):
        direction = 1 if number % 2 == 0 else -1
        columns = run(truth, direction, seed * 1000 + number)
        lines = [",".join(COLUMNS)]
        lines += [",".join(f"{value!r}" for value in row) for row in zip(*columns.values())]
        (folder / f"runs/{number}.csv").write_text("\n".join(lines) + "\n")
        manifest += (
            f'\n[[runs]]\nfile = "runs/{number}.csv"\ndirection = {direction}\nmass_t = {MASS_T}\n'
        )
    texts = {"dataset.toml": manifest, "train.toml": TRAIN_TOML, "track.toml": TRACK_TOML}
    for name, text in texts.items():
        (folder / name).write_text(text)
