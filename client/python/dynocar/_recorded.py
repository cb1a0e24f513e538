"""What is learned from recorded runs: the commands ``check``, ``identify`` and ``explain``.

Units are SI and part of the names; Davis coefficients are in N/kN and m/s. ``print`` of a result gives
the command's own words. Long work leaves other threads running and ends with Ctrl-C.
"""

from __future__ import annotations

import html
import json
import os
import sys
from collections.abc import Callable, Iterable
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from . import _native
from ._kept import Kept
from ._records import Record, _restored

PathLike = str | os.PathLike[str]
# Given the share done, 0 to 1, and what is being done.
Progress = Callable[[float, str], object]


class Table:
    """Columns over time. pandas, polars and pyarrow take it without a copy: ``pyarrow.table(table)``,
    ``polars.DataFrame(table)``, ``pandas.DataFrame.from_arrow(table)``."""

    def __init__(self, native: _native.Table) -> None:
        self._native = native

    @cached_property
    def columns(self) -> dict[str, NDArray[np.float64]]:
        """The columns by their names, read-only and in the table's own memory; NaN where a value is
        missing."""
        # NumPy's own types do not know its array interface.
        columns: list[tuple[str, Any]] = list(self._native.columns())
        return {name: np.asarray(column) for name, column in columns}

    def __reduce__(self) -> tuple[type[Table], tuple[_native.Table]]:
        return (Table, (self._native,))

    def __len__(self) -> int:
        return len(self._native)

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        return self._native.__arrow_c_stream__(requested_schema)


class Note(Record):
    """What may spoil a result."""

    code: str
    severity: str  # "info", "warning" or "fundamental": with the last there is no verdict
    runs: list[str]  # files; empty where it is about the train or the line
    text: str


class Davis(Record):
    """A number for each of a in N/kN, b in N/kN per m/s, c in N/kN per (m/s)²."""

    a: float
    b: float
    c: float


class _Answer(Record):
    """A result with the command's own words."""

    def __init__(self, fields: dict[str, Any], words: str) -> None:
        super().__init__(fields)
        self.__dict__["_words"] = words

    def __str__(self) -> str:
        return str(self.__dict__["_words"])


class Checked(_Answer):
    """What was understood of a path: ``dataset``, ``train``, ``track`` or ``daemon``, as it is one.

    ``docs/guides/datasets.md`` says what the counts mean.
    """

    _kinds = {"notes": Note}
    _optional = ("error", "dataset", "train", "track", "daemon")

    path: str
    kind: str | None  # "dataset", "train", "track", "daemon"; None where it is none of them
    valid: bool
    errors: list[str]
    notes: list[Note]


class Run(Record):
    """A recorded run: what ``check`` says of it, and its table."""

    file: str
    role: str  # "fit" or "holdout"
    direction: int  # 1 while the chainage grows, else -1
    mass_kg: float
    samples: int
    table: Table

    @property
    def columns(self) -> dict[str, NDArray[np.float64]]:
        """``time_s`` and every quantity of which any run of the dataset has a value."""
        return self.table.columns

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        return self.table.__arrow_c_stream__(requested_schema)


class Dataset(_Answer):
    """A dataset with its runs. Arrow sees all runs as one table, distinguished by the column ``run``."""

    _kinds = {"notes": Note, "runs": Run}
    _optional = ("track",)

    name: str
    description: str | None
    notes: list[Note]
    train: Record
    track: Record | None
    runs: list[Run]
    table: Table

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        return self.table.__arrow_c_stream__(requested_schema)


class Estimator(Record):
    """What one estimator learned."""

    name: str
    status: str
    reason: str
    values: Record  # by parameter, units in the names
    std: Record
    resistance: list[Record]  # speed_mps, w0_n_per_kn, std
    samples: Record  # used, rejected by reason, lost
    updates: int


class Identified(_Answer):
    """What the daemon's pipelines learned from recorded runs."""

    _kinds = {"notes": Note, "estimators": Estimator}
    _optional = ("runs", "between_runs")

    dataset: str
    notes: list[Note]
    estimators: list[Estimator]
    not_run: list[str]  # in addition to the recommended ones, where nobody chose
    runs: list[Record] | None
    between_runs: list[Record] | None


class Place(Record):
    """Where an effect acts; what is not given is ``None``, what is given holds together."""

    _optional = (
        "intervals_m",
        "windows",
        "runs",
        "speed_range_mps",
        "covariate",
        "uncertainty_95",
    )

    intervals_m: list[list[float]] | None
    windows: list[Record] | None  # run, t_start_s, t_end_s
    runs: list[str] | None
    speed_range_mps: list[float] | None
    covariate: Record | None
    uncertainty_95: Record | None


class Meaning(Record):
    """What an effect means on the runs that were fitted."""

    _optional = ("share_of_traction_energy", "distance_error_60_s_m")

    energy_kwh_per_100_km: float  # what it takes from the train; negative where it gives
    share_of_traction_energy: float | None
    distance_error_60_s_m: list[float] | None  # a minute ahead: without and with the effect


class FoundEffect(Record):
    """An effect that the declared model lacks."""

    _kinds = {"where": Place, "meaning": Meaning}
    _optional = ("runners_up", "contradiction", "over_time", "held_out")

    kind: str
    where: Place
    parameters: Record
    std: Record  # standard deviations of the parameters
    p_value: float  # chance that the search finds as much where nothing acts
    error_reduction: float  # share of the open-loop error on the fit runs
    meaning: Meaning
    contradiction: str | None  # what positions and motion say against each other
    over_time: list[Record] | None  # numbers that change over the runs, in parts of them
    held_out: Record | None  # its numbers by the runs held out alone
    runners_up: list[Record] | None


