"""What a worker does: explains one train's dataset, as one process would."""

from __future__ import annotations

import json
import os
import resource
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

from .. import explain, identify, read_dataset, version
from .._errors import DynocarError, InputError
from . import _toml
from ._folder import Unit
from ._partitions import write_dataset


class Declared(NamedTuple):
    """An effect that others found and that a train is asked about: declared, then explained again."""

    effect: str  # the name of the common effect
    kind: str
    value: float
    interval_m: tuple[float, float] | None
    # Places that the train finds elsewhere, [start, end, N/kN]: they stay declared with it.
    beside: tuple[tuple[float, float, float], ...]


class Order(NamedTuple):
    """One unit of work, and the key of the answer that is there."""

    unit: Unit
    traction_only: bool
    declared: Declared | None
    known_key: str | None

    @property
    def name(self) -> str:
        return f"{self.unit.name}~{self.declared.effect}" if self.declared else self.unit.name

    def options(self) -> str:
        return json.dumps([version(), self.traction_only, self.declared])


# Kinds that are a factor, with their key in `[corrections]` of `train.toml`.
FACTORS = {"traction_gain": "traction_gain", "wheel_diameter": "speed_scale"}
ASKABLE = ("local_resistance", *FACTORS)


def explained(order: Order) -> dict[str, Any] | None:
    """The answer with its key; nothing where the known one still holds. What is wrong is reported, too."""
    # There is a worker for each core. Read when a process explains for the first time.
    os.environ.setdefault("RAYON_NUM_THREADS", "1")
    unit = order.unit
    answer: dict[str, Any] = {"train": unit.train, "month": unit.month, "key": None}
    if order.declared is not None:
        answer["declared"] = order.declared._asdict()
    try:
        answer["key"] = unit.key(order.options())
        if answer["key"] == order.known_key:
            return None
        wall_s, cpu_s = time.perf_counter(), time.process_time()
        with tempfile.TemporaryDirectory(prefix="dynocar-fleet-") as folder:
            answer |= _answer(order, Path(folder))
        answer["work"] = {
            "wall_s": time.perf_counter() - wall_s,
            "cpu_s": time.process_time() - cpu_s,
            "peak_memory_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        }
    except (DynocarError, OSError) as error:
        answer["error"] = str(error)
    except Exception as error:  # a fault of ours ends one train, not the fleet
        answer["error"] = f"{type(error).__name__}: {error}"
    return answer


def _answer(order: Order, folder: Path) -> dict[str, Any]:
    unit, sources = order.unit, dict[str, Path]()
    path = unit.manifest.parent
    try:
        if unit.partitions:
            path = folder
            sources = write_dataset(unit, folder)
        if order.declared is not None:
            path = _declared(order.declared, path, folder)
        explanation = explain(path, traction_only=order.traction_only, progress=_silent)
        if order.declared is not None:
            return {"answer": explanation.to_dict()}
        dataset = read_dataset(path)
        learned = identify(path, estimator="mass_kalman", per_run=True)
    except InputError as error:
        raise InputError(_in_users_words(str(error), folder, sources), error.file) from error
    track = dataset.track.to_dict() if dataset.track is not None else None
    return {
        "answer": explanation.to_dict(),
        "line": track["name"] if track else None,
        "declared_abc": {key: dataset.train[key] for key in "abc"},
        "runs": len(dataset.runs),
        "samples": sum(run.samples for run in dataset.runs),
        "masses": [
            {
                "file": run.file,
                "declared_t": run.declared_mass_t,
                "status": run.estimators[0].status,
                "mass_t": run.estimators[0].values.to_dict().get("mass_t"),
                "std_t": run.estimators[0].std.to_dict().get("mass_t"),
            }
            for run in learned.runs or []
        ],
    }


def _silent(share: float, what: str) -> None:
    """A worker reports to nobody how far it is."""


def _in_users_words(words: str, folder: Path, sources: dict[str, Path]) -> str:
    """An error's words with the partition in place of the file that was made of it."""
    for file, partition in sources.items():
        words = words.replace(str(folder / file), str(partition)).replace(file, str(partition))
    return words.replace(f"{folder}/", "")


def _declared(effect: Declared, dataset: Path, folder: Path) -> Path:
    """The dataset with an effect in its declared model."""
    manifest = _toml.read(dataset / "dataset.toml")
    track_file = dataset / manifest["track"]["file"] if "track" in manifest else None
    files = {"train": dataset / manifest["train"]["file"], "track": track_file}
    changed = folder / "declared"
    changed.mkdir()
    name = "track" if effect.interval_m else "train"
    file = files[name]
    if file is None:
        raise InputError(f"{dataset}: no track file: a place cannot be declared", str(dataset))
    tables = _toml.read(file)
    if effect.interval_m:
        known = tables["track"].setdefault("resistance", [])
        known += [[*effect.interval_m, effect.value], *map(list, effect.beside)]
    else:
        corrections = tables.setdefault("corrections", {})
        key = FACTORS[effect.kind]
        corrections[key] = corrections.get(key, 1.0) * effect.value
    _toml.write(tables, changed / f"{name}.toml")
    for other, path in files.items():
        if path is not None:
            manifest[other]["file"] = f"{name}.toml" if other == name else str(path.resolve())
    for run in manifest["runs"]:
        run["file"] = str((dataset / run["file"]).resolve())
    _toml.write(manifest, changed / "dataset.toml")
    return changed
