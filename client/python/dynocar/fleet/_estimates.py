"""The numbers of a train out of its answer, in a form that trains can be compared by."""

from __future__ import annotations

from typing import Any, NamedTuple

from ._statistics import Estimate, pool

NORMAL_95 = 1.959963984540054
# What data hardly determine is not compared: it is mostly what was declared.
LEAST_TOLD = 0.5
# Two stretches are the same place where they share so much of the shorter one.
SAME_PLACE = 0.5
# Kinds that act at a place of the line; a tunnel that the map lacks may be reported as either.
PLACES = ("local_resistance", "tunnel_drag")
# Values of no effect, where that is not 0.
NO_EFFECT = {
    "speed_scale": 1.0,
    "gain": 1.0,
    "c_factor": 1.0,
    "mass_factor": 1.0,
    "achieved_ratio": 1.0,
}
UNITS = {
    "a": "N/kN",
    "b": "N/kN per m/s",
    "c": "N/kN per (m/s)²",
    "mass": "1",
    "extra_n_per_kn": "N/kN",
}

Answer = dict[str, Any]


class Found(NamedTuple):
    """An effect that one train's answer names."""

    train: str
    line: str | None
    kind: str
    interval_m: tuple[float, float] | None  # none where it acts everywhere
    ends_std_m: tuple[float, float] | None
    parameters: dict[str, Estimate]


def estimates(answer: Answer) -> dict[str, Estimate]:
    """a, b, c less the declared ones, and the mass over the declared one, where the data determine them."""
    estimates: dict[str, Estimate] = {}
    explained = answer["answer"]
    if explained["verdict"] != "insufficient_data":
        base = explained["base"]
        for name in "abc":
            if base["told_by_data"][name] >= LEAST_TOLD and base["std"][name] > 0:
                away = base[name] - answer["declared_abc"][name]
                estimates[name] = Estimate(away, base["std"][name])
    masses = [
        Estimate(run["mass_t"] / run["declared_t"], run["std_t"] / run["declared_t"])
        for run in answer["masses"]
        if run["status"] == "estimated" and run["mass_t"] and run["std_t"]
    ]
    if masses:
        pooled = pool(masses)
        stated = 1 / sum(1 / mass.std**2 for mass in masses) ** 0.5
        # So that 1.96 of them make 95 % however few runs there are.
        std = max((pooled.high - pooled.low) / 2 / NORMAL_95, stated)
        estimates["mass"] = Estimate(pooled.mean, std)
    return estimates


def effects(answer: Answer) -> list[Found]:
    """The effects that a train's answer names, but for those of certain runs; each stretch of line for
    itself, though an answer gives several of a kind one size."""
    return [
        found
        for effect in answer["answer"]["effects"]
        if effect["where"].get("runs") is None and effect["where"].get("windows") is None
        for found in _found(answer, effect)
    ]


def _found(answer: Answer, effect: Answer) -> list[Found]:
    where, kind = effect["where"], effect["kind"]
    parameters = {
        name: Estimate(value, effect["std"][name])
        for name, value in effect["parameters"].items()
        if isinstance(value, (int, float)) and (effect["std"].get(name) or 0) > 0
    }
    train, line = answer["train"], answer.get("line")
    if kind not in PLACES or not where.get("intervals_m"):
        return [Found(train, line, kind, None, None, parameters)]
    intervals = where["intervals_m"]
    ends = (where.get("uncertainty_95") or {}).get("intervals_m") or [None] * len(intervals)
    return [
        Found(train, line, kind, (start, end), _ends_std(of_ends), parameters)
        for (start, end), of_ends in zip(intervals, ends)
    ]


def _ends_std(ends: list[list[float]] | None) -> tuple[float, float] | None:
    if ends is None:
        return None
    start, end = (max(1.0, (high - low) / 2 / NORMAL_95) for low, high in ends)
    return start, end


def is_same(one: Found, other: Found) -> bool:
    """Whether two effects may be one: of the same kind, or at the same place of the same line."""
    if one.interval_m is not None and other.interval_m is not None:
        return one.line == other.line and overlap(one.interval_m, other.interval_m) >= SAME_PLACE
    # What no kind of the library explains is another thing in every train.
    is_placed = one.interval_m is not None or other.interval_m is not None
    return one.kind == other.kind and one.kind != "unknown" and not is_placed


def overlap(one: tuple[float, float], other: tuple[float, float]) -> float:
    """Length that two stretches share, over the length of the shorter one."""
    shared = max(0.0, min(one[1], other[1]) - max(one[0], other[0]))
    shorter = min(one[1] - one[0], other[1] - other[0])
    return shared / shorter if shorter > 0 else 0.0
