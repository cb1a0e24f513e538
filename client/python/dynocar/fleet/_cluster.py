"""A fleet's trains on the workers of a Dask cluster; answers are kept as they come."""

from __future__ import annotations

import json
import logging
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from .._errors import InputError, WorkError
from ._extra import needed
from ._work import Order, explained

Work = Callable[[Order], dict[str, Any] | None]
ReportLine = Callable[[str], object]


@contextmanager
def connected(scheduler: str | None, workers: int | None) -> Iterator[Any]:
    """A client of the scheduler at an address, else of workers on this machine, one for each core."""
    distributed = needed("distributed")
    if scheduler is None:
        count = workers or os.cpu_count() or 1
        options: dict[str, Any] = {
            "n_workers": count,
            "threads_per_worker": 1,
            "dashboard_address": ":0",
        }
        # What becomes of the trains is reported below; Dask's own words about its ends are none of it.
        options["silence_logs"] = logging.CRITICAL
        # On a busy machine a worker needs long to come back; given up, it would never.
        patience = {"distributed.deploy.lost-worker-timeout": "1 hour"}
        with (
            needed("dask").config.set(patience),
            distributed.LocalCluster(**options) as cluster,
            distributed.Client(cluster) as client,
        ):
            yield client
        return
    try:
        client = distributed.Client(scheduler, timeout="30s")
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(f"{scheduler}: no scheduler answers there: {error}") from error
    with client:
        yield client


def work_off(
    client: Any, orders: Iterable[Order], kept: Path, report_line: ReportLine, work: Work = explained
) -> dict[str, dict[str, Any]]:
    """Every order's answer by its name; each is kept as a file as soon as it is there.

    A worker that dies gives its train back to the others. A train on which four workers died
    (`distributed.scheduler.allowed-failures`) may only have waited beside one that kills: it is
    asked again, alone, before it is reported as failed.
    """
    of_name = {order.name: order for order in orders}
    answers = {name: read_answer(kept, name) for name in of_name}
    asked = {
        name: order._replace(known_key=known["key"] if known and "error" not in known else None)
        for (name, order), known in zip(of_name.items(), answers.values())
    }
    left = len(asked)

    def take(name: str, future: Any, answer: dict[str, Any] | None) -> None:
        nonlocal left
        left -= 1
        if future.status != "finished":
            unit = of_name[name].unit
            answer = {"train": unit.train, "month": unit.month, "key": None}
            answer["error"] = _why(future)
        if answer is not None:
            _keep(answer, kept / f"{name}.json")
            answers[name] = answer
        state = (
            "kept" if answer is None else f"failed: {answer['error']}" if "error" in answer else "done"
        )
        report_line(f"{name}: {state} ({left} left)")

    suspected = []
    for name, future, answer in _answered(client, work, asked):
        if _has_killed(future):
            suspected.append(name)
        else:
            take(name, future, answer)
    for suspect in suspected:
        for name, future, answer in _answered(client, work, {suspect: asked[suspect]}):
            take(name, future, answer)
    return {name: answer for name, answer in answers.items() if answer is not None}


def _answered(
    client: Any, work: Work, asked: dict[str, Order]
) -> Iterator[tuple[str, Any, dict[str, Any] | None]]:
    """The names with their futures and answers, as they come; all are asked at once.

    Whether an answer still holds is found out beside the data, so everything is asked for.
    """
    futures = client.map(work, list(asked.values()), pure=False, retries=0)
    names = dict(zip((future.key for future in futures), asked))
    # Taken at once: what only a worker holds is computed again when that worker dies.
    done = needed("distributed").as_completed(futures, with_results=True, raise_errors=False)
    for future, answer in done:
        yield names[future.key], future, answer
        future.release()


def _has_killed(future: Any) -> bool:
    """True of a train on which workers died."""
    return future.status == "error" and isinstance(
        future.exception(), needed("distributed").KilledWorker
    )


def _why(future: Any) -> str:
    if _has_killed(future):
        return "the workers that explained it died; want of memory is the usual cause"
    error = future.exception()
    return f"{type(error).__name__}: {error}"


def read_answer(kept: Path, name: str) -> dict[str, Any] | None:
    """An answer that is kept; nothing where there is none, or none that is whole."""
    try:
        answer = json.loads((kept / f"{name}.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return answer if isinstance(answer, dict) and "key" in answer else None


def _keep(answer: dict[str, Any], file: Path) -> None:
    write_text(file, json.dumps(answer, indent=1) + "\n")


def write_text(file: Path, text: str) -> None:
    """Writes a file beside its place; it takes its name once it is whole."""
    beside = file.with_name(f".{file.name}.{os.getpid()}")
    try:
        beside.write_text(text, encoding="utf-8")
        beside.replace(file)
    except OSError as error:
        beside.unlink(missing_ok=True)
        raise WorkError(f"{file}: cannot be written: {error.strerror}") from error


def on_standard_error(words: str) -> None:
    """Reports on standard error; a reader that has gone away harms nothing."""
    try:
        print(words, file=sys.stderr, flush=True)
    except OSError:
        pass
