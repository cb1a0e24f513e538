"""What a fleet's folder holds: for each train its dataset, or its Parquet partitions by day."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from .._errors import InputError
from . import _toml

MONTH = re.compile(r"\d{4}-(0[1-9]|1[0-2])")
DAY = re.compile(MONTH.pattern + r"-(0[1-9]|[12]\d|3[01])")


class Unit(NamedTuple):
    """What is explained together: the runs of a train, of one month where the months are known."""

    train: str
    month: str  # as 2026-05; empty where all runs are one dataset
    manifest: Path  # the dataset's description, of partitions its columns
    train_file: Path | None  # of partitions
    track_file: Path | None
    partitions: tuple[Path, ...]  # Parquet files; empty for a dataset

    @property
    def name(self) -> str:
        return f"{self.train}.{self.month}" if self.month else self.train

    def files(self) -> list[Path]:
        """Every file that is read, a recording once."""
        if self.partitions:
            described = [self.manifest, self.train_file, self.track_file]
            return [file for file in described if file is not None] + list(self.partitions)
        return list(_named_by(self.manifest))

    def key(self, options: str) -> str:
        """SHA-256 of all that the answer depends on."""
        total = hashlib.sha256(options.encode())
        for file in self.files():
            try:
                with open(file, "rb") as opened:
                    digest = _digest(opened)
            except OSError as error:
                raise InputError(f"{file}: cannot be read: {error.strerror}", str(file)) from error
            # Names distinguish runs, and where the fleet lies does not matter.
            name = os.path.relpath(file, self.manifest.parent)
            total.update(f"{name}\0{digest}\0".encode())
        return total.hexdigest()


def _digest(opened: BinaryIO) -> str:
    digest = hashlib.sha256()
    while chunk := opened.read(1 << 20):
        digest.update(chunk)
    return digest.hexdigest()


def _named_by(description: Path) -> Iterator[Path]:
    """A description and the files that it names, each in turn where it is one."""
    yield description
    if description.suffix != ".toml":
        return
    for text in _texts(_toml.read(description)):
        file = description.parent / text
        if file.is_file() and file != description:
            yield from _named_by(file)


def _texts(value: Any) -> Iterator[str]:
    if isinstance(value, str) and 0 < len(value) < 256 and "\0" not in value:
        yield value
    elif isinstance(value, (dict, list)):
        for part in value.values() if isinstance(value, dict) else value:
            yield from _texts(part)


def units(folder: Path) -> list[Unit]:
    """What a fleet's folder holds, by train and month."""
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder", str(folder))
    found: list[Unit] = []
    for train in sorted(entry for entry in folder.iterdir() if entry.is_dir()):
        found += _of_train(folder, train, train.name.removeprefix("train="))
    if not found:
        wanted = "train=NAME/day=YYYY-MM-DD/*.parquet or NAME/dataset.toml"
        raise InputError(f"{folder}: no trains: expected folders {wanted}", str(folder))
    names = [unit.name for unit in found]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{folder}: two folders hold train {name}", str(folder))
    return found


def _of_train(fleet: Path, folder: Path, train: str) -> list[Unit]:
    if list(folder.glob("day=*")):
        return _of_partitions(fleet, folder, train)
    if (folder / "dataset.toml").is_file():
        return [Unit(train, "", folder / "dataset.toml", None, None, ())]
    months = [
        Unit(train, month, entry / "dataset.toml", None, None, ())
        for entry in sorted(folder.iterdir())
        if MONTH.fullmatch(month := entry.name.removeprefix("month="))
        and (entry / "dataset.toml").is_file()
    ]
    if not months and folder.name.startswith("train="):
        wanted = "day=YYYY-MM-DD/*.parquet, dataset.toml or YYYY-MM/dataset.toml"
        raise InputError(f"{folder}: no recordings: expected {wanted}", str(folder))
    return months


def _of_partitions(fleet: Path, folder: Path, train: str) -> list[Unit]:
    def described(name: str) -> Path | None:
        return next((at / name for at in (folder, fleet) if (at / name).is_file()), None)

    manifest, train_file = described("dataset.toml"), described("train.toml")
    for name, file in (("dataset.toml", manifest), ("train.toml", train_file)):
        if file is None:
            raise InputError(f"{folder}: no {name}, nor beside the trains' folders", str(folder))
    assert manifest is not None
    of_month: dict[str, list[Path]] = {}
    for day in sorted(folder.glob("day=*")):
        if not DAY.fullmatch(day.name.removeprefix("day=")):
            raise InputError(f"{day}: expected a day as day=2026-05-03", str(day))
        of_month.setdefault(day.name[4:11], []).extend(sorted(day.glob("*.parquet")))
    return [
        Unit(train, month, manifest, train_file, described("track.toml"), tuple(files))
        for month, files in of_month.items()
        if files
    ]
