"""A fleet from its folder to its report."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

from .._errors import InputError, WorkError
from .._recorded import PathLike
from . import _folder
from ._cluster import ReportLine, Work, connected, on_standard_error, read_answer, work_off, write_text
from ._common import group
from ._folder import MONTH, Unit
from ._page import page
from ._report import months_of, of_month, report
from ._work import Order, explained

# Answers with an effect declared bear its name after this.
ASKED = "~"


class Fleet(NamedTuple):
    """What became of a fleet."""

    report: dict[str, Any]
    json_file: Path
    html_file: Path

    @property
    def failed(self) -> list[dict[str, Any]]:
        """Trains that could not be explained, each with its error."""
        failed: list[dict[str, Any]] = self.report["failed"]
        return failed


def explain_fleet(
    folder: PathLike,
    out: PathLike,
    *,
    scheduler: str | None = None,
    workers: int | None = None,
    month: str | None = None,
    traction_only: bool = False,
    client: Any = None,
    report_line: ReportLine = on_standard_error,
    work: Work = explained,
) -> Fleet:
    """Explains every train of a folder and writes the fleet's report.

    Works on the Dask scheduler at an address, on a ``client`` of one's own, or on ``workers``
    processes of this machine. Answers are kept below ``out`` as they come: called again, it does
    only what is missing or has changed. ``month`` (``"2026-05"``) is reported, the last one unless
    it is given; with it only that month and the one before are explained.

    A train that fails is reported in ``failed``, and the others are done. Raises ``InputError`` for a
    folder that holds no fleet.
    """
    units = _of_month(_folder.units(Path(folder)), month)
    kept = Path(out) / "answers"
    try:
        kept.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise WorkError(f"{kept}: cannot be written: {error.strerror}") from error
    if client is not None:
        return _explained(client, units, kept, month, traction_only, report_line, work)
    with connected(scheduler, workers) as made:
        return _explained(made, units, kept, month, traction_only, report_line, work)


def _of_month(units: list[Unit], month: str | None) -> list[Unit]:
    if month is None:
        return units
    if not MONTH.fullmatch(month):
        raise InputError(f"{month}: expected a month as 2026-05")
    known = sorted({unit.month for unit in units})
    if month not in known:
        there = ", ".join(it for it in known if it) or "none, each train is one dataset"
        raise InputError(f"{month}: no recordings of that month; there are {there}")
    wanted = known[max(0, known.index(month) - 1) : known.index(month) + 1]
    return [unit for unit in units if unit.month in wanted]


def _explained(
    client: Any,
    units: list[Unit],
    kept: Path,
    month: str | None,
    traction_only: bool,
    report_line: ReportLine,
    work: Work,
) -> Fleet:
    orders = [Order(unit, traction_only, None, None) for unit in units]
    answers = list(work_off(client, orders, kept, report_line, work).values())
    reported, _ = months_of(answers, month)
    now = of_month(answers, reported)
    of_train = {unit.train: unit for unit in units if unit.month == reported}
    further = [
        Order(of_train[train], traction_only, declared, None)
        for common in group(now)
        for train in common.asked(now)
        if (declared := common.declared(now[train])) is not None
    ]
    asked = list(work_off(client, further, kept, report_line, work).values())
    return _written(kept.parent, report(answers, asked, month))


def write_report(out: PathLike, *, month: str | None = None) -> Fleet:
    """Writes the report anew from the answers that ``explain_fleet`` kept."""
    names = sorted(file.stem for file in (Path(out) / "answers").glob("[!.]*.json"))
    every = {name: read_answer(Path(out) / "answers", name) for name in names}
    whole = {name: answer for name, answer in every.items() if answer is not None}
    if not whole:
        raise InputError(
            f"{out}: no answers of a fleet: run `explain` with -o {out} first", str(out)
        )
    asked = [answer for name, answer in whole.items() if ASKED in name]
    answers = [answer for name, answer in whole.items() if ASKED not in name]
    known = sorted({answer["month"] for answer in answers})
    if month is not None and month not in known:
        there = ", ".join(it for it in known if it) or "none, each train is one dataset"
        raise InputError(f"{month}: no answers of that month; there are {there}")
    return _written(Path(out), report(answers, asked, month))


def _written(out: Path, report: dict[str, Any]) -> Fleet:
    fleet = Fleet(report, out / "fleet.json", out / "fleet.html")
    write_text(fleet.json_file, json.dumps(report, indent=1) + "\n")
    write_text(fleet.html_file, page(report))
    return fleet
