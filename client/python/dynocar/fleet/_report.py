"""The fleet's report as one JSON."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from .. import version
from ._common import common_effects, group
from ._estimates import UNITS, Answer, effects, estimates
from ._months import changes, effects_changed
from ._statistics import Estimate, differing

RATE = 0.05


def of_month(answers: Iterable[Answer], month: str) -> dict[str, Answer]:
    """The answers of a month by train, but for those that failed."""
    return {it["train"]: it for it in answers if it["month"] == month and "error" not in it}


def months_of(answers: Iterable[Answer], month: str | None = None) -> tuple[str, str | None]:
    """The month that is reported, the last one unless it is chosen, and the one before."""
    known = sorted({it["month"] for it in answers})
    reported = month if month is not None else known[-1]
    earlier = [it for it in known if it < reported]
    return reported, earlier[-1] if earlier else None


def report(answers: Iterable[Answer], asked: Iterable[Answer], month: str | None) -> dict[str, Any]:
    """What all trains' answers say together; ``asked`` are those with an effect declared."""
    every = list(answers)
    reported, earlier = months_of(every, month)
    now = of_month(every, reported)
    before = of_month(every, earlier) if earlier is not None else {}
    of_effect = {
        (it["train"], it["declared"]["effect"]): it
        for it in asked
        if it["month"] == reported and "declared" in it
    }
    common = common_effects(group(now), now, of_effect)
    return {
        "version": version(),
        "month": reported or None,
        "month_before": earlier,
        "trains": [_train(now[train]) for train in sorted(now)],
        "failed": [
            {"train": it["train"], "month": it["month"] or None, "error": it["error"]}
            for it in every
            if "error" in it
        ],
        "false_discovery_rate": RATE,
        "differing": _differing(now, common),
        "common": common,
        "changes": changes(now, before),
        "effects_changed": effects_changed(now, before),
    }


def _train(answer: Answer) -> dict[str, Any]:
    explained = answer["answer"]
    return {
        "train": answer["train"],
        "line": answer["line"],
        "runs": answer["runs"],
        "samples": answer["samples"],
        "verdict": explained["verdict"],
        "statement": explained["statement"],
        "effects": [it.kind for it in effects(answer)],
        "estimates": {name: it._asdict() for name, it in estimates(answer).items()},
        "work": answer["work"],
    }


def _differing(now: Mapping[str, Answer], common: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Each train against the others: a, b, c, mass, and every factor on a measured force or speed."""
    numbers: dict[str, dict[str, Estimate]] = {}
    for train in sorted(now):
        for name, estimate in estimates(now[train]).items():
            numbers.setdefault(name, {})[train] = estimate
    for effect in common:
        if effect["interval_m"] is None and effect["kind"] in ("traction_gain", "wheel_diameter"):
            numbers[effect["kind"]] = {
                it["train"]: Estimate(it["value"], it["std"])
                for it in effect["trains"]
                if it["value"] is not None
            }
    numbers = {name: of_trains for name, of_trains in numbers.items() if of_trains}
    return [
        {
            "train": it.name,
            "parameter": it.parameter,
            "unit": UNITS.get(it.parameter, "1"),
            "own": it.own._asdict(),
            "others": it.others._asdict(),
            "z": it.z,
            "p_value": it.p_value,
            "is_found": it.is_found,
        }
        for it in differing(numbers, RATE)
    ]