class BaseResistance(Davis):
    """a, b and c fitted together with the effects."""

    _kinds = {"std": Davis, "told_by_data": Davis}

    std: Davis
    told_by_data: Davis  # 1 where the data say all, 0 where they say nothing


class Plot(NamedTuple):
    """A plot of the report, which a notebook shows."""

    name: str
    svg: str

    def __repr__(self) -> str:
        return f"<plot {self.name}>"

    def _repr_svg_(self) -> str:
        return self.svg


class GrownFiles(NamedTuple):
    """An updated model as files, and the kinds of effects that they cannot express."""

    files: list[Path]
    not_expressed: list[str]


class Explanation(_Answer):
    """Which effect explains what the declared model leaves. A notebook shows it with the plots."""

    _kinds: ClassVar[dict[str, type[Record]]] = {
        "notes": Note,
        "effects": FoundEffect,
        "base": BaseResistance,
    }
    _optional = ("experiment", "unscored", "unexplained_n_per_kn")

    verdict: str  # "none", "effect", "ambiguous", "unknown" or "insufficient_data"
    statement: str
    notes: list[Note]
    effects: list[FoundEffect]  # the strongest first
    ambiguous_with: list[str]
    experiment: str | None
    base: BaseResistance
    scored_runs: int
    unscored: str | None
    rmse_before: float | None  # m/s on the holdout runs, without the effects
    rmse_after: float | None
    error_reduction_interval: list[float] | None  # 95 %
    unexplained_n_per_kn: float | None
    considered: list[Record]
    identifiability: list[Record]  # kind, parameter, std at no effect, told, alike

    def __init__(self, native: _native.Explained | Kept) -> None:
        super().__init__(json.loads(native.json()), native.text())
        self.__dict__["_native"] = native

    @cached_property
    def predictions(self) -> dict[str, Table]:
        """Speeds that the model with the effects predicts, by run: ``time_s``, ``speed_mps``."""
        return {file: Table(table) for file, table in self._native.predictions()}

    @cached_property
    def plots(self) -> list[Plot]:
        """The report's plots."""
        return [Plot(name, svg) for name, svg in self._native.plots()]

    def report(self) -> str:
        """The report for people: one page of HTML that needs nothing else."""
        return str(self._native.page())

    def write_grown(self, folder: PathLike) -> GrownFiles:
        """Writes the model with the effects as ``train.toml`` and ``track.toml``."""
        return GrownFiles(*self._native.write_grown(folder))

    def __reduce__(self) -> tuple[Any, ...]:
        # What another process may ask for is made now: the runs stay here.
        state = {key: value for key, value in self.__dict__.items() if key != "_native"}
        state["_native"] = Kept.of(self._native)
        return (_restored, (type(self), state))

    def _repr_html_(self) -> str:
        plots = "".join(plot.svg for plot in self.plots)
        return f"<p>{html.escape(self.statement)}</p>\n{plots}"


def _as(kind: type[Checked] | type[Identified], answer: tuple[str, str]) -> Any:
    text, words = answer
    return kind(json.loads(text), words)


def check(path: PathLike, *, train: int | None = None) -> Checked:
    """Says what is understood of a dataset, a train, a line or a daemon's configuration; ``train`` chooses
    one of a recording that holds several, here and below.

    What is wrong with it is reported by ``valid`` and ``errors`` and raises nothing.
    """
    return _as(Checked, _native.check(path, train))  # type: ignore[no-any-return]


def read_dataset(path: PathLike, *, train: int | None = None) -> Dataset:
    """Reads a dataset with all its runs: its folder or its ``dataset.toml``.

    Raises ``InputError`` for the first mistake.
    """
    (text, words), each, every = _native.read(path, train)
    answer = json.loads(text)
    fields = {**answer["dataset"], **{key: answer.get(key) for key in ("notes", "train", "track")}}
    dataset = Dataset({**fields, "table": Table(every)}, words)
    for run, table in zip(dataset.runs, each):
        run._fields["table"] = Table(table)
    return dataset


def identify(
    path: PathLike,
    *,
    train: int | None = None,
    estimator: str | Iterable[str] | None = None,
    all: bool = False,
    per_run: bool = False,
    traction_only: bool = False,
) -> Identified:
    """Learns the train's parameters from a dataset with the daemon's own pipelines, to the same bits.

    The recommended ones that the train and the recordings permit; ``estimator`` names one or several
    instead, ``all=True`` asks every one. ``per_run`` also learns from each run alone and says how much
    the runs differ, ``traction_only`` uses the forces under traction only: for recordings without the
    friction brake's force.
    """
    names = [estimator] if isinstance(estimator, str) else list(estimator or ())
    answer = _native.identify(path, train, names, all, per_run, traction_only)
    return _as(Identified, answer)  # type: ignore[no-any-return]


def explain(
    path: PathLike,
    *,
    train: int | None = None,
    traction_only: bool = False,
    progress: Progress | None = None,
) -> Explanation:
    """Finds what the declared model of a dataset leaves, traces it to an effect and scores the model with
    it.

    ``progress`` is called with the share done and with what is being done; what it raises ends the
    work. Without it, a line on standard error reports it, where that is a terminal.
    """
    is_shown = progress is None and sys.stderr is not None and sys.stderr.isatty()
    try:
        shown = _tell if is_shown else progress
        return Explanation(_native.explain(path, train, traction_only, shown))
    finally:
        if is_shown:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)


def _tell(share: float, what: str) -> None:
    print(f"\r\x1b[K{100 * share:3.0f} %  {what}", end="", file=sys.stderr, flush=True)
